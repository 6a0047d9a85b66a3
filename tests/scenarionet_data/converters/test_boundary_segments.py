"""Waymo's boundary and neighbour records as rows, and back."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.converters.boundary_segments import to_records, to_rows

index = st.integers(0, 999).map(str)
boundary = st.fixed_dictionaries(
    {
        "lane_start_index": index,
        "lane_end_index": index,
        "boundary_feature_id": st.sampled_from(["7", "a-left"]),
        "boundary_type": st.sampled_from(["UNKNOWN", "ROAD_LINE_SOLID_SINGLE_WHITE"]),
    }
)
neighbor = st.fixed_dictionaries(
    {
        "feature_id": index,
        "self_start_index": index,
        "self_end_index": index,
        "neighbor_start_index": index,
        "neighbor_end_index": index,
        "boundaries": st.lists(boundary, max_size=2),
    }
)


@given(st.lists(boundary, min_size=1, max_size=3), st.lists(neighbor, min_size=1, max_size=3))
def test_records_round_trip(boundaries, neighbors):
    extras = {"left_boundaries": boundaries, "right_neighbor": neighbors, "interpolating": True}
    rows = to_rows(extras)
    assert all(isinstance(row, list) for name in ("left_boundaries", "right_neighbor") for row in rows[name])
    assert to_records(rows) == extras
    assert to_rows(rows) == rows


def test_records_of_another_form_are_unchanged():
    extras = {"left_neighbor": [{"feature_id": "1"}], "left_boundaries": [{"boundary_type": "WALL"}], "other": 1}
    assert to_rows(extras) == extras
    assert to_records(extras) == extras
