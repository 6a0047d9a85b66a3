"""Seals of Parquet and JSON files."""

from __future__ import annotations

import hashlib
import random
from pathlib import Path

import duckdb
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.errors import LakeError
from scenarionet_data.storage import sealed_json, seals

NAME = "databases/near/1.parquet"
ROWS = pa.table({"scenario_id": [f"made/{k}" for k in range(50)], "weight": [k / 7 for k in range(50)]})


def write(path: Path, footer: dict[str, str] | None = None) -> bytes:
    """Write an unsealed Parquet file with several row groups; returns its bytes."""
    rows = ROWS.replace_schema_metadata(footer or {"scenarionet.schema": "members/1"})
    pq.write_table(rows, path, row_group_size=20, write_page_checksum=True)
    return path.read_bytes()


@pytest.fixture(scope="module")
def sealed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("seals") / "1.parquet"
    write(path)
    seals.seal(path, NAME)
    return path


def test_arrow_duckdb_and_polars_read_sealed_files(sealed):
    text = sealed.as_posix()
    assert pq.read_table(sealed, page_checksum_verification=True).to_pydict() == ROWS.to_pydict()
    assert duckdb.sql(f"FROM '{text}'").fetchall() == [tuple(row.values()) for row in ROWS.to_pylist()]
    assert pl.read_parquet(sealed).to_dicts() == ROWS.to_pylist()
    assert pl.scan_parquet(sealed).select("weight").collect().to_dicts() == ROWS.select(["weight"]).to_pylist()


@pytest.mark.parametrize("num_entries", [1, 12, 13, 14, 40])
def test_seal_keeps_footer_and_adds_one_entry(tmp_path, num_entries):
    path = tmp_path / "1.parquet"
    footer = {f"key {k}": "value" * k for k in range(num_entries)}
    write(path, footer)
    before = pq.read_metadata(path)
    seals.seal(path, NAME)
    after = pq.read_metadata(path)
    assert after.metadata == {**before.metadata, seals.MARK: b"1"}
    groups = [before.row_group(k).to_dict() for k in range(before.num_row_groups)]
    assert [after.row_group(k).to_dict() for k in range(after.num_row_groups)] == groups


def test_seal_of_other_name_replaces_seal(sealed, tmp_path):
    path = tmp_path / "2.parquet"
    path.write_bytes(sealed.read_bytes())
    seals.seal(path, "databases/far/1.parquet")
    assert seals.verify(path, "databases/far/1.parquet")
    assert path.stat().st_size == sealed.stat().st_size
    seals.seal(path, NAME)
    assert path.read_bytes() == sealed.read_bytes()


def test_data_is_named_by_its_content_before_sealing(tmp_path):
    path = tmp_path / "draft"
    content = write(path)
    found = seals.seal_data(path, "tracks/a-000")
    assert found.name == f"tracks/a-000-{hashlib.sha256(content).hexdigest()[:16]}.parquet"
    assert found.checksum == hashlib.sha256(path.read_bytes()).hexdigest()
    assert found.size == path.stat().st_size
    assert seals.verify(path, found.name)


def test_sealed_file_under_another_name_is_damaged(sealed):
    with pytest.raises(LakeError, match="its footer differs from the one that was written under this name"):
        seals.read_end(sealed, "databases/far/1.parquet")


def test_unsealed_file_is_told_apart(tmp_path):
    path = tmp_path / "1.parquet"
    content = write(path)
    end = seals.read_end(path, NAME)
    assert not end.is_sealed
    assert content.endswith(end.footer)
    assert end.body + len(end.footer) == len(content)
    assert not seals.verify(path, NAME)


def test_every_flipped_bit_of_a_sealed_file_is_found(sealed, tmp_path):
    """All bits of the seal and of the last bytes, and a sample of the others."""
    content, path = sealed.read_bytes(), tmp_path / "1.parquet"
    end, num_bits = seals.read_end(sealed, NAME), len(content) * 8
    seal = range(end.body * 8, (len(content) - len(end.footer)) * 8)
    chosen = [*seal, *range(num_bits - 64, num_bits), *random.Random(0).sample(range(num_bits), 200)]
    for bit in chosen:
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        with pytest.raises(LakeError):
            seals.verify(path, NAME)


@given(length=st.integers(0), junk=st.binary(max_size=60))
def test_truncated_and_extended_files_are_found(sealed, tmp_path_factory, length, junk):
    content = sealed.read_bytes()
    path = tmp_path_factory.getbasetemp() / "cut.parquet"
    path.write_bytes(content[: length % len(content)] + junk)
    with pytest.raises(LakeError):
        seals.verify(path, NAME)


def test_footer_is_verified_from_last_bytes_alone(sealed):
    content = sealed.read_bytes()
    count = seals.needed(content[-8:])
    end = seals.check_end(content[-count:], len(content), NAME, "s3://bucket/1.parquet")
    assert pq.read_metadata(pa.BufferReader(end.footer)).num_rows == 50


def test_long_footer_is_read_whole(tmp_path):
    path = tmp_path / "1.parquet"
    write(path, {"scenarionet.lineage": "x" * 3 * seals.WINDOW})
    seals.seal(path, NAME)
    assert seals.verify(path, NAME)
    damaged = bytearray(path.read_bytes())
    damaged[-2 * seals.WINDOW] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(LakeError, match="its footer differs"):
        seals.read_end(path, NAME)


# --- JSON -------------------------------------------------------------------------------------------------


def test_json_is_verified_with_its_name():
    content = {"number": 3, "files": ["a", "b"], "text": "0" * 32}
    data = sealed_json.seal(content, "snapshots/3.json")
    assert sealed_json.read(data, "snapshots/3.json") == (content, True)
    with pytest.raises(ValueError, match="written under this name"):
        sealed_json.read(data, "snapshots/4.json")


def test_every_other_byte_in_json_is_found():
    """A single byte can become any other one, also one that means the same in JSON."""
    data = sealed_json.seal({"a": 1}, "run.json")
    for place in range(len(data)):
        for byte in set(range(256)) - {data[place]}:
            with pytest.raises((ValueError, sealed_json.NewerFormat)):
                sealed_json.read(data[:place] + bytes([byte]) + data[place + 1 :], "run.json")


def test_json_of_older_lakes_is_read():
    assert sealed_json.read(b'{"format": 1, "number": 3}', "a") == ({"number": 3}, False)
    assert sealed_json.read(b'{"policy": "idm"}', "a") == ({"policy": "idm"}, False)


def test_json_of_newer_lakes_is_refused():
    with pytest.raises(sealed_json.NewerFormat, match="written in format 3, not 2"):
        sealed_json.read(b'{"format": 3}', "a")


@pytest.mark.parametrize("data", [b"", b"[]", b"\xff", b"[" * 100_000, b'{"format": 2}', b'"x"'])
def test_hostile_json_is_damaged(data):
    with pytest.raises(ValueError, match=r"\S"):
        sealed_json.read(data, "a")
