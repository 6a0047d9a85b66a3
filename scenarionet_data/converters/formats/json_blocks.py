"""Reads nuScenes' tables: one JSON list of flat records each, up to 1.3 GB, in bounded memory.

``json.load`` would make 10 GB of Python objects of the largest table. Here a file passes by in blocks of whole
records; of tables that hold many more rows than are needed, only the wanted records are parsed at all.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Container, Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.json

from scenarionet_data.errors import CorruptSource

BLOCK = 8 << 20
"""Bytes read at once: larger blocks take more memory and are no faster."""

_BETWEEN = re.compile(rb"\}\s*,\s*\{")


def read_list(path: Path) -> list[dict[str, Any]]:
    """All records of a small table.

    Raises:
        CorruptSource: The file is missing, or is no JSON list of objects.
    """
    try:
        records = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from error
    if not isinstance(records, list) or not all(isinstance(record, dict) for record in records):
        raise CorruptSource(f"{path}: wanted a list of records; download the tables again")
    return records


def read_rows(
    path: Path, schema: pa.Schema, key: str = "", wanted: Container[bytes] = (), block: int = BLOCK
) -> Iterator[pa.Table]:
    """The columns of ``schema``, a block of records at a time; other fields are passed over.

    Args:
        path: A table whose records hold no objects, as all 13 tables do.
        schema: Columns to read; a field that a record lacks is null, but not all of them may.
        key: When given, only records whose text field of this name is in ``wanted`` are read.
        wanted: Values of ``key``.
        block: Bytes read at once.

    Raises:
        CorruptSource: The file is missing, cut off, or holds something else.
    """
    chosen = re.compile(rb'"%s"\s*:\s*"([^"]*)"' % key.encode()) if key else None
    parsing = pa.json.ParseOptions(schema, newlines_in_values=True, unexpected_field_behavior="ignore")
    try:
        for text in _blocks(path, block):
            if chosen and text.strip() and not chosen.search(text):
                raise ValueError(f"its records have no {key!r}")
            lines = _selected(text, chosen, wanted) if chosen else _BETWEEN.sub(b"}\n{", text)
            if lines.strip():
                reading = pa.json.ReadOptions(use_threads=False, block_size=len(lines) + 1)
                rows = pa.json.read_json(io.BytesIO(lines), reading, parsing)
                lacking = [name for name in schema.names if rows[name].null_count == len(rows)]
                if lacking:
                    raise ValueError(f"its records have no {lacking[0]!r}")
                yield rows
    except (OSError, ValueError, pa.ArrowException) as error:
        raise _unreadable(path, error) from error


def _blocks(path: Path, size: int) -> Iterator[bytes]:
    """The text between ``[`` and ``]`` in pieces of whole records, as large as ``size`` or a little more."""
    with path.open("rb") as file:
        rest = file.read(size).lstrip()
        if rest[:1] != b"[":
            raise ValueError(f"it starts with {rest[:10]!r}, not with '['")
        rest = rest[1:]
        while more := file.read(size):
            rest += more
            last = rest.rfind(b"{")  # the records are flat: here the last one begins
            if last > 0:
                yield rest[:last].rstrip().removesuffix(b",")
                rest = rest[last:]
    rest = rest.rstrip()
    if rest[-1:] != b"]":
        raise ValueError("it is cut off: there is no ']' at its end")
    yield rest[:-1]


def _selected(text: bytes, key: re.Pattern[bytes], wanted: Container[bytes]) -> bytes:
    """The records of a block whose key is wanted, one after the other."""
    return b"\n".join(
        text[text.rfind(b"{", 0, found.start()) : text.find(b"}", found.end()) + 1]
        for found in key.finditer(text)
        if found[1] in wanted
    )


def _unreadable(path: Path, error: Exception) -> CorruptSource:
    if isinstance(error, FileNotFoundError):
        return CorruptSource(f"{path}: no such table; download the release's metadata again")
    reason = str(error).splitlines()[0] if str(error) else type(error).__name__
    return CorruptSource(f"{path} cannot be read ({reason}); download the release's metadata again")
