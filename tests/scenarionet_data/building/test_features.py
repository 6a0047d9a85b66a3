"""Map features from columns: batched conversion of many lines equals converting them one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import MapBuilder, flat_points, make_features
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_data.testing import differences

coordinate = st.floats(-1e6, 1e6)
NOTHING = [None, [], np.zeros((0, 3))]


def lines_of(width: int) -> st.SearchStrategy[list[tuple[float, ...]]]:
    return st.lists(st.tuples(*[coordinate] * width), min_size=1, max_size=4)


@st.composite
def any_line(draw: st.DrawFn) -> object:
    line = draw(st.one_of(lines_of(2), lines_of(3)))
    form = draw(st.sampled_from(["list", "float64", "float32", "nothing"]))
    if form == "nothing":
        return draw(st.sampled_from(NOTHING))
    return line if form == "list" else np.array(line, dtype=form)


@given(lines=st.lists(any_line(), max_size=6), height=coordinate)
def test_batched_points_match_single_lines(lines, height):
    found = flat_points(lines, height)
    assert found.values.dtype == np.float64
    for line, points in zip(lines, found, strict=True):
        if line is None or not len(line):
            assert points.shape == (0, 3)
            continue
        array = np.asarray(line, np.float64)
        assert np.array_equal(points[:, : array.shape[1]], array)
        assert array.shape[1] == 3 or (points[:, 2] == height).all()


@pytest.mark.parametrize(
    "line",
    [
        [(0.0, 1.0), (2.0, 3.0, 4.0)],
        [(0.0,), (1.0,)],
        np.zeros((2, 4)),
        [(0.0, 1.0, 2.0), (3.0, 4.0), (5.0, 6.0, 7.0, 8.0)],
    ],
)
def test_points_of_other_dimensions_are_refused(line):
    with pytest.raises(ValueError, match="expected"):
        flat_points([[(0.0, 0.0, 0.0)], line])


@pytest.mark.parametrize("has_z", [True, False])
def test_columns_match_features_built_one_by_one(has_z):
    lines = [[(1.0, 2.0, 3.0), (4.5, 5.5, 6.5)], None, [(7.0, 8.0)]]
    outlines = [None, [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], None]
    widths = [[(1.7, 1.8)], [], [(0.12345, 2.0)]]
    builder = MapBuilder()
    for number, (line, outline, width) in enumerate(zip(lines, outlines, widths, strict=True)):
        builder.add(
            str(number),
            MapFeatureType.LANE_SURFACE_STREET,
            polyline=line,
            polygon=outline,
            width=width or None,
            speed_limit=5.0 * number,
            entry_lanes=["a"] * number,
            is_intersection=number == 1,
            extras={"number": number} if number else None,
        )
    origin = np.array([1.0, 1.0, 1.0])
    columns = make_features(
        range(3),
        [MapFeatureType.LANE_SURFACE_STREET] * 3,
        polyline=flat_points(lines),
        polygon=flat_points(outlines),
        width=Ragged.from_flat([1, 0, 1], np.array([pair for pairs in widths for pair in pairs])),
        speed_limit=[0.0, 5.0, 10.0],
        links={"entry_lanes": Ragged.from_ids([[], ["a"], ["a", "a"]])},
        is_intersection=[0, 1, 0],
        extras=[None, '{"number":1}', '{"number":2}'],
        origin=origin,
        has_z=has_z,
    )
    assert isinstance(columns, MapFeatures)
    assert differences(columns, builder.build(origin, has_z)) == []
