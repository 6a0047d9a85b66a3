"""Read nuScenes' tables (a JSON list of flat records each, up to 1.3 GB) in bounded memory.

``json.load`` would turn the largest table into 10 GB of Python objects. Here a file is read in blocks of whole
records, and in tables with many more rows than needed only the matching records are parsed. Arrow refuses a block for
one value of another type; such a block is parsed again record by record, and only the bad values become null.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable, Container, Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.json

from scenarionet_data.errors import CorruptSource

BLOCK = 8 << 20
"""Bytes per block; larger blocks use more memory and are not faster."""

_BETWEEN = re.compile(rb"\}\s*,\s*\{")
_ENTRY = re.compile(rb"\{[^{}]*(?:\{[^{}]*\}[^{}]*)*\}|[^\s,{}][^{}]*")
"""A record, in which a value may be an object by mistake, or what is between two records besides a comma."""
_LARGEST = {"integer": 1 << 63, "float": 1e300}


def read_list(path: Path) -> list[Any]:
    """Return all entries of a small table, which should be records.

    Raises:
        CorruptSource: The file is missing or not a JSON list.
    """
    try:
        records = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError) as error:
        raise _unreadable(path, error) from error
    if not isinstance(records, list):
        raise CorruptSource(f"{path}: expected a list of records; download the release's metadata again")
    return records


def read_rows(
    path: Path,
    schema: pa.Schema,
    key: str = "",
    tokens: Container[bytes] = (),
    *,
    is_excluding: bool = False,
    block: int = BLOCK,
) -> Iterator[pa.Table]:
    """Yield the columns of ``schema``, one block of records at a time; other fields are skipped.

    A value of another type is null, and so is a whole row that is not a JSON object.

    Args:
        path: A table of flat records, as all 13 tables are.
        schema: Columns to read; a field may be missing from some records, but not from all.
        key: Read only the records whose text field of this name is one of ``tokens``, or is missing.
        tokens: Values of ``key``.
        is_excluding: Read the records with other values instead.
        block: Bytes per block.

    Raises:
        CorruptSource: The file is missing, truncated or not such a table.
    """
    chosen = re.compile(rb'"%s"\s*:\s*"([^"]*)"' % key.encode()) if key else None
    lacking, has_rows, has_key = set(schema.names), False, not key
    try:
        for text in _blocks(path, block):
            has_key = has_key or not text.strip() or bool(chosen and chosen.search(text))
            lines = _selected(text, chosen, tokens, is_excluding) if chosen else _BETWEEN.sub(b"}\n{", text)
            rows = _parsed(lines, schema)
            if rows is not None:
                has_rows = True
                lacking -= {name for name in lacking if rows[name].null_count < len(rows)}
                yield rows
        if not has_key or (has_rows and lacking):
            raise ValueError(f"its records have no {min(lacking) if has_key else key!r}")
    except (OSError, ValueError, pa.ArrowException) as error:
        raise _unreadable(path, error) from error


def _blocks(path: Path, size: int) -> Iterator[bytes]:
    """Yield the text between ``[`` and ``]`` in blocks of whole records of about ``size`` bytes."""
    with path.open("rb") as file:
        rest = file.read(size).lstrip()
        if rest[:1] != b"[":
            raise ValueError("it does not start with '['")
        rest = rest[1:]
        while more := file.read(size):
            rest += more
            last = rest.rfind(b"{")  # start of the last record: records are flat
            if last > 0:
                yield rest[:last].rstrip().removesuffix(b",")
                rest = rest[last:]
    rest = rest.rstrip()
    if rest[-1:] != b"]":
        raise ValueError("truncated: no ']' at its end")
    yield rest[:-1]


def _selected(text: bytes, key: re.Pattern[bytes], tokens: Container[bytes], is_excluding: bool) -> bytes:
    """Concatenate the records of a block whose key is wanted, and those that have no text as key."""
    chosen, count = [], 0
    for found in key.finditer(text):
        count += 1
        if (found[1] in tokens) is not is_excluding:
            chosen.append(text[text.rfind(b"{", 0, found.start()) : text.find(b"}", found.end()) + 1])
    if count < text.count(b"{"):
        keys = [(entry, key.search(entry)) for entry in _ENTRY.findall(text)]
        chosen = [entry for entry, found in keys if found is None or (found[1] in tokens) is not is_excluding]
    return b"\n".join(chosen)


def _parsed(lines: bytes, schema: pa.Schema) -> pa.Table | None:
    """Rows of some records, or None if there are none."""
    if not lines.strip():
        return None
    try:
        if not lines.isascii():
            lines.decode()
        reading = pa.json.ReadOptions(use_threads=False, block_size=len(lines) + 1)
        parsing = pa.json.ParseOptions(schema, newlines_in_values=True, unexpected_field_behavior="ignore")
        return pa.json.read_json(io.BytesIO(lines), reading, parsing)
    except (ValueError, pa.ArrowException):
        records = [_record(text) for text in _ENTRY.findall(lines)]
        fitting = {field.name: _fitting(field.type) for field in schema}
        columns = {name: [fit(record.get(name)) for record in records] for name, fit in fitting.items()}
        return pa.table(columns, schema=schema)


def _record(text: bytes) -> dict[str, Any]:
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _fitting(kind: pa.DataType) -> Callable[[Any], Any]:
    """Function that returns a value if it is of a type, else None."""
    if pa.types.is_list(kind):
        inner = _fitting(kind.value_type)
        return lambda value: [inner(each) for each in value] if isinstance(value, list) else None
    if pa.types.is_string(kind):
        return lambda value: value if isinstance(value, str) and is_unicode(value) else None
    if pa.types.is_boolean(kind):
        return lambda value: value if isinstance(value, bool) else None
    if pa.types.is_integer(kind):
        return lambda value: int(value) if is_number(value, _LARGEST["integer"]) and value == value // 1 else None
    return lambda value: float(value) if is_number(value, _LARGEST["float"]) else None


def is_number(value: Any, limit: float) -> bool:
    """Whether a value is a number of magnitude below ``limit``, and not NaN."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < limit


def is_unicode(text: str) -> bool:
    """Whether a text has no lone surrogates, which JSON can express and UTF-8 cannot."""
    return not any("\ud800" <= letter <= "\udfff" for letter in text)


def _unreadable(path: Path, error: Exception) -> CorruptSource:
    again = "download the release's metadata again"
    if isinstance(error, FileNotFoundError):
        return CorruptSource(f"{path}: no such table; {again}")
    if isinstance(error, OSError):
        return CorruptSource(f"{path}: expected a file that can be read ({error.strerror}); {again}")
    reason = str(error) if type(error) is ValueError else "it is not JSON"
    return CorruptSource(f"{path}: expected a table in JSON, but {reason}; {again}")
