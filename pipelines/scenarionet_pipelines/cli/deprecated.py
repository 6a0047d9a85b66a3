"""Spellings with a new form. The old one works, is not in the help, and one line on standard error says the new one."""

from __future__ import annotations

import click

from scenarionet_pipelines.verb_tree import GROUPS

MOVED = {verb: (group, verb) for group, (_, verbs) in GROUPS.items() for verb in verbs} | {
    "compare-runs": ("runs", "compare")
}
"""Where the verbs are that stood beside the others."""

RENAMED_OPTIONS = {"convert": {"-O": "-p", "--option": "--parameter"}}
"""Old and new option, by verb."""


def current_verb(words: list[str]) -> list[str]:
    """Return a command line in which a verb that moved stands in its group."""
    if not words or words[0] not in MOVED:
        return words
    new = MOVED[words[0]]
    _say(f"scenarionet {words[0]}", f"scenarionet {' '.join(new)}")
    return [*new, *words[1:]]


def current_options(verb: str, words: list[str]) -> list[str]:
    """Return a verb's words with renamed options replaced."""
    renamed = RENAMED_OPTIONS.get(verb, {})
    current = []
    for word in words:
        option, equals, value = word.partition("=")
        if option in renamed:
            _say(option, renamed[option])
            word = renamed[option] + equals + value
        current.append(word)
    return current


def _say(old: str, new: str) -> None:
    click.echo(f"note: `{old}` is now `{new}`", err=True)
