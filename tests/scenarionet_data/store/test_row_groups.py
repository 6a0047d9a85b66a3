"""What is read without Arrow is what Arrow reads, and damage is an error, never a crash."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data import tables
from scenarionet_data.codec.arrow import lists
from scenarionet_data.store import row_groups
from scenarionet_data.store.row_groups import RowGroups

ZSTD = ["x", "y", "z", "length"]


def rows_of(lengths, seed=0):
    """Rows of the tracks table with float lists of these lengths; z is null where a length is None."""
    draw = np.random.default_rng(seed)
    schema = tables.load("tracks").schema
    made = [np.round(draw.normal(size=length or 0), 1).astype(np.float32) for length in lengths]
    columns = {}
    for field in schema:
        if pa.types.is_list(field.type) and pa.types.is_floating(field.type.value_type):
            values = [None if length is None and field.nullable else m for length, m in zip(lengths, made, strict=True)]
            columns[field.name] = pa.array(values, field.type)
        else:
            empty = [None] * len(lengths) if field.nullable else [_default(field.type)] * len(lengths)
            columns[field.name] = pa.array(empty, field.type)
    return pa.RecordBatch.from_arrays(list(columns.values()), schema=schema)


def _default(kind):
    if pa.types.is_list(kind):
        return []
    if pa.types.is_boolean(kind):
        return False
    return 0 if pa.types.is_integer(kind) else "a"


def written(path, batches, **options):
    table = tables.load("tracks")
    settings = {**table.writer_options(), **options}
    with pq.ParquetWriter(path, table.schema, **settings) as writer:
        writer.add_key_value_metadata({"scenarionet.schema": table.tag})
        for batch in batches:
            writer.write_batch(batch)
    return path


def opened(path, columns=("track_id", *ZSTD)):
    return RowGroups.open(path, tables.load("tracks"), columns)


def arrow_lists(path, number):
    group = pq.ParquetFile(path).read_row_group(number).combine_chunks().to_batches()[0]
    expected = {}
    for name in ZSTD:
        column = group.column(name)
        filled = [value or [] for value in column.to_pylist()]
        expected[name] = [len(value) for value in filled], np.float32([x for value in filled for x in value])
    return expected


LENGTHS = st.lists(st.one_of(st.none(), st.integers(0, 40), st.sampled_from([0, 1, 7, 8, 9, 64, 500])), min_size=1)


@given(lengths=LENGTHS, more=LENGTHS)
def test_reads_what_arrow_reads(tmp_path_factory, lengths, more):
    path = written(tmp_path_factory.mktemp("t") / "f.parquet", [rows_of(lengths), rows_of(more, seed=1)])
    file = opened(path)
    for number in (1, 0):
        rows = file.read(number)
        assert set(rows.lists) == set(ZSTD)
        for name, (sizes, values) in arrow_lists(path, number).items():
            found_lengths, found = lists(rows, name)
            assert found_lengths.tolist() == sizes
            assert np.array_equal(found.view(np.uint32), values.view(np.uint32))


@given(lengths=LENGTHS, first=st.integers(0, 5), count=st.integers(0, 5))
def test_slices_as_arrow_does(tmp_path_factory, lengths, first, count):
    path = written(tmp_path_factory.mktemp("t") / "f.parquet", [rows_of(lengths)])
    whole = opened(path).read(0)
    part = whole.slice(first, count)
    sizes, values = whole.lists["x"]
    start = int(sizes[:first].sum())
    assert part.lists["x"][0].tolist() == sizes[first : first + count].tolist()
    assert part.lists["x"][1].tolist() == values[start : start + int(sizes[first : first + count].sum())].tolist()


@pytest.mark.parametrize(
    "options",
    [
        {"compression": "lz4", "compression_level": None},
        {"column_encoding": {f"{name}.list.element": "PLAIN" for name in ZSTD}},
        {"data_page_size": 64},
        {"data_page_version": "2.0"},
    ],
    ids=["lz4", "plain", "many-pages", "version-2"],
)
def test_what_our_writer_does_not_make_is_left_to_arrow(tmp_path, options):
    path = written(tmp_path / "f.parquet", [rows_of([30, 0, None, 500, 20])], **options)
    rows = opened(path).read(0)
    assert "x" not in rows.lists
    assert [len(value) for value in rows.column("x").to_pylist()] == [30, 0, 0, 500, 20]


@given(data=st.data())
def test_damage_is_an_error_and_never_a_crash(tmp_path_factory, data):
    path = written(tmp_path_factory.mktemp("t") / "f.parquet", [rows_of([30, 0, None, 90, 20])])
    content = bytearray(path.read_bytes())
    chunk = pq.read_metadata(path).row_group(0).column(5)
    assert chunk.path_in_schema == "x.list.element"
    end = chunk.data_page_offset + chunk.total_compressed_size
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(chunk.data_page_offset, end - 1))] = data.draw(st.integers(0, 255))
    path.write_bytes(content)
    try:
        sizes, values = lists(opened(path, ["track_id", "x"]).read(0), "x")
    except (OSError, pa.ArrowInvalid):
        return
    assert sizes.min() >= 0
    assert sizes.sum() <= len(values)


@given(page=st.binary(max_size=200), levels=st.integers(1, 60), is_nullable=st.booleans())
def test_no_page_whatever_reads_out_of_bounds(page, levels, is_nullable):
    lengths, values = np.full(levels + 8, -7, np.int32), np.full(levels + 8, np.float32(-7))
    rows, elements = row_groups.kernels.read_lists(
        np.frombuffer(page, np.uint8), levels, is_nullable, lengths[:levels], values[:levels]
    )
    assert (lengths[levels:] == -7).all()
    assert (values[levels:] == -7).all()
    assert rows <= levels
    assert elements <= levels


@given(header=st.binary(max_size=60))
def test_no_header_whatever_is_taken_for_a_page_it_is_not(header):
    start = row_groups.kernels.read_header(np.frombuffer(header, np.uint8), 0)[0]
    assert start <= len(header)


@pytest.mark.parametrize("first", [b"\x15", b"\x06", b"\x18", b"\x1c\x08", b"\x19\xfc"])
@pytest.mark.parametrize("rest", [b"\xff" * 9 + b"\x01", b"\xff" * 20, b"\x80" * 9 + b"\x01\x15\x02"])
def test_numbers_of_64_bits_stay_within_the_file(first, rest):
    data = np.frombuffer(first + rest + b"\x00", np.uint8)
    assert row_groups.kernels.read_header(data, 0)[0] <= len(data)
    assert row_groups.kernels.struct_end(data, 0) <= len(data)
    lengths, values = np.zeros(8, np.int32), np.zeros(8, np.float32)
    page = np.frombuffer(len(rest).to_bytes(4, "little") + rest + b"\x02\0\0\0\x10\x01", np.uint8)
    assert row_groups.kernels.read_lists(page, 8, False, lengths, values)[0] <= 8
