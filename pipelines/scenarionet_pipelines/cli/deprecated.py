"""Options with a new name. The old spelling works for one release and prints a warning."""

from __future__ import annotations

import click

RENAMED_OPTIONS: dict[str, dict[str, str]] = {
    "check": {"--to": "--name"},
    "convert": {"--stale": "--reconvert-stale"},
    "filter": {"--from": "--database", "--to": "--name"},
    "intersect": {"--to": "--name"},
    "merge": {"--to": "--name"},
    "mine": {"--from": "--database", "--set": "--parameter"},
    "record": {"--to": "--name"},
    "report": {"--checks": "--check", "--no-checks": "--no-check"},
    "sample": {"--to": "--name"},
    "sim": {"--to": "--name"},
    "split": {"--prefix": "--name"},
    "subtract": {"--to": "--name"},
}
"""Old and new option, by verb."""


def current_spelling(verb: str, words: list[str]) -> list[str]:
    """Return a verb's command-line words with renamed options replaced, warning once per word.

    Args:
        verb: Name of the verb.
        words: Its arguments as typed.
    """
    renamed = RENAMED_OPTIONS.get(verb, {})
    current = []
    for word in words:
        option, equals, value = word.partition("=")
        if option in renamed:
            click.echo(
                f"warning: {option} is now {renamed[option]}; the old name will be removed in the next release",
                err=True,
            )
            word = renamed[option] + equals + value
        current.append(word)
    return current
