"""Error messages for the command line: one line, with Python advice written as options and verbs."""

from __future__ import annotations

import re

_CALL = re.compile(r"""\blake\.([a-z]+)\(["']?([^"'(),]+)["']?\)""")
_FLAG = re.compile(r"\b([a-z][a-z_]*)=(True|False)\b")
_VALUE = re.compile(r"""\b([a-z][a-z_]*)=(["'])([^"']*)\2""")


def one_line(error: BaseException | str) -> str:
    """Return an error's message in one line, with Python advice written as options.

    The excerpt of the query that DuckDB appends is left out.
    """
    lines = str(error).splitlines()
    end = next((number for number, line in enumerate(lines) if line.startswith("LINE ")), len(lines))
    return as_options(" ".join(" ".join(lines[:end]).split()))


def as_options(message: str) -> str:
    """Return a message with Python keyword arguments and methods written as the command line has them.

    Example:
        >>> as_options("give another name, or replace=True for a new version of it")
        'give another name, or --replace for a new version of it'
        >>> as_options('pass by="source_log", check=False, or lake.rebase("busy")')
        'pass --by source_log, --no-check, or `scenarionet rebase LAKE busy`'
    """
    message = _CALL.sub(r"`scenarionet \1 LAKE \2`", message)
    message = _FLAG.sub(lambda found: _option(found[1], is_on=found[2] == "True"), message)
    return _VALUE.sub(lambda found: f"{_option(found[1])} {found[3]}", message)


def _option(keyword: str, *, is_on: bool = True) -> str:
    return ("--" if is_on else "--no-") + keyword.replace("_", "-")
