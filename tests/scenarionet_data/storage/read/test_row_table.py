"""RowTable returns the same rows as Arrow."""

import pickle

import pyarrow as pa
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.storage.read.metadata_rows import RowTable

COLUMNS = {
    "whole": (pa.int32(), st.integers(-5, 5)),
    "wide": (pa.int64(), st.integers(-(2**63), 2**63 - 1)),
    "single": (pa.float32(), st.floats(width=32, allow_nan=False)),
    "double": (pa.float64(), st.floats(allow_nan=False)),
    "truth": (pa.bool_(), st.booleans()),
    "text": (pa.string(), st.text()),
    "word": (pa.dictionary(pa.int32(), pa.string()), st.sampled_from(["a", "b", ""])),
    "list": (pa.list_(pa.string()), st.lists(st.text(max_size=2), max_size=3)),
}


@given(
    rows=st.lists(st.fixed_dictionaries({name: st.none() | values for name, (_, values) in COLUMNS.items()})),
    is_full=st.booleans(),
)
def test_rows_match_arrow(rows, is_full):
    kept = [row for row in rows if not is_full or None not in row.values()]
    schema = pa.schema({name: kind for name, (kind, _) in COLUMNS.items()})
    table = pa.concat_tables([pa.Table.from_pylist(kept[:2], schema), pa.Table.from_pylist(kept[2:], schema)])
    for made in (RowTable(table), pickle.loads(pickle.dumps(RowTable(table)))):
        assert len(made) == len(kept)
        found = [made[index] for index in range(len(kept))]
        assert found == table.to_pylist()
        assert [type(value) for row in found for value in row.values()] == [
            type(value) for row in table.to_pylist() for value in row.values()
        ]
