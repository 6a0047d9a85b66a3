"""Structured Zarr arrays: chunks and damage. ``tests/devkits`` compares with the zarr package."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data.converters.formats.zarr2 import ChunkedTable
from scenarionet_data.errors import CorruptSource
from tests.fixtures import lyft as fixture

DTYPE = [("place", "<f8", (2,)), ("name", "<U4"), ("number", "<i4")]


@pytest.fixture
def rows() -> np.ndarray:
    made = np.zeros(23, DTYPE)
    made["place"] = np.arange(46).reshape(23, 2)
    made["name"], made["number"] = [f"é{k}" for k in range(23)], np.arange(23)
    return made


@pytest.fixture
def folder(tmp_path: Path, rows: np.ndarray) -> Path:
    fixture.write_array(tmp_path / "table", rows, 5)
    return tmp_path / "table"


@pytest.mark.parametrize(("first", "last"), [(0, 23), (0, 0), (4, 6), (5, 10), (22, 23), (23, 23), (7, 21)])
def test_any_rows_are_read(folder: Path, rows: np.ndarray, first: int, last: int) -> None:
    table = ChunkedTable(folder)
    assert len(table) == 23
    np.testing.assert_array_equal(table.rows(first, last), rows[first:last])


def test_chunks_without_compression(folder: Path, rows: np.ndarray) -> None:
    described = json.loads((folder / ".zarray").read_text()) | {"compressor": None}
    (folder / ".zarray").write_text(json.dumps(described))
    for number in range(5):
        padded = np.zeros(5, DTYPE)
        part = rows[5 * number : 5 * number + 5]
        padded[: len(part)] = part
        (folder / str(number)).write_bytes(padded.tobytes())
    np.testing.assert_array_equal(ChunkedTable(folder).rows(0, 23), rows)


def test_only_requested_chunks_are_needed(folder: Path, rows: np.ndarray) -> None:
    (folder / "0").unlink()
    (folder / "4").write_bytes(b"")
    table = ChunkedTable(folder)
    np.testing.assert_array_equal(table.rows(5, 20), rows[5:20])
    assert [path.name for path in table.chunk_files(5, 20)] == ["1", "2", "3"]
    with pytest.raises(CorruptSource, match="this chunk is missing"):
        table.rows(4, 6)
    with pytest.raises(CorruptSource, match="complete Blosc chunk"):
        table.rows(19, 21)


@pytest.mark.parametrize("size", [0, 1, 15, 16, 17, 40, -1])
def test_truncated_chunks_are_named(folder: Path, size: int) -> None:
    chunk = folder / "2"
    chunk.write_bytes(chunk.read_bytes()[:size])
    with pytest.raises(CorruptSource, match="2: expected a complete Blosc chunk"):
        ChunkedTable(folder).rows(10, 11)


def test_corrupt_payload_behind_a_valid_header_is_named(folder: Path) -> None:
    chunk = folder / "2"
    data = chunk.read_bytes()
    chunk.write_bytes(data[:16] + b"\xff" * (len(data) - 16))
    with pytest.raises(CorruptSource, match="expected a compressed chunk"):
        ChunkedTable(folder).rows(10, 11)


@pytest.mark.parametrize(
    "change",
    [
        {"zarr_format": 3},
        {"order": "F"},
        {"filters": [{"id": "delta"}]},
        {"shape": [23, 2]},
        {"shape": [-1]},
        {"chunks": [0]},
        {"chunks": [10**12]},
        {"dtype": "<f8"},
        {"dtype": [["a", "|O"]]},
        {"dtype": [["a", "nonsense"]]},
        {"compressor": {"id": "nobody"}},
    ],
)
def test_other_arrays_are_refused(folder: Path, change: dict[str, Any]) -> None:
    (folder / ".zarray").write_text(json.dumps(json.loads((folder / ".zarray").read_text()) | change))
    with pytest.raises(CorruptSource, match=r"\.zarray"):
        ChunkedTable(folder)
