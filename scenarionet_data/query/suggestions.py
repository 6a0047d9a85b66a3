"""Better messages for unknown columns in a condition: the position, and columns of similar names."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from scenarionet_data.errors import QueryError
from scenarionet_data.schema import tables

_UNKNOWN_COLUMN = re.compile(r'Referenced (?:column|table) "(\w+)" not found')


@contextmanager
def explaining(where: str, user_columns: Iterable[str] = ()) -> Iterator[None]:
    """Add position and suggestions to errors of DuckDB about unknown columns.

    Args:
        where: The condition that is run.
        user_columns: User columns of the lake.
    """
    try:
        yield
    except QueryError as error:
        found = _UNKNOWN_COLUMN.search(str(error))
        word = re.search(rf"\b{re.escape(found.group(1))}\b", where, re.IGNORECASE) if found else None
        if word is None:
            raise
        similar = similar_columns(where, user_columns)
        raise QueryError(f"no column {word.group()} at character {word.start() + 1} of {where!r}; {similar}") from error


def similar_columns(where: str, user_columns: Iterable[str] = ()) -> str:
    """Suggest columns with names similar to the unknown names in a condition."""
    metadata = tables.load("metadata")
    columns = [column.name for column in (*metadata.columns, *metadata.derived)] + list(user_columns)
    words = {word.lower() for word in re.findall(r"[A-Za-z_]\w*", where)} - set(columns)
    near = [name for word in sorted(words) for name in difflib.get_close_matches(word, columns, n=3, cutoff=0.5)]
    hint = f"similar: {', '.join(dict.fromkeys(near))}; " if near else ""
    compared = re.findall(r"(?:[=<>(,]|\b(?:IN|LIKE)\b)\s*([A-Za-z_]\w*)\b(?!\s*\()", where, re.IGNORECASE)
    texts = [word for word in compared if word.lower() in words]
    if texts:
        hint = f"a text is written in quotes, '{texts[0]}'; {hint}"
    return f"{hint}`scenarionet info filters --columns` explains all columns"
