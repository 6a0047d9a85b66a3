"""Read nuScenes' tables (a JSON list of flat records each, up to 1.3 GB) in bounded memory.

``json.load`` would turn the largest table into 10 GB of Python objects. Here a file is read in blocks of whole
records, and in tables with many more rows than needed only the matching records are parsed.
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
"""Bytes per block; larger blocks use more memory and are not faster."""

_BETWEEN = re.compile(rb"\}\s*,\s*\{")


def read_list(path: Path) -> list[dict[str, Any]]:
    """Return all records of a small table.

    Raises:
        CorruptSource: The file is missing or not a JSON list of objects.
    """
    try:
        records = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from error
    if not isinstance(records, list) or not all(isinstance(record, dict) for record in records):
        raise CorruptSource(f"{path}: expected a list of records; download the tables again")
    return records


def read_rows(
    path: Path, schema: pa.Schema, key: str = "", wanted: Container[bytes] = (), block: int = BLOCK
) -> Iterator[pa.Table]:
    """Yield the columns of ``schema``, one block of records at a time; other fields are skipped.

    Args:
        path: A table of flat records, as all 13 tables are.
        schema: Columns to read; fields missing from some records are null, but not from all.
        key: Read only the records whose text field of this name is in ``wanted``.
        wanted: Values of ``key``.
        block: Bytes per block.

    Raises:
        CorruptSource: The file is missing, truncated or not such a table.
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
    """Yield the text between ``[`` and ``]`` in blocks of whole records of about ``size`` bytes."""
    with path.open("rb") as file:
        rest = file.read(size).lstrip()
        if rest[:1] != b"[":
            raise ValueError(f"it starts with {rest[:10]!r}, not with '['")
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


def _selected(text: bytes, key: re.Pattern[bytes], wanted: Container[bytes]) -> bytes:
    """Concatenate the records of a block whose key is wanted."""
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
