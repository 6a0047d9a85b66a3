"""Argoverse 2 maps: lines, lanes, edges and links of a written map archive."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.converters.argoverse2 import Argoverse2
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane, is_road_edge, is_road_line
from tests.fixtures import argoverse2 as fixture
from tests.fixtures import argoverse2_world as world
from tests.fixtures.reading import scenarios

CONVERTER = Argoverse2()


@pytest.fixture
def forecasting(tmp_path: Path) -> Path:
    (folder,) = fixture.write_forecasting(tmp_path / "raw", num_scenarios=1, num_tracks=20, num_timesteps=110)
    return folder


def test_every_painted_line_has_its_type(forecasting: Path) -> None:
    (scenario,) = scenarios(CONVERTER, forecasting.parent)
    features = scenario.map
    assert features is not None
    (path,) = forecasting.glob("*.json")
    segments = json.loads(path.read_text())["lane_segments"]
    wanted = {
        "DASH_SOLID_YELLOW": "ROAD_LINE_PASSING_DOUBLE_YELLOW",
        "SOLID_DASH_YELLOW": "ROAD_LINE_PASSING_DOUBLE_YELLOW",
        "DASH_SOLID_WHITE": "ROAD_LINE_BROKEN_SINGLE_WHITE",
        "SOLID_DASH_WHITE": "ROAD_LINE_SOLID_SINGLE_WHITE",
        "DASHED_WHITE": "ROAD_LINE_BROKEN_SINGLE_WHITE",
        "DASHED_YELLOW": "ROAD_LINE_BROKEN_SINGLE_YELLOW",
        "DOUBLE_SOLID_YELLOW": "ROAD_LINE_SOLID_DOUBLE_YELLOW",
        "DOUBLE_SOLID_WHITE": "ROAD_LINE_SOLID_DOUBLE_WHITE",
        "DOUBLE_DASH_YELLOW": "ROAD_LINE_BROKEN_DOUBLE_YELLOW",
        "DOUBLE_DASH_WHITE": "ROAD_LINE_BROKEN_SINGLE_WHITE",
        "SOLID_YELLOW": "ROAD_LINE_SOLID_SINGLE_YELLOW",
        "SOLID_WHITE": "ROAD_LINE_SOLID_SINGLE_WHITE",
        "SOLID_BLUE": "UNKNOWN_LINE",
        "UNKNOWN": "UNKNOWN_LINE",
    }
    seen = set()
    rows = {feature: row for row, feature in enumerate(features.ids)}
    for lane in segments.values():
        for side, boundaries in (("left", features.left_boundaries), ("right", features.right_boundaries)):
            mark, lines = lane[f"{side}_lane_mark_type"], boundaries[rows[str(lane["id"])]]
            seen.add(mark)
            if mark == "NONE":
                assert not len(lines)
                continue
            (line,) = lines
            assert MapFeatureType(features.feature_type[rows[line]]).name == wanted[mark]
            points = np.array([[p["x"], p["y"], p["z"]] for p in lane[f"{side}_lane_boundary"]]) - scenario.origin
            stored = features.polyline[rows[line]]
            assert np.allclose(stored, points, atol=1e-4) or np.allclose(stored, points[::-1], atol=1e-4)
    assert seen == {*wanted, "NONE"}


def test_lines_shared_by_two_lanes_are_stored_once(forecasting: Path) -> None:
    features = scenarios(CONVERTER, forecasting.parent)[0].map
    assert features is not None
    lines = features.polyline.values[np.repeat(is_road_line(features.feature_type), features.polyline.lengths)]
    used = [*features.left_boundaries.values, *features.right_boundaries.values]
    assert len(set(used)) == is_road_line(features.feature_type).sum() < len(used)
    assert len(np.unique(lines, axis=0)) > len(lines) / 2


def test_centerlines_are_between_the_lane_sides(forecasting: Path) -> None:
    features = scenarios(CONVERTER, forecasting.parent)[0].map
    assert features is not None
    for row in np.flatnonzero(is_lane(features.feature_type)):
        width, is_bike = features.width[row], features.feature_type[row] == MapFeatureType.LANE_BIKE_LANE
        assert width.shape == (len(features.polyline[row]), 2)
        np.testing.assert_allclose(width.sum(axis=1), 1.8 if is_bike else 3.5, atol=0.1)
        np.testing.assert_allclose(width[:, 0], width[:, 1], atol=0.1)
        z = features.polygon[row][:, 2]
        assert (features.polyline[row][:, 2] >= z.min() - 1e-3).all()
        assert (features.polyline[row][:, 2] <= z.max() + 1e-3).all()
    extras = [text for text in features.extras if text]
    assert '{"lane_type":"BUS"}' in extras


def test_road_edges_exclude_tile_cuts(forecasting: Path) -> None:
    """Areas are cut along tile boundaries; a cut across the road is not an edge, except where the road ends."""
    (scenario,) = scenarios(CONVERTER, forecasting.parent)
    features = scenario.map
    assert features is not None
    edges = [features.polyline[row] + scenario.origin for row in np.flatnonzero(is_road_edge(features.feature_type))]
    assert len(edges) == 3  # both sides of the first area, and the second one's outline, open at the cut
    for edge in edges:
        step = np.abs(np.diff(edge, axis=0))
        across = (step[:, 0] < 1e-3) & (step[:, 1] > 5.0)
        assert not across.any()
        ahead, middle = np.diff(edge, axis=0)[:, :2], (edge[1:] + edge[:-1])[:, :2] / 2.0
        inside = world.road(middle[:, 0], 0.0)[:, :2] - middle
        assert (ahead[:, 0] * inside[:, 1] - ahead[:, 1] * inside[:, 0] > 0).mean() > 0.9  # road on the left


def test_links_to_lanes_outside_the_map_are_kept(forecasting: Path) -> None:
    features = scenarios(CONVERTER, forecasting.parent)[0].map
    assert features is not None
    outside = set(features.exit_lanes.values) - set(features.ids)
    assert len(outside) == 8
