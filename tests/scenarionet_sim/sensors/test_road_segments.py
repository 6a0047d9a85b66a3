"""Pieces of the road: their making, and the nearest ones, against NumPy and by hand."""

from __future__ import annotations

import numpy as np
import pytest
import shapely

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.roads.road_pieces import RoadPieces, joined
from scenarionet_sim.sensors.surrounding import RoadSegments
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import make_drive
from tests.fixtures.simulations import simulate
from tests.scenarionet_sim.sensors import oracle
from tests.scenarionet_sim.sensors.conformance import SensorConformance, simulation  # noqa: F401

LANE, LINE, EDGE = (
    int(kind)
    for kind in (
        MapFeatureType.LANE_SURFACE_STREET,
        MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE,
        MapFeatureType.ROAD_EDGE_BOUNDARY,
    )
)


def pieces(*lines, types):
    return RoadPieces.along(Ragged.from_lists(lines, 2), np.array(types, np.uint8)).numbers


class TestRoadSegments(SensorConformance):
    sensor = RoadSegments(segments=12, range=35.0)

    def test_matches_numpy(self, simulation):  # noqa: F811
        state, full = simulation.state, 0
        found = self.observed(simulation)
        for (world, row), observed in zip(simulation.agents, found, strict=True):
            every = simulation.batch.worlds[world].roads.pieces.numbers.astype(float)
            apart = np.hypot(*(every[:, :2] - state.position[world, row]).T)
            (near,) = np.nonzero(apart <= 35.0)
            near = np.sort(near[np.argsort(apart[near])][:12])
            wanted = np.zeros((12, 8))
            wanted[: len(near), :2] = oracle.in_frame(state, world, row, every[near, :2]) / 35.0
            wanted[: len(near), 2] = every[near, 2]
            here = state.position[world, row]
            wanted[: len(near), 3:5] = oracle.in_frame(state, world, row, every[near, 3:5] + here)
            wanted[: len(near), 5:] = every[near, 5:]
            np.testing.assert_allclose(observed, wanted, atol=2e-6)
            full += len(near) == 12
        assert 0 < full < len(found)  # both with a choice and without

    def test_all_is_seen_that_is_in_reach(self, simulation):  # noqa: F811
        """A few more than there are change nothing but the zeros."""
        many, more = (self.observed(simulation, RoadSegments(count, 35.0)) for count in (5_000, 5_050))
        np.testing.assert_array_equal(many, more[:, :5_000])
        assert not more[:, 5_000:].any()

    def test_of_equal_distances_the_first_are_taken(self):
        """The ego is between its two edges, whose midpoints are equally far; lanes are thinned to one segment."""
        drive = simulate(make_drive(), steps=0)
        every = drive.batch.worlds[0].roads.pieces.numbers
        apart = np.sum((every[:, :2] - drive.state.position[0, 0]) ** 2, axis=1, dtype=np.float32)
        for count in range(1, len(every)):
            found = self.observed(drive, RoadSegments(count, 500.0))[0]
            assert found[:, 5:].any(axis=1).all(), count
            kept = np.sort(np.hypot(found[:, 0], found[:, 1]) * 500.0)
            np.testing.assert_allclose(kept, np.sqrt(np.sort(apart)[:count]), atol=1e-3)

    def test_by_hand(self):
        """The lanes at y = 3.5 are straight, and cut into equal pieces of at most 20 m."""
        drive = simulate(make_drive(), steps=0)
        world = drive.batch.worlds[0]
        wanted = []
        for start, end in (line[[0, -1], 0] for line in world.roads.lanes if line[0, 1] == 3.5):
            count = int(np.ceil((end - start) / 20.0))
            size = (end - start) / count
            wanted += [[start + size * (k + 0.5), size / 20.0, 1, 0, 1, 0, 0] for k in range(count)]
        every = self.observed(drive, RoadSegments(200, 500.0))[0]
        on_lane = every[(every[:, 5] == 1) & np.isclose(every[:, 1] * 500.0, 3.5, atol=1e-4)]
        found = np.column_stack([on_lane[:, 0] * 500.0, on_lane[:, 2:]])
        np.testing.assert_allclose(found[np.argsort(found[:, 0])], sorted(wanted), atol=1e-3)

    def test_worlds_that_come_later_have_their_pieces(self):
        """The sensor is used first when some worlds are stored already, and others come then."""
        worlds = [World.from_scenario(make_drive(name, has_map=has)) for name, has in (("a", True), ("b", False))]
        drive = Simulation(worlds)
        with_map, without = self.observed(drive)
        assert with_map.any()
        assert not without.any()
        drive.reset(1, World.from_scenario(make_drive("c")))
        np.testing.assert_array_equal(self.observed(drive), [with_map, with_map])


def test_straight_lines_are_thinned_and_cut():
    """30 m in segments of 1 m are two pieces of 15 m."""
    found = pieces([[x, 2.0] for x in range(31)], types=[LINE])
    np.testing.assert_allclose(found, [[7.5, 2, 0.75, 1, 0, 0, 1, 0], [22.5, 2, 0.75, 1, 0, 0, 1, 0]], atol=1e-6)


def test_corners_stay_and_kinds_are_told():
    corner = [[0, 0], [6, 0], [6, 8]]
    found = pieces(corner, [[0, 1], [0, 5]], types=[EDGE, LANE])
    wanted = [[3, 0, 0.3, 1, 0, 0, 0, 1], [6, 4, 0.4, 0, 1, 0, 0, 1], [0, 3, 0.2, 0, 1, 1, 0, 0]]
    assert len(found) == 3
    for row in wanted:
        assert np.isclose(found, row, atol=1e-6).all(axis=1).any(), row


@pytest.mark.parametrize("lines", [[], [[]], [[[1.0, 2.0]]], [[[1.0, 2.0], [1.0, 2.0]]]])
def test_lines_without_a_length_have_no_pieces(lines):
    assert pieces(*lines, types=[LANE] * len(lines)).shape == (0, 8)


def test_pieces_follow_the_lines_of_a_map(simulation):  # noqa: F811
    """No piece is further than half a metre from what it shows, and together they are as long."""
    roads = simulation.batch.worlds[0].roads
    every = roads.pieces.numbers.astype(float)
    half = 10.0 * every[:, 2:3] * every[:, 3:5]
    lines = shapely.MultiLineString(list(roads.segments.reshape(-1, 2, 2)))
    lanes = shapely.MultiLineString([line for line in roads.lanes if len(line) > 1])
    for is_kind, shape in ((every[:, 5] == 1, lanes), (every[:, 5] == 0, lines)):
        ends = np.concatenate([every[is_kind, :2] - half[is_kind], every[is_kind, :2] + half[is_kind]])
        assert shapely.distance(shape, shapely.points(ends)).max() < 0.5
        assert 20.0 * every[is_kind, 2].sum() == pytest.approx(shape.length, rel=0.02)


def test_segments_join_to_polylines():
    segments = np.array([[0, 0, 1, 0], [1, 0, 2, 0], [5, 5, 6, 6]], np.float32)
    lines = joined(segments, np.array([4, 4, 7]))
    assert [line.tolist() for line in lines] == [[[0, 0], [1, 0], [2, 0]], [[5, 5], [6, 6]]]
    assert len(joined(np.zeros((0, 4), np.float32), np.zeros(0, np.int32))) == 0


@pytest.mark.parametrize("wrong", [{"segments": 0}, {"range": 0.0}, {"range": np.inf}])
def test_parameters_out_of_range(wrong):
    with pytest.raises(BadParameter, match=next(iter(wrong))):
        RoadSegments(**wrong)
