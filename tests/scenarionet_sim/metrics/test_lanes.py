"""The lanes of a drive on a small map: a lane that forks into two connectors, each followed by a lane, and one back."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely

from scenarionet_data.building import MapBuilder
from scenarionet_data.scenario.vocabulary import MapFeatureType as Type
from scenarionet_sim.metrics.drive import EgoDrive
from scenarionet_sim.metrics.lanes import DrivenLanes, LaneChange
from scenarionet_sim.metrics.nuplan.progress import ExpertRoutes
from scenarionet_sim.roads.roads import Roads

LANES = {
    "in": (Type.LANE_SURFACE_STREET, [[0, 0], [50, 0]], 15.0, ["ahead", "left"]),
    "ahead": (Type.LANE_SURFACE_UNSTRUCTURE, [[50, 0], [70, 0]], np.nan, ["out"]),
    "left": (Type.LANE_SURFACE_UNSTRUCTURE, [[50, 0], [58, 0.5], [66, 4], [70, 10]], np.nan, ["up"]),
    "out": (Type.LANE_SURFACE_STREET, [[70, 0], [150, 0]], 20.0, []),
    "up": (Type.LANE_SURFACE_STREET, [[70, 10], [70, 60]], 10.0, []),
    "back": (Type.LANE_SURFACE_STREET, [[150, -3.5], [0, -3.5]], np.nan, []),
}
IN, AHEAD, LEFT, OUT, UP, BACK = range(6)


@pytest.fixture(scope="module")
def roads() -> Roads:
    builder = MapBuilder()
    for name, (kind, points, limit, following) in LANES.items():
        builder.add(name, kind, polyline=points, width=[[1.75, 1.75]], speed_limit=limit, exit_lanes=following)
    return Roads.from_map(builder.build(np.zeros(3)))


def drive(x: np.ndarray, y: float | np.ndarray, heading: float = 0.0) -> EgoDrive:
    steps = len(x)
    position = np.column_stack((x, np.broadcast_to(y, steps))).astype(float)
    still = np.zeros((steps, 2))
    return EgoDrive(0.1 * np.arange(steps), position, np.full(steps, heading), np.full(steps, 16.0), still, 4, 2, 1.2)


def of_lanes(driven: EgoDrive, roads: Roads) -> DrivenLanes:
    return DrivenLanes.of(driven.drives, roads)


def test_connector_is_the_one_that_leads_to_the_next_lane(roads):
    ways = of_lanes(drive(np.arange(44.0, 77.0, 4.0), 0.0), roads).route
    assert ways == [(IN,)] * 2 + [(AHEAD,)] * 5 + [(OUT,)] * 2
    assert of_lanes(drive(np.array([53.0, 55.0]), 0.0), roads).route[-1] == (AHEAD, LEFT)
    assert of_lanes(drive(np.array([20.0, 21.0]), 9.0), roads).route == [(), ()], "off all lanes"


def test_progress_along_the_lane_and_against_it(roads):
    moved = drive(np.array([10.0, 11.0, 13.0]), 0.0)
    assert of_lanes(moved, roads).progress() == pytest.approx([0.0, 1.0, 2.0])
    wrong = drive(np.array([10.0, 11.0, 13.0]), -3.5)
    assert of_lanes(wrong, roads).progress() == pytest.approx([0.0, -1.0, -2.0])
    changed = drive(np.array([48.0, 52.0, 56.0, 60.0]), 0.0)
    assert of_lanes(changed, roads).progress()[1:3] == pytest.approx([0.0, 0.0]), "a new lane"


def expert_route(expert: EgoDrive, roads: Roads) -> ExpertRoutes:
    lanes = of_lanes(expert, roads)
    return ExpertRoutes.of(expert.drives, lanes.lanes, lanes.links)


def test_progress_along_the_lanes_of_the_recording_ends_where_they_are_left(roads):
    x = np.arange(10.0, 101.0, 5.0)
    route = expert_route(drive(x, 0.0), roads)
    assert route.counts == 3
    for beside in (0.0, 3.0):
        assert route.progress(drive(x, beside).drives) == pytest.approx(90.0)
    assert route.progress(drive(x[x < 80.0], 0.0).drives) == pytest.approx(65.0), "just on the third"
    assert route.progress(drive(x, np.where(x < 48.0, 0.0, 12.0)).drives) == pytest.approx(35.0), "away since x = 50"
    assert route.progress(drive(x, np.where(abs(x - 60.0) < 12.0, 12.0, 0.0)).drives) == pytest.approx(90.0), "back"
    assert expert_route(drive(x, 30.0), roads).ratios(drive(x, 0.0).drives, drive(x, 30.0).drives) == [1.0]
    standing = drive(np.full(3, 10.0), 0.0).drives
    assert ExpertRoutes.without_map(standing).ratios(standing, standing) == [1.0], "without a map"


@pytest.fixture(scope="module")
def two_lanes() -> Roads:
    """A lane that turns off, and one beside it on the left that begins 20 m later; they are not linked."""
    builder = MapBuilder()
    for name, points in (("right", [[0, 0], [45, 0], [60, -20]]), ("left", [[20, 3.5], [110, 3.5]])):
        builder.add(name, Type.LANE_SURFACE_STREET, polyline=points, width=[[1.75, 1.75]] * len(points))
    return Roads.from_map(builder.build(np.zeros(3)))


def test_progress_goes_on_in_the_lane_that_the_recording_changes_to(two_lanes):
    x = np.arange(10.0, 101.0, 5.0)
    changing = drive(x, np.where(x < 42.0, 0.0, 3.5))
    assert expert_route(changing, two_lanes).progress(changing.drives) == pytest.approx(90.0)


@pytest.mark.parametrize(
    ("y", "changes"),
    [
        ([0.0, 0.0, 0.0], []),
        ([0.0, 1.7, 3.5], [LaneChange(1, 2, True)]),
        ([0.0, 1.7, 1.8, 0.0, 1.7], [LaneChange(1, 3, False), LaneChange(4, 4, False)]),
        ([0.0, 1.7, 12.0], [LaneChange(1, 2, False)]),
        ([1.7, 3.5, 3.5], []),
        ([0.0, 12.0, 12.0], []),
    ],
)
def test_lane_changes(two_lanes, y, changes):
    """Completed, back, to the end of the drive, off all lanes; not from between lanes, or off the road at once."""
    x = 30.0 + np.arange(len(y))
    assert of_lanes(drive(x, np.array(y)), two_lanes).lane_changes() == changes


def test_speed_limit_of_a_connector_is_the_highest_of_the_lanes_it_joins(roads):
    limits = of_lanes(drive(np.arange(45.0, 76.0, 5.0), 0.0), roads).speed_limit()
    assert limits.tolist()[0] == 15.0 and limits.tolist()[-1] == 20.0
    assert limits[3] == 20.0
    assert math.isnan(of_lanes(drive(np.array([50.0, 49.0]), -3.5, math.pi), roads).speed_limit()[0]), "unknown"
    assert math.isnan(of_lanes(drive(np.array([20.0, 21.0]), 9.0), roads).speed_limit()[0]), "off all lanes"


@pytest.mark.parametrize(
    ("x", "y", "is_in_lane"),
    [
        (20.0, 0.0, True),
        (20.0, -1.75, False),
        (50.0, 0.0, True),
        (110.0, 0.0, True),
        (20.0, 1.5, False),
        (20.0, 9.0, False),
    ],
)
def test_box_is_in_a_lane_in_lanes_that_follow_or_between(roads, x, y, is_in_lane):
    found = of_lanes(drive(np.full(3, x), y), roads).is_in_lane
    assert found.tolist() == [is_in_lane] * 3


def test_progress_is_measured_from_the_nearest_point_of_a_long_lane():
    """Segments that are too far are left out: the answers are those of all of them."""
    rng = np.random.default_rng(1)
    points = np.cumsum(rng.uniform([0.5, -1.0], [3.0, 1.0], (400, 2)), axis=0).astype(np.float32)
    builder = MapBuilder()
    builder.add("lane", Type.LANE_SURFACE_STREET, polyline=points, width=[[2.5, 2.5]])
    line = shapely.LineString(points.astype(np.float64))
    along = np.sort(rng.uniform(0.0, line.length, 60))
    rng.shuffle(along[:30])  # jumps there and back
    position = shapely.get_coordinates(line.interpolate(along)) + rng.uniform(-1.0, 1.0, (60, 2))
    moved = EgoDrive(0.1 * np.arange(60), position, np.zeros(60), np.full(60, 9.0), np.zeros((60, 2)), 4.0, 2.0, 1.2)
    lanes = of_lanes(moved, Roads.from_map(builder.build(np.zeros(3))))
    is_on = np.array([bool(each) for each in lanes.route])
    assert is_on.all()
    arc = line.project(shapely.points(position))
    assert np.abs(lanes.progress()[1:] - np.diff(arc)).max() < 1e-3
