"""Bit-exact round trip of typed arrays through rows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data import codec
from scenarionet_data.arrays.columns import from_arrow
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.building import MapBuilder
from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.testing import differences
from tests.fixtures.scenarios import make_scenario, renamed


@given(
    seed=st.integers(0, 10_000),
    num_objects=st.integers(1, 20),
    num_steps=st.integers(1, 40),
    num_lanes=st.integers(0, 8),
    num_lights=st.integers(0, 3),
    has_z=st.booleans(),
    has_map=st.booleans(),
    interpolated=st.sampled_from([0.0, 0.3, 1.0]),
)
def test_round_trip_is_bit_exact(seed, num_objects, num_steps, num_lanes, num_lights, has_z, has_map, interpolated):
    scenario = make_scenario(
        seed,
        num_objects=num_objects,
        num_steps=num_steps,
        num_lanes=num_lanes,
        num_lights=num_lights,
        has_z=has_z,
        has_map=has_map,
        interpolated=interpolated,
    )
    scenario.validate()
    encoded = codec.encode(scenario, "1")
    assert differences(scenario, codec.decode(encoded)) == []
    valid, flags = scenario.tracks.valid, scenario.tracks.is_interpolated
    assert encoded.metadata["interpolated_share"] == flags[valid].mean()
    is_null = encoded.tracks.column("is_interpolated").is_null().to_numpy(zero_copy_only=False)
    assert is_null.tolist() == (~flags.any(axis=1)).tolist()


@pytest.mark.parametrize("has_z", [True, False])
def test_empty_map_differs_from_no_map(has_z):
    empty = replace(make_scenario(1, has_map=False, has_z=has_z), map=MapBuilder().build(np.zeros(3)))
    empty.validate()
    encoded = codec.encode(empty, "1")
    for maps in (encoded.maps, None):
        assert differences(empty, codec.decode(replace(encoded, maps=maps))) == []


def test_rows_satisfy_the_schemas():
    encoded = codec.encode(make_scenario(1), "1")
    for name, batch in (("tracks", encoded.tracks), ("lights", encoded.lights), ("maps", encoded.maps)):
        assert batch.schema.equals(tables.load(name).schema)
        batch.validate(full=True)
        for field in batch.schema:
            assert field.nullable or not batch.column(field.name).null_count, field.name


def test_metadata_row_has_every_column_except_addresses():
    columns = {column.name for column in tables.load("metadata").columns}
    row = codec.encode(make_scenario(1), "1").metadata
    addresses = {
        f"{table}_{part}"
        for table in ("tracks", "lights", "maps")
        for part in ("file", "row_group", "first_row", "num_rows")
    }
    assert set(row) == columns - addresses


def test_content_hash_depends_only_on_content():
    scenario = make_scenario(4)
    same = codec.encode(renamed(scenario, "other"), "2").metadata["content_hash"]
    assert codec.encode(scenario, "1").metadata["content_hash"] == same
    scenario.tracks.position[0, 3, 0] += 1e-3
    assert codec.encode(scenario, "1").metadata["content_hash"] != same


def test_content_hash_of_recorded_states_is_that_of_earlier_versions():
    assert codec.encode(make_scenario(4), "1").metadata["content_hash"] == 9682396676097830564
    assert codec.encode(make_scenario(4, interpolated=0.5), "1").metadata["content_hash"] != 9682396676097830564


def test_constant_sizes_are_stored_once():
    scenario = make_scenario(2, num_objects=8)
    lengths = codec.encode(scenario, "1").tracks.column("length")
    constant = [len(value) for value in lengths.to_pylist()[:4]]
    assert max(constant) <= 1


@pytest.mark.parametrize("row_groups", [1, 3])
def test_slice_of_many_rows_is_decoded(row_groups):
    """Row groups of compacted files hold several scenarios: offsets then do not start at 0."""
    scenarios = [make_scenario(seed, num_objects=5) for seed in range(row_groups + 1)]
    encoded = [codec.encode(scenario, "1") for scenario in scenarios]
    together = pa.Table.from_batches([e.tracks for e in encoded]).combine_chunks()
    first = sum(e.tracks.num_rows for e in encoded[:-1])
    rows = together.slice(first, encoded[-1].tracks.num_rows).to_batches()[0]
    columns = from_arrow(rows, codec.LAYOUTS["tracks"])
    decoded = codec.ScenarioColumns(columns, [0, rows.num_rows], Memory(0))
    (tracks,) = codec.decode_tracks(decoded, [scenarios[-1].num_timesteps])
    assert differences(tracks, scenarios[-1].tracks) == []
    assert np.array_equal(tracks.valid, scenarios[-1].tracks.valid)


@pytest.mark.parametrize(("table", "column"), [("tracks", "object_type"), ("lights", "provenance")])
def test_unknown_vocabulary_values_are_refused(table, column):
    encoded = codec.encode(make_scenario(1, num_lights=2), "1")
    rows = getattr(encoded, table)
    place = rows.schema.get_field_index(column)
    strange = pa.array(["SPACESHIP"] * rows.num_rows).dictionary_encode()
    with pytest.raises(LakeError, match=f"{column} is 'SPACESHIP'"):
        codec.decode(replace(encoded, **{table: rows.set_column(place, rows.schema.field(place), strange)}))


@pytest.mark.parametrize("start", [-1, 31, 2**31 - 1])
def test_spans_outside_the_scenario_are_refused(start):
    encoded = codec.encode(make_scenario(1, num_steps=31), "1")
    rows = encoded.tracks
    place = rows.schema.get_field_index("start")
    starts = np.full(rows.num_rows, start, np.int32)
    moved = replace(encoded, tracks=rows.set_column(place, rows.schema.field(place), pa.array(starts)))
    with pytest.raises(LakeError, match=r"tracks\.start does not match"):
        codec.decode(moved)
