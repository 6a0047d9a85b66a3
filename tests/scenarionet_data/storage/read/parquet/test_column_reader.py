"""The kernels decode the same values as Arrow; damaged files raise errors and never crash."""

import mmap

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from xxhash import xxh3_128_digest

from scenarionet_data.arrays.columns import TEXTS, ColumnLayout, from_arrow, pick
from scenarionet_data.schema import tables
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.read.parquet import ColumnReader, Footer, RowGroup, UnreadableFile
from scenarionet_data.storage.read.parquet.column_reader import read_by_arrow

READ = ("tracks", "lights", "maps")
WORDS = ["VEHICLE", "PEDESTRIAN", "", "straße", "自動車", "x" * 300]
LENGTHS = [0, 0, 1, 2, 7, 8, 9, 64, 200]


def some(kind, count, draw):
    """Random values of a column type."""
    if kind in ("string", "json", "dictionary"):
        return [WORDS[number] for number in draw.integers(len(WORDS), size=count)]
    if kind == "bool":
        return draw.integers(2, size=count).astype(bool).tolist()
    if kind == "uint64":
        return draw.integers(9, size=count).tolist()
    if kind == "binary":
        return [draw.bytes(length) for length in draw.integers(300, size=count)]
    return draw.integers(-5, 5, count).tolist() if kind.startswith("int") else draw.normal(size=count).tolist()


def rows_of(table, num_rows, seed, nulls=0.2):
    """A record batch with random values in every column of a table."""
    draw, columns = np.random.default_rng(seed), []
    for column in tables.load(table).columns:
        same = draw.random() < 0.3  # lists of equal length are encoded as long runs
        lengths = np.full(num_rows, draw.choice(LENGTHS)) if same else draw.choice(LENGTHS, num_rows)
        if column.is_list:
            ends, listed = np.cumsum(lengths), some(column.element, int(lengths.sum()), draw)
            values = [listed[end - length : end] for end, length in zip(ends, lengths, strict=True)]
        else:
            values = some(column.element, num_rows, draw)
        gaps = draw.random(num_rows) < draw.choice([0, nulls, 1])
        kept = [None if gap and column.nullable else value for gap, value in zip(gaps, values, strict=True)]
        columns.append(pa.array(kept, column.arrow_type))
    return pa.RecordBatch.from_arrays(columns, schema=tables.load(table).schema)


def written(path, table, batches, **options):
    declared = tables.load(table)
    settings = {**declared.writer_options(), **options}
    with pq.ParquetWriter(path, declared.schema, **settings) as writer:
        for batch in batches:
            writer.write_batch(batch)
    return path


def layout_of(table):
    """All columns but those of types that loaded scenarios do not have."""
    return ColumnLayout(c for c in tables.load(table).columns if not (c.element == "float64" or c.name == "tile"))


def reader_of(table):
    return ColumnReader(layout_of(table), compile_after=0)


def row_groups(path, table, content=None, *, is_sealed=False):
    """Row groups of a file, optionally with its bytes replaced after it was sealed."""
    metadata = pq.read_metadata(path)
    with path.open("rb") as file:
        end = seals.split(*seals.last(file), path)
        groups = seals.row_groups(file, end) if is_sealed else []
        digests = [xxh3_128_digest(group) for group in groups]
    footer = Footer(str(path), metadata, layout_of(table), digests, end.body)
    if content is None:
        with path.open("rb") as file:
            content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    else:
        path.write_bytes(content)
    data = np.frombuffer(bytes(content), np.uint8)
    return [RowGroup(footer, number, data) for number in range(metadata.num_row_groups)]


def read(table, groups):
    return reader_of(table).read(groups)


def are_known(table, path):
    """Whether the kernels decode a file, and Arrow does not have to."""
    return reader_of(table)._read(row_groups(path, table)) is not None


def by_arrow(table, paths):
    return from_arrow(pa.concat_tables(pq.read_table(p) for p in paths), layout_of(table))


def assert_same(table, found, expected):
    assert found.num_rows == expected.num_rows
    layout = layout_of(table)
    for column, kind in zip(layout.columns, layout.kinds, strict=True):
        name, place = column.name, layout.place(column.name)
        if column.is_list:
            assert np.array_equal(found.offsets(place), expected.offsets(place)), name
        assert np.array_equal(found.lengths(place), expected.lengths(place)), name
        if kind == TEXTS:
            assert found.texts(name).strings().tolist() == expected.texts(name).strings().tolist(), name
            continue
        ours, theirs = found.values(name), expected.values(name)
        if column.element == "dictionary":
            ours = np.array([*found.words[name], None], dtype=object)[ours]
            theirs = np.array([*expected.words[name], None], dtype=object)[theirs]
        assert ours.dtype == theirs.dtype, name
        assert ours.tobytes() == theirs.tobytes() if ours.dtype != object else ours.tolist() == theirs.tolist(), name


def older_options(table, seed):
    """Options of files that earlier versions wrote, with some columns in zstd; here any of them."""
    draw = np.random.default_rng(seed)
    chosen = {c.path: c.element != "dictionary" and draw.random() < 0.5 for c in tables.load(table).columns}
    codecs = {path: "zstd" if is_zstd else "lz4" for path, is_zstd in chosen.items()}
    return {
        "compression": codecs,
        "compression_level": {path: 2 for path, is_zstd in chosen.items() if is_zstd} or None,
    }


@pytest.mark.parametrize("table", READ)
@settings(max_examples=settings.default.max_examples // 5)
@given(sizes=st.lists(st.integers(1, 30), min_size=1, max_size=3), seed=st.integers(0, 2**32))
def test_reads_what_arrow_reads(tmp_path_factory, table, sizes, seed):
    folder = tmp_path_factory.mktemp("files")
    first = [rows_of(table, size, seed + number) for number, size in enumerate(sizes)]
    paths = [
        written(folder / "1.parquet", table, first, **older_options(table, seed)),
        written(folder / "2.parquet", table, [rows_of(table, 3, seed)]),
    ]
    groups = [group for path in paths for group in row_groups(path, table)]
    assert_same(table, read(table, groups), by_arrow(table, paths))


@pytest.mark.parametrize("table", READ)
def test_kernels_read_all_columns_that_our_writer_produces(tmp_path, table):
    path = written(tmp_path / "f.parquet", table, [rows_of(table, 30, seed) for seed in range(3)])
    assert are_known(table, path)


@pytest.mark.long
@pytest.mark.parametrize(("table", "num_rows"), [("tracks", 19_000), ("maps", 4_000)])
def test_column_of_several_megabytes_is_one_page(tmp_path, table, num_rows):
    """As in row groups shared by many scenarios."""
    path = written(tmp_path / "f.parquet", table, [rows_of(table, num_rows, 7)])
    group = pq.read_metadata(path).row_group(0)
    assert max(group.column(k).total_uncompressed_size for k in range(group.num_columns)) > 2e6
    assert are_known(table, path)
    assert_same(table, read(table, row_groups(path, table)), by_arrow(table, [path]))


@pytest.mark.parametrize("table", READ)
@pytest.mark.parametrize(
    "options",
    [
        {"compression": "snappy", "compression_level": None},
        {"compression": "none", "compression_level": None},
        {"data_page_size": 64},
        {"data_page_version": "2.0"},
        {"use_dictionary": True, "column_encoding": None},
        {"compression": "zstd", "compression_level": 1},
    ],
    ids=["snappy", "plain", "many-pages", "version-2", "dictionaries", "zstd"],
)
def test_other_encodings_are_read_by_arrow(tmp_path, table, options):
    paths = [
        written(tmp_path / "1.parquet", table, [rows_of(table, 30, 1), rows_of(table, 90, 2)], **options),
        written(tmp_path / "2.parquet", table, [rows_of(table, 5, 3)]),
    ]
    groups = [group for path in paths for group in row_groups(path, table)]
    assert_same(table, read(table, groups), by_arrow(table, paths))


@pytest.mark.parametrize("table", READ)
@settings(max_examples=settings.default.max_examples // 2)
@given(data=st.data())
def test_damaged_pages_raise_error_and_never_crash(tmp_path_factory, table, data):
    path = written(tmp_path_factory.mktemp("t") / "f.parquet", table, [rows_of(table, 20, 4), rows_of(table, 9, 5)])
    whole, content = row_groups(path, table), bytearray(path.read_bytes())
    start, end = whole[0].footer.stored(0).span
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(start, end - 1))] = data.draw(st.integers(0, 255))
    try:
        found = read(table, row_groups(path, table, content))
    except UnreadableFile as error:
        assert error.url == str(path)
        return
    assert found.num_rows == 29
    for column in found.layout.columns:
        if column.is_list:
            lists = found.lists(column.name)
            assert 0 <= lists.offsets[-1] == len(lists.values)


@pytest.mark.parametrize("table", READ)
def test_sealed_row_groups_are_read(tmp_path, table):
    path = written(tmp_path / "f.parquet", table, [rows_of(table, 20, 4), rows_of(table, 9, 5)])
    groups = row_groups(path, table, is_sealed=True)
    expected = by_arrow(table, [path])
    assert_same(table, read(table, groups), expected)
    assert_same(table, read_by_arrow(groups, layout_of(table)), expected)


@pytest.mark.parametrize("table", READ)
def test_every_changed_byte_of_a_sealed_row_group_is_found(tmp_path, table):
    path = written(tmp_path / "f.parquet", table, [rows_of(table, 20, 4), rows_of(table, 9, 5)])
    content = path.read_bytes()
    groups = row_groups(path, table, is_sealed=True)
    start, end = groups[1].footer.stored(1).span
    for place in range(start, end, max((end - start) // 200, 1)):
        changed = bytearray(content)
        changed[place] ^= 4
        with pytest.raises(UnreadableFile, match="its bytes differ from those that were written"):
            read(table, [RowGroup(groups[1].footer, 1, np.frombuffer(changed, np.uint8))])


def test_error_names_the_damaged_file(tmp_path):
    paths = [written(tmp_path / f"{k}.parquet", "tracks", [rows_of("tracks", 20, k)]) for k in range(3)]
    content = bytearray(paths[1].read_bytes())
    start, end = row_groups(paths[1], "tracks")[0].footer.stored(0).span
    content[start:end] = bytes(end - start)
    groups = [
        *row_groups(paths[0], "tracks"),
        *row_groups(paths[1], "tracks", content),
        *row_groups(paths[2], "tracks"),
    ]
    with pytest.raises(UnreadableFile) as raised:
        read("tracks", groups)
    assert raised.value.url == str(paths[1])


@pytest.mark.parametrize("table", READ)
@settings(max_examples=settings.default.max_examples // 2)
@given(first=st.lists(st.integers(0, 20), min_size=1, max_size=4), count=st.integers(0, 9))
def test_take_matches_arrow_slices(table, first, count):
    batch = rows_of(table, 29, 6)
    layout = layout_of(table)
    picked = pick(from_arrow(batch, layout), [(start, count) for start in first])
    expected = pa.concat_tables(pa.Table.from_batches([batch.slice(start, count)]) for start in first)
    assert_same(table, picked, from_arrow(expected, layout))


@given(contents=st.lists(st.binary(max_size=12) | st.text(max_size=12).map(str.encode), min_size=1, max_size=9))
def test_only_utf_8_is_read(tmp_path_factory, contents):
    rows = rows_of("lights", len(contents), 1)
    place = rows.schema.get_field_index("light_id")
    texts = pa.array(contents, pa.binary())
    unchecked = pa.Array.from_buffers(pa.string(), len(texts), texts.buffers())
    path = written(
        tmp_path_factory.mktemp("t") / "f.parquet",
        "lights",
        [rows.set_column(place, rows.schema.field(place), unchecked)],
    )
    try:
        expected = [content.decode() for content in contents]
    except UnicodeDecodeError:
        for reads in (read, lambda table, groups: read_by_arrow(groups, layout_of(table))):
            with pytest.raises(UnreadableFile):
                reads("lights", row_groups(path, "lights"))
        return
    assert read("lights", row_groups(path, "lights")).strings("light_id").tolist() == expected
