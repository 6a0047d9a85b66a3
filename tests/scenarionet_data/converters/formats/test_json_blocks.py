"""Reading nuScenes tables in blocks gives the same records as reading them whole, for any JSON layout."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from scenarionet_data.converters.formats.json_blocks import read_list, read_rows
from scenarionet_data.errors import CorruptSource

SCHEMA = pa.schema({"token": pa.string(), "x": pa.float64(), "v": pa.list_(pa.float64()), "flag": pa.bool_()})
WORDS = st.text(st.characters(blacklist_categories=["Cs"], blacklist_characters="{}"), max_size=6)
RECORDS = st.fixed_dictionaries(
    {
        "token": st.sampled_from(["a", "b", "c", "long-token"]),
        "x": st.integers(-5, 5) | st.floats(-1e15, 1e15),
        "v": st.lists(st.floats(-9, 9), max_size=3),
        "flag": st.booleans(),
        "other": WORDS | st.lists(WORDS, max_size=2) | st.none(),
    }
)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(records=st.lists(RECORDS, max_size=12), indent=st.sampled_from([None, 0, 2]), block=st.integers(1, 300))
def test_blocks_equal_the_whole_table(
    records: list[dict[str, Any]], indent: int | None, block: int, tmp_path: Path
) -> None:
    path = tmp_path / "table.json"
    path.write_text(json.dumps(records, indent=indent), "utf-8")
    wanted = [{name: record[name] for name in SCHEMA.names} for record in records]
    found = [row for rows in read_rows(path, SCHEMA, block=block) for row in rows.to_pylist()]
    assert found == wanted
    chosen = read_rows(path, SCHEMA, "token", {b"a", b"long-token"}, block=block)
    assert [row for rows in chosen for row in rows.to_pylist()] == [
        row for row in wanted if row["token"] in ("a", "long-token")
    ]


ROW = {"token": "a", "x": 1.0, "v": [1.0], "flag": True}


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("", "does not start with"),
        ("  ", "does not start with"),
        (json.dumps(ROW), "does not start with"),
        (json.dumps([ROW, ROW])[:-1], "truncated"),
        (json.dumps([ROW, ROW])[:-20], "truncated"),
        (json.dumps([{"name": "x"}]), "its records have no 'flag'"),
        (json.dumps([ROW]).replace(":", ";"), "its records have no 'flag'"),
        (json.dumps([ROW]) + "garbage", "truncated"),
    ],
)
def test_damaged_table_is_named(tmp_path: Path, content: str, reason: str) -> None:
    path = tmp_path / "table.json"
    path.write_text(content)
    with pytest.raises(CorruptSource, match=reason):
        list(read_rows(path, SCHEMA))


BAD_VALUES: dict[str, Any] = {
    "token": [None, 5, ["a"], {"b": 1}, "\ud800"],
    "x": ["1.0", True, None, [1.0], float("nan"), 10**400],
    "v": ["text", 5, None, {"a": [1.0]}],
    "flag": [0, "true", None],
}


@pytest.mark.parametrize(("name", "value"), [(name, value) for name, values in BAD_VALUES.items() for value in values])
def test_value_of_another_type_is_null(tmp_path: Path, name: str, value: object) -> None:
    """The other values of the row, and the other rows, are read."""
    path = tmp_path / "table.json"
    path.write_text(json.dumps([ROW, ROW | {name: value}, ROW]))
    first, bad, last = (row for rows in read_rows(path, SCHEMA) for row in rows.to_pylist())
    assert first == last == ROW
    found = bad.pop(name)
    assert found is None or not np.isfinite(found)
    assert bad == {key: kept for key, kept in ROW.items() if key != name}


@pytest.mark.parametrize("bad", [b"5", b'{"token": "a" "x"}', b'{"token": "\xff"}', b"[" * 9999 + b"]" * 9999, b'"a"'])
def test_row_that_is_no_record_is_null(tmp_path: Path, bad: bytes) -> None:
    path = tmp_path / "table.json"
    path.write_bytes(b"[" + b", ".join([json.dumps(ROW).encode(), b"{%s}" % bad, json.dumps(ROW).encode()]) + b"]")
    rows = [row for rows in read_rows(path, SCHEMA) for row in rows.to_pylist()]
    assert rows == [ROW, dict.fromkeys(ROW), ROW]


def test_rows_without_the_key_are_read_too(tmp_path: Path) -> None:
    """What they belong to is for the caller to decide."""
    path = tmp_path / "table.json"
    path.write_text(json.dumps([ROW, ROW | {"token": 5}, ROW | {"token": "b"}]))
    found = [row["token"] for rows in read_rows(path, SCHEMA, "token", {b"b"}) for row in rows.to_pylist()]
    assert found == [None, "b"]


def test_missing_key_is_named(tmp_path: Path) -> None:
    path = tmp_path / "table.json"
    path.write_text(json.dumps([ROW]))
    with pytest.raises(CorruptSource, match="no 'kind'"):
        list(read_rows(path, SCHEMA, "kind", {b"a"}))
    assert list(read_rows(path, SCHEMA, "token", {b"z"})) == []


@pytest.mark.parametrize("content", ["", "{}", "5", "[{}", "\x00\x01", "[" * 99999])
def test_small_tables_are_lists_of_records(tmp_path: Path, content: str) -> None:
    path = tmp_path / "table.json"
    path.write_text(content)
    with pytest.raises(CorruptSource, match=r"table\.json: expected"):
        read_list(path)
    with pytest.raises(CorruptSource, match="no such table"):
        read_list(tmp_path / "none.json")
