"""Row groups of files as new files: the same pages, a footer of their own."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.read.parquet import thrift
from scenarionet_data.storage.read.parquet.row_group_copy import RowGroupSource, RowGroupWriter
from scenarionet_data.storage.read.parquet.thrift_kernels import UNKNOWN, struct_end
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario, renamed


@pytest.fixture(scope="module")
def lake(tmp_path_factory):
    made = [renamed(make_scenario(k % 3, num_objects=2 + k % 3, num_lights=k % 2), f"s{k}") for k in range(20)]
    return write_lake(tmp_path_factory.mktemp("copied"), made)


@pytest.fixture(params=["tracks", "lights", "maps"])
def path(request, lake):
    return lake.files.path(lake.paths(request.param)[0])


def footer_of(path):
    content = path.read_bytes()
    return content[-8 - int.from_bytes(content[-8:-4], "little") : -8]


def pages(path, number):
    """The stored bytes of a row group, column by column."""
    group, content = pq.read_metadata(path).row_group(number), path.read_bytes()
    chunks = [group.column(index) for index in range(group.num_columns)]
    starts = [
        c.dictionary_page_offset if c.has_dictionary_page and c.dictionary_page_offset else c.data_page_offset
        for c in chunks
    ]
    return [content[start : start + chunk.total_compressed_size] for start, chunk in zip(starts, chunks, strict=True)]


def copy(source, numbers, target, words=None):
    writer = RowGroupWriter(target)
    assert [writer.append(source, number) for number in numbers] == list(range(len(numbers)))
    writer.close(words or {})
    return pq.ParquetFile(target)


def test_a_footer_is_encoded_to_the_bytes_it_was_decoded_from(path):
    footer = footer_of(path)
    assert thrift.encode(thrift.decode(footer)) == footer
    assert thrift.encode(RowGroupSource(path).footer) == footer


def test_pages_are_copied_as_they_are(path, tmp_path):
    source = RowGroupSource(path)
    numbers = [len(source) - 1, 0, 3]
    copied = copy(source, numbers, tmp_path / "copy.parquet")
    for new, old in enumerate(numbers):
        assert pages(tmp_path / "copy.parquet", new) == pages(path, old)
    assert copied.read().equals(pq.ParquetFile(path).read_row_groups(numbers))
    assert copied.metadata.num_rows == sum(copied.metadata.row_group(k).num_rows for k in range(3))


def test_all_row_groups_under_the_same_words_are_the_same_file(path, tmp_path):
    source = RowGroupSource(path)
    copy(source, range(len(source)), tmp_path / "copy.parquet")
    assert (tmp_path / "copy.parquet").read_bytes() == path.read_bytes()


def test_words_of_the_footer_are_kept_changed_and_taken_out(path, tmp_path):
    words = {"scenarionet.licence": "mine", "scenarionet.fingerprints": None, "new": "word"}
    found = copy(RowGroupSource(path), [0], tmp_path / "copy.parquet", words).metadata.metadata
    assert found[b"scenarionet.licence"] == b"mine"
    assert found[b"new"] == b"word"
    assert b"scenarionet.fingerprints" not in found
    assert found[b"scenarionet.schema"].decode() == tables.load(path.parts[-5 if "split" in str(path) else -4]).tag


def test_foreign_files_with_indexes_and_filters_stay_readable(tmp_path):
    rows = pa.table({"a": np.arange(1000), "b": [str(k % 7) for k in range(1000)]})
    pq.write_table(rows, tmp_path / "a.parquet", row_group_size=100, write_page_index=True)
    copied = copy(RowGroupSource(tmp_path / "a.parquet"), [4, 9], tmp_path / "copy.parquet")
    assert copied.read()["a"].to_pylist() == [*range(400, 500), *range(900, 1000)]
    assert not copied.metadata.row_group(0).column(0).has_offset_index


def test_another_schema_is_refused(tmp_path):
    for name in "ab":
        pq.write_table(pa.table({name: [1]}), tmp_path / f"{name}.parquet")
    writer = RowGroupWriter(tmp_path / "copy.parquet")
    writer.append(RowGroupSource(tmp_path / "a.parquet"), 0)
    with pytest.raises(LakeError, match="another schema"):
        writer.append(RowGroupSource(tmp_path / "b.parquet"), 0)
    writer.discard()
    assert not (tmp_path / "copy.parquet").exists()


def test_a_row_group_that_is_not_there_is_refused(path, tmp_path):
    source = RowGroupSource(path)
    with pytest.raises(LakeError, match="row groups, wanted is number 99"):
        source.row_group(99)


@pytest.mark.parametrize("content", [b"", b"PAR1", b"x" * 100, b"PAR1" + b"\xff\xff\xff\x7fPAR1", b"\xff" * 40])
def test_what_is_no_parquet_file_is_refused(content, tmp_path):
    (tmp_path / "a.parquet").write_bytes(content)
    with pytest.raises(LakeError, match="restore it"):
        RowGroupSource(tmp_path / "a.parquet")


def test_a_damaged_footer_never_ends_in_another_error(path, tmp_path):
    content = bytearray(path.read_bytes())
    begin = len(content) - 8 - len(footer_of(path))
    rng = np.random.default_rng(0)
    for _ in range(200):
        damaged = bytearray(content)
        damaged[rng.integers(begin, len(content) - 8)] ^= 1 << rng.integers(8)
        (tmp_path / "a.parquet").write_bytes(damaged)
        writer = RowGroupWriter(tmp_path / "copy.parquet")
        with suppress(LakeError):
            writer.append(RowGroupSource(tmp_path / "a.parquet"), 0)
            writer.close({})
        writer.discard()


# --- Thrift ---------------------------------------------------------------------------------------------------

values = st.recursive(
    st.one_of(
        st.tuples(st.just(thrift.TRUE), st.just(True)),
        st.tuples(st.just(thrift.FALSE), st.just(False)),
        st.tuples(st.just(thrift.BYTE), st.integers(0, 255)),
        st.tuples(st.just(thrift.I64), st.integers(-(2**63), 2**63 - 1)),
        st.tuples(st.just(thrift.DOUBLE), st.binary(min_size=8, max_size=8)),
        st.tuples(st.just(thrift.BINARY), st.binary(max_size=200)),
    ),
    lambda inner: st.one_of(
        st.tuples(st.just(thrift.STRUCT), st.dictionaries(st.integers(1, 300), inner, max_size=4)),
        st.tuples(
            st.just(thrift.LIST),
            st.tuples(st.just(thrift.STRUCT), st.lists(st.dictionaries(st.integers(1, 9), inner, max_size=3))),
        ),
        st.tuples(st.just(thrift.LIST), st.tuples(st.just(thrift.I32), st.lists(st.integers(-999, 999), max_size=40))),
        st.tuples(st.just(thrift.LIST), st.tuples(st.just(thrift.TRUE), st.lists(st.integers(1, 2), max_size=20))),
    ),
    max_leaves=12,
)


@given(st.dictionaries(st.integers(1, 300), values, max_size=6))
def test_structs_come_back(content):
    ordered = dict(sorted(content.items()))
    data = thrift.encode(ordered)
    assert thrift.decode(data) == ordered
    assert struct_end(np.frombuffer(data + b"more", np.uint8), 0) == len(data)
    assert thrift.encode(thrift.decode(data, unopened=ordered)) == data


@given(st.dictionaries(st.integers(1, 300), values, min_size=1, max_size=6), st.data())
def test_cut_structs_are_refused(content, data):
    encoded = thrift.encode(dict(sorted(content.items())))
    cut = encoded[: data.draw(st.integers(0, len(encoded) - 1))]
    with pytest.raises(thrift.BadThrift):
        thrift.decode(cut)
    assert struct_end(np.frombuffer(cut, np.uint8), 0) == UNKNOWN
