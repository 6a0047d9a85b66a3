"""Output of verbs: plain aligned tables, or one JSON object."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Mapping
from typing import Any

import click

from scenarionet_pipelines.messages import count as count
from scenarionet_pipelines.messages import shorten

_MAX_NUMBER = 1e12
"""Larger numbers are identifiers such as hashes and are printed without separators."""


def print_json(content: Mapping[str, Any]) -> None:
    """Print one JSON object; NaN and infinity become null."""
    click.echo(json.dumps(_plain(content), indent=1, ensure_ascii=False, allow_nan=False, default=str))


def _plain(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple, set, frozenset)):
        return [_plain(inner) for inner in value]
    return value


def print_table(rows: Iterable[Iterable[Any]], columns: Iterable[str] = (), max_cell: int | None = None) -> None:
    """Print rows as :func:`table` arranges them."""
    for line in table(rows, columns, max_cell):
        click.echo(line)


def table(rows: Iterable[Iterable[Any]], columns: Iterable[str] = (), max_cell: int | None = None) -> list[str]:
    """Return rows as lines with aligned columns; numeric columns are right-aligned.

    Args:
        rows: Cells of each row.
        columns: Column headers; without them no header line is printed.
        max_cell: Maximum length of a cell on a terminal; longer texts are shortened. Files and pipes get the whole
            value, wider than its column, and so does a single word, because it may be an id.
    """
    head = [*columns]
    longest = max_cell if sys.stdout.isatty() else None
    texts = [[cell(value) for value in row] for row in rows]
    body = [[shorten(text, longest if " " in text else None) for text in row] for row in texts]
    lines = [head, *body] if head else body
    if not lines:
        return []
    words = [*zip(*lines, strict=True)]
    widths = [max(min(len(text), max_cell or len(text)) for text in column) for column in words]
    is_right = [all(map(is_number, column[bool(head) :])) for column in words]
    arranged = []
    for line in lines:
        cells = [t.rjust(w) if r else t.ljust(w) for t, w, r in zip(line, widths, is_right, strict=True)]
        arranged.append("  ".join(cells).rstrip())
    return arranged


def cell(value: Any) -> str:
    """Format a value in one line."""
    if value is None:
        return "-"
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if is_number and abs(value) < _MAX_NUMBER:
        text = f"{value:,.3f}" if isinstance(value, float) else f"{value:,}"
        return text.rstrip("0").rstrip(".") if "." in text else text
    return " ".join(str(value).split())


def is_number(text: str) -> bool:
    """Whether a cell is a number, or none."""
    return text == "-" or text.replace(",", "").replace(".", "", 1).lstrip("-").isdecimal()


def size(num_bytes: float) -> str:
    """Format a number of bytes.

    Example:
        >>> size(12_300_000)
        '12.3 MB'
    """
    for unit in ("B", "kB", "MB", "GB"):
        if num_bytes < 1000:
            return f"{num_bytes:.3g} {unit}"
        num_bytes /= 1000
    return f"{num_bytes:,.3g} TB"


def duration(seconds: float) -> str:
    """Format a duration in seconds.

    Example:
        >>> duration(3725)
        '1 h 02 min'
    """
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest:02d} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60:02d} min"
