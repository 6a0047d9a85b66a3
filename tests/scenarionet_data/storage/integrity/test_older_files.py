"""Files without a seal: damaged ones are refused, or readable without ending the process."""

from __future__ import annotations

import io

import duckdb
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.integrity import older_files, seals
from scenarionet_data.storage.integrity.file_end import Place
from tests.scenarionet_data.storage.read.parquet.test_column_reader import rows_of

TABLES = ("metadata", "tracks", "shards", "members")
PLACE = Place("databases/busy/1.parquet")


def parquet(table):
    """Bytes of a file of a table with two row groups of 6 rows, as version 0.1 wrote it."""
    stream, declared = io.BytesIO(), tables.load(table)
    with pq.ParquetWriter(stream, declared.schema, **declared.writer_options()) as writer:
        writer.add_key_value_metadata({"scenarionet.schema": declared.tag})
        for seed in (1, 2):
            writer.write_batch(rows_of(table, 6, seed))
    return stream.getvalue()


FILES = {table: parquet(table) for table in TABLES}


def footer_of(content):
    """Position and bytes of the footer."""
    start = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    return start, content[start:-8]


def verify(path, content, place=PLACE):
    path.write_bytes(content)
    with path.open("rb") as file:
        return older_files.verify(file, content, seals.split(content, len(content), path), place, path)


@pytest.mark.parametrize("table", TABLES)
def test_undamaged_files_pass(table, tmp_path):
    assert verify(tmp_path / "1.parquet", FILES[table]) is False  # readable, but not every byte is verified


@given(table=st.sampled_from(TABLES), data=st.data())
def test_changed_bytes_are_refused_or_harmless(table, data, tmp_path_factory):
    path = tmp_path_factory.getbasetemp() / "changed.parquet"
    changed = bytearray(FILES[table])
    start, footer = footer_of(changed)
    first = data.draw(st.sampled_from([4, start, start]))
    for _ in range(data.draw(st.integers(1, 3))):
        changed[data.draw(st.integers(first, start + len(footer) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        verify(path, bytes(changed))
    except LakeError:
        return
    metadata = pq.read_metadata(path)  # whose columns end the process if Arrow cannot read them
    for group in range(metadata.num_row_groups):
        for column in range(metadata.num_columns):
            _ = metadata.row_group(group).column(column).compression
    try:
        duckdb.sql("SELECT * FROM read_parquet($path)", params={"path": str(path)}).fetchall()
    except duckdb.Error:
        return


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize(("number", "occurrence"), [(12, 0), (6, -1)], ids=["file", "row group"])
def test_numbers_of_rows_that_differ_are_refused(table, number, occurrence, tmp_path):
    """Arrow allocates as many rows as a row group has according to the footer."""
    start, footer = footer_of(FILES[table])
    value = bytes([0x16, 2 * number])  # Thrift: a field behind the one before, of 64 bits, in zigzag
    places = [k for k in range(len(footer)) if footer.startswith(value, k)]
    at = places[occurrence]
    footer = footer[:at] + b"\x16\xfe\xff\xff\xff\x0f" + footer[at + 2 :]
    content = FILES[table][:start] + footer + len(footer).to_bytes(4, "little") + b"PAR1"
    with pytest.raises(LakeError, match=r"its footer says [0-9,]+ rows(, its row groups others| in [0-9,]+ bytes)"):
        verify(tmp_path / "1.parquet", content)


@pytest.mark.parametrize(
    ("table", "name", "finding"),
    [
        ("metadata", "metadata/dataset=made/version=v1/split=other/1.parquet", "belong to another folder"),
        ("shards", "metadata/dataset=made/version=v1/split=train/crop=1/1.parquet", "a file of another table"),
    ],
)
def test_exchanged_metadata_files_are_found(table, name, finding, tmp_path):
    with pytest.raises(LakeError, match=finding):
        verify(tmp_path / "1.parquet", FILES[table], Place(name))
