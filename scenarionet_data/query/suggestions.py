"""What is wrong with a condition that a person typed: where, and which columns come near."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable

from scenarionet_data.errors import QueryError
from scenarionet_data.schema import tables

_UNKNOWN_COLUMN = re.compile(r'Referenced (?:column|table) "(\w+)" not found')


def in_condition(error: QueryError, where: str, layers: Iterable[str] = ()) -> QueryError:
    """The error with the place in the condition, for a column that is not there; else as it is.

    Args:
        error: What DuckDB says.
        where: The condition.
        layers: Users' columns, beside those of every lake.
    """
    found = _UNKNOWN_COLUMN.search(str(error))
    word = re.search(rf"\b{re.escape(found.group(1))}\b", where, re.IGNORECASE) if found else None
    if word is None:
        return error
    return QueryError(
        f"no column {word.group()} at character {word.start() + 1} of {where!r}; {near_columns(where, layers)}"
    )


def near_columns(where: str, layers: Iterable[str] = ()) -> str:
    """Columns of ``metadata`` and users' whose names come near the unknown words of a condition."""
    metadata = tables.load("metadata")
    columns = [column.name for column in (*metadata.columns, *metadata.derived)] + list(layers)
    words = {word.lower() for word in re.findall(r"[A-Za-z_]\w*", where)} - set(columns)
    near = [name for word in sorted(words) for name in difflib.get_close_matches(word, columns, n=3, cutoff=0.5)]
    hint = f"near are {', '.join(dict.fromkeys(near))}; " if near else ""
    return f"{hint}`scenarionet filters --columns` explains all columns"
