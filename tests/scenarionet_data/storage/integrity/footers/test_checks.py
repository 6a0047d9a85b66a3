"""Footers of ours pass; changed ones are refused, or Arrow reads them without ending the process."""

import io

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.schema import tables
from scenarionet_data.storage.integrity.footers import structs
from scenarionet_data.storage.integrity.footers.checks import check_footer
from scenarionet_data.storage.integrity.footers.thrift import Malformed
from tests.scenarionet_data.storage.read.parquet.test_column_reader import rows_of


def parquet(table="metadata", num_rows=6):
    """A file of a table, as bytes."""
    stream, declared = io.BytesIO(), tables.load(table)
    with pq.ParquetWriter(stream, declared.schema, **declared.writer_options()) as writer:
        writer.add_key_value_metadata({"scenarionet.schema": declared.tag})
        writer.write_batch(rows_of(table, num_rows, 1))
        writer.write_batch(rows_of(table, num_rows, 2))
    return stream.getvalue()


def parts(content):
    """Bytes of the footer, and its position."""
    end = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    return content[end:-8], end


FILES = {table: parquet(table) for table in ("metadata", "tracks", "shards", "members")}


@pytest.mark.parametrize("table", sorted(tables.TABLES))
def test_footers_of_all_tables_pass(table):
    check_footer(*parts(parquet(table)))


def test_footers_of_other_types_pass():
    rows = pa.table(
        {
            "scenario_id": ["a", "b"],
            "day": pa.array([1, None], pa.date32()),
            "at": pa.array([1, 2], pa.timestamp("us", "UTC")),
            "score": pa.array([[1.0], None], pa.list_(pa.float64())),
            "price": pa.array([1, None], pa.decimal128(9, 2)),
            "is_good": pa.array([True, None]),
        }
    )
    stream = io.BytesIO()
    pq.write_table(rows, stream, compression="zstd")
    check_footer(*parts(stream.getvalue()))


def read_whole(footer, content):
    """Let Arrow read a file with another footer, as this package does."""
    whole = content + footer + len(footer).to_bytes(4, "little") + b"PAR1"
    file = pq.ParquetFile(pa.BufferReader(whole))
    for group in range(file.metadata.num_row_groups):
        for column in range(file.metadata.num_columns):
            _ = file.metadata.row_group(group).column(column).compression
    file.read(use_threads=False)


@given(table=st.sampled_from(sorted(FILES)), data=st.data())
def test_changed_footers_are_refused_or_harmless(table, data):
    footer, end = parts(FILES[table])
    changed = bytearray(footer)
    for _ in range(data.draw(st.integers(1, 3))):
        changed[data.draw(st.integers(0, len(footer) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        check_footer(bytes(changed), end)
    except Malformed:
        return
    try:
        read_whole(bytes(changed), FILES[table][:end])
    except (pa.ArrowException, OSError, ValueError, KeyError):
        return


@given(st.binary(max_size=80))
def test_arbitrary_bytes_are_refused(footer):
    with pytest.raises(Malformed):
        check_footer(footer, 10**6)


def varint(number):
    return bytes([*(number >> 7 * k & 127 | 128 for k in range(4)), number >> 28])


@pytest.mark.parametrize(
    ("footer", "finding"),
    [
        (b"\x15\x02\x19\xfc" + varint(2**34), "a list of 17,179,869,184 values where"),
        (b"\x15\x02\x19\x1c\x48" + varint(2**34), "a text of 17,179,869,184 bytes where"),
        (b"\x15\x02\x19\x18\x00", "a list of values of type 8 where 12"),
        (b"\x15\x06", "a value 3 that its enumeration does not have"),
        (b"\x15\x02\x05\x02\x02", "version twice|ends within"),
        (b"\x15" + b"\xff" * 11, "more than 64 bits"),
        (b"\x15\x02\x00", "no schema"),
    ],
)
def test_findings(footer, finding):
    with pytest.raises(Malformed, match=finding):
        structs.read_footer(footer)


@pytest.mark.parametrize("table", sorted(FILES))
def test_numbers_are_bounded_by_the_file(table):
    """A number of rows is allocated before they are read."""
    footer, end = parts(FILES[table])
    content = structs.read_footer(footer)
    rows = content["num_rows"]
    assert rows == 12
    changed = footer.replace(b"\x16\x18\x19\x2c", b"\x16\xfe\xff\xff\xff\x0f\x19\x2c", 1)  # 12 rows in 2 row groups
    assert changed != footer
    with pytest.raises(Malformed, match="the footer says 2,147,483,647 rows, its row groups 12"):
        check_footer(changed, end)
    with pytest.raises(Malformed, match="before a footer at"):
        check_footer(footer, end // 2)
