"""Messages for the command line and the browser: one line, with Python advice written as options and verbs."""

from __future__ import annotations

import re

from scenarionet_pipelines.verb_tree import full_name

_CALL = re.compile(r"""`?\b(?:lake|Lake)\.([a-z_]+)\(["']?([^"'(),]+)["']?[^()]*\)`?""")
_FLAG = re.compile(r"\b([a-z][a-z_]*)=(True|False)\b")
_VALUE = re.compile(r"""\b([a-z][a-z_]*)=(["'])([^"']*)\2""")


def one_line(error: BaseException | str) -> str:
    """Return the message of an error or warning in one line, with Python advice written as options.

    The excerpt of the query that DuckDB appends is left out. Errors state in ``cli_remedy`` which option or command
    has the effect of their advice; it is appended unless the translated message contains it.
    """
    lines = str(error).splitlines()
    end = next((number for number, line in enumerate(lines) if line.startswith("LINE ")), len(lines))
    remedy = getattr(error, "cli_remedy", "")
    text = as_options(" ".join(" ".join(lines[:end]).split()), remedy)
    return text if remedy in text else f"{text} (on the command line: {remedy})"


def as_options(message: str, remedy: str = "") -> str:
    """Return a message with Python keyword arguments and methods written as the command line has them.

    Args:
        message: The message.
        remedy: The command that replaces a method call in the message, if known.

    Example:
        >>> as_options("give another name, or replace=True for a new version of it")
        'give another name, or --replace for a new version of it'
        >>> as_options('pass by="source_log", check=False, or lake.rebase("busy")')
        'pass --by source_log, --no-check, or `scenarionet db rebase LAKE busy`'
    """
    command = f"`{remedy}`" if remedy.startswith("scenarionet ") else ""
    message = _CALL.sub(lambda found: command or f"`scenarionet {full_name(found[1])} LAKE {found[2]}`", message)
    message = _FLAG.sub(lambda found: _option(found[1], is_on=found[2] == "True"), message)
    return _VALUE.sub(lambda found: f"{_option(found[1])} {found[3]}", message)


def _option(keyword: str, *, is_on: bool = True) -> str:
    return ("--" if is_on else "--no-") + keyword.replace("_", "-")


def shorten(text: str, length: int | None) -> str:
    """Shorten a text to at most ``length`` characters, ending in an ellipsis."""
    return text if length is None or len(text) <= length else text[: length - 1] + "…"


def count(number: int, noun: str) -> str:
    """Format a number with its noun.

    Example:
        >>> count(1, "scenario"), count(2000, "scenario")
        ('1 scenario', '2,000 scenarios')
    """
    return f"{number:,} {noun}" + ("" if number == 1 else "s")
