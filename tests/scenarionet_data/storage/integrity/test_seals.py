"""Seals of Parquet and JSON files."""

from __future__ import annotations

import hashlib
import random
import re
from itertools import pairwise
from pathlib import Path

import duckdb
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from xxhash import xxh3_128_digest, xxh3_128_hexdigest

from scenarionet_data.errors import LakeError
from scenarionet_data.query.views import FILE_TABLES
from scenarionet_data.schema import tables
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.integrity.file_end import Place

NAME = Place("databases/near/1.parquet", "a", may_be_older=False)
FAR = NAME._replace(name="databases/far/1.parquet")
ROWS = pa.table({"scenario_id": [f"made/{k}" for k in range(50)], "weight": [k / 7 for k in range(50)]})


def write(path: Path, footer: dict[str, str] | None = None) -> bytes:
    """Write a Parquet file with several row groups that is not sealed yet; returns its bytes."""
    rows = ROWS.replace_schema_metadata((footer or {"scenarionet.schema": "members/1"}) | tables.SEALED)
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


def test_seal_changes_neither_rows_nor_footer(sealed, tmp_path):
    content, found = write(tmp_path / "1.parquet"), sealed.read_bytes()
    size = int.from_bytes(content[-8:-4], "little") + 8
    assert found[-size:] == content[-size:]
    assert found.startswith(content[:-size])


def test_file_without_the_entry_of_sealed_files_is_not_sealed(tmp_path):
    pq.write_table(ROWS, tmp_path / "1.parquet")
    with pytest.raises(LakeError, match=r"no entry scenarionet\.sealed"):
        seals.seal(tmp_path / "1.parquet", NAME)


def test_a_row_group_is_verified_by_itself(sealed):
    content, end = sealed.read_bytes(), seals.open_end(sealed, NAME)
    metadata = pq.read_metadata(sealed)
    starts = [0, *(metadata.row_group(k).column(0).data_page_offset for k in (1, 2)), end.body]
    starts[1:3] = [metadata.row_group(k).column(0).dictionary_page_offset for k in (1, 2)]
    groups = [content[start:stop] for start, stop in pairwise(starts)]
    assert [xxh3_128_digest(group) for group in groups] == list(end.digests)


def test_sealed_files_of_lakes_are_verified_without_parsing_footers(lake, monkeypatch):
    paths = [Path(path) for table in FILE_TABLES for path in lake.paths(table)]
    places = [lake.files.place(str(path.relative_to(lake.root))) for path in paths]
    assert max(pq.read_metadata(path).num_row_groups for path in paths) > 1
    monkeypatch.delattr(seals, "pq")
    assert all(map(seals.verify_again, paths, places))


def test_row_groups_are_found_where_the_footer_looks_otherwise(sealed, monkeypatch):
    for looks in (rb"(\x02)", rb"(?!)()", rb"(PAR1)"):
        monkeypatch.setattr(seals, "_GROUP", re.compile(looks))
        assert seals.verify_again(sealed, NAME)


def test_seal_of_other_name_replaces_seal(sealed, tmp_path):
    path = tmp_path / "2.parquet"
    path.write_bytes(sealed.read_bytes())
    seals.seal(path, FAR)
    assert seals.verify_again(path, FAR)
    assert path.stat().st_size == sealed.stat().st_size
    seals.seal(path, NAME)
    assert path.read_bytes() == sealed.read_bytes()


def test_data_is_named_by_its_content_before_sealing(tmp_path):
    path = tmp_path / "draft"
    content = write(path)
    found = seals.seal(path, "tracks/a-000")
    assert found.name == f"tracks/a-000-{hashlib.sha256(content).hexdigest()[:16]}.parquet"
    assert found.checksum == hashlib.sha256(path.read_bytes()).hexdigest()
    assert found.size == path.stat().st_size
    assert seals.verify_again(path, Place(found.name))


@pytest.mark.parametrize("place", [FAR, NAME._replace(lake="b")])
def test_sealed_file_at_another_place_is_damaged(sealed, place):
    with pytest.raises(LakeError, match="its footer differs from the one that was written under this name"):
        seals.open_end(sealed, place)


def test_unsealed_file_is_older_or_damaged(tmp_path):
    path = tmp_path / "1.parquet"
    pq.write_table(ROWS, path, store_schema=False)
    place = NAME._replace(may_be_older=True)
    assert not seals.open_end(path, place).digest
    assert not seals.verify_again(path, place)
    with pytest.raises(LakeError, match="it is of another lake"):
        seals.verify_again(path, NAME)


def test_every_flipped_bit_of_a_sealed_file_is_found(sealed, tmp_path):
    """All bits of the seal and of the last bytes, and a sample of the others."""
    content, path = sealed.read_bytes(), tmp_path / "1.parquet"
    end, num_bits = seals.open_end(sealed, NAME), len(content) * 8
    seal = range(end.body * 8, (len(content) - len(end.footer)) * 8)
    chosen = [*seal, *range(num_bits - 64, num_bits), *random.Random(0).sample(range(num_bits), 200)]
    for bit in chosen:
        damaged = bytearray(content)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        with pytest.raises(LakeError):
            seals.verify_again(path, NAME)


@given(length=st.integers(0), junk=st.binary(max_size=60))
def test_truncated_and_extended_files_are_found(sealed, tmp_path_factory, length, junk):
    content = sealed.read_bytes()
    path = tmp_path_factory.getbasetemp() / "cut.parquet"
    path.write_bytes(content[: length % len(content)] + junk)
    with pytest.raises(LakeError):
        seals.verify_again(path, NAME)


def test_footer_is_verified_from_last_bytes_alone(sealed):
    content = sealed.read_bytes()
    count = seals.needed(content[-8:])
    end = seals.check_end(content[-count:], len(content), NAME, "s3://bucket/1.parquet")
    assert pq.read_metadata(pa.BufferReader(end.footer)).num_rows == 50


def test_long_footer_is_read_whole(tmp_path):
    path = tmp_path / "1.parquet"
    write(path, {"scenarionet.lineage": "x" * 3 * seals.WINDOW})
    seals.seal(path, NAME)
    assert seals.verify_again(path, NAME)
    damaged = bytearray(path.read_bytes())
    damaged[-2 * seals.WINDOW] ^= 1
    path.write_bytes(damaged)
    with pytest.raises(LakeError, match="its footer differs"):
        seals.open_end(path, NAME)


@pytest.mark.parametrize("length", [1, 3 * seals.WINDOW])
def test_seal_of_version_0_2_is_verified(tmp_path, length):
    path, place = tmp_path / "1.parquet", Place("tracks/a.parquet")
    content = write(path, {"scenarionet.lineage": "x" * length})
    size = int.from_bytes(content[-8:-4], "little") + 8
    body, footer, name = content[:-size], content[-size:], place.name.encode()
    seal = b"SNSEAL\x00\x01" + xxh3_128_digest(footer + name) + xxh3_128_digest(body + name)
    path.write_bytes(body + seal + footer)
    assert seals.verify_again(path, place)
    assert not seals.open_end(path, place).digest
    path.write_bytes(b"x" + body[1:] + seal + footer)
    with pytest.raises(LakeError, match="its bytes differ"):
        seals.verify_again(path, place)


# --- JSON -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("other", [Place("snapshots/4.json", "a"), Place("snapshots/3.json", "b")])
def test_json_is_verified_with_its_place(other):
    content, place = {"number": 3, "files": ["a", "b"], "text": "0" * 32}, Place("snapshots/3.json", "a")
    data = seals.seal_json(content, place)
    assert seals.read_json(data, place) == (content, True)
    with pytest.raises(ValueError, match="written under this name"):
        seals.read_json(data, other)


def test_every_other_byte_in_json_is_found():
    """A single byte can become any other one, also one that means the same in JSON."""
    data = seals.seal_json({"a": 1}, Place("run.json"))
    for place in range(len(data)):
        for byte in set(range(256)) - {data[place]}:
            with pytest.raises((ValueError, seals.NewerFormat)):
                seals.read_json(data[:place] + bytes([byte]) + data[place + 1 :], Place("run.json"))


def test_json_of_older_lakes_is_read():
    blank = b'{"format": 2, "number": 3, "digest": "%s"}'
    digest = xxh3_128_hexdigest(blank % (b"0" * 32) + b"a").encode()  # as version 0.2 wrote it
    assert seals.read_json(blank % digest, Place("a", "lake")) == ({"number": 3}, False)
    assert seals.read_json(b'{"format": 1, "number": 3}', Place("a")) == ({"number": 3}, False)
    assert seals.read_json(b'{"policy": "idm"}', Place("a")) == ({"policy": "idm"}, False)
    with pytest.raises(ValueError, match="of another lake"):
        seals.read_json(b'{"policy": "idm"}', Place("a", "lake", may_be_older=False))


def test_json_of_newer_lakes_is_refused():
    with pytest.raises(seals.NewerFormat, match="written in format 4, not 3"):
        seals.read_json(b'{"format": 4}', Place("a"))


@pytest.mark.parametrize("data", [b"", b"[]", b"\xff", b"[" * 100_000, b'{"format": 2}', b'"x"'])
def test_hostile_json_is_damaged(data):
    with pytest.raises(ValueError, match=r"\S"):
        seals.read_json(data, Place("a"))
