"""Boundary and lane-line detectors, against shapely."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.building import MapBuilder
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.arrays.log import HEADING, X, Y
from scenarionet_sim.roads.ray_kernels import RayFan, ranges_to_lines
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.sensors.base import directions, table
from scenarionet_sim.sensors.line_rays import BOUNDARIES, BoundaryDetector, LaneLineDetector
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch
from tests.fixtures.drives import make_drive
from tests.fixtures.simulations import simulate
from tests.scenarionet_sim.sensors import oracle
from tests.scenarionet_sim.sensors.conformance import SensorConformance, simulation  # noqa: F401

EDGE = MapFeatureType.ROAD_EDGE_BOUNDARY


class TestBoundaryDetector(SensorConformance):
    sensor = BoundaryDetector(noise=0.2, dropout=0.1)

    def test_matches_shapely(self, simulation):  # noqa: F811
        compare(simulation, BoundaryDetector(rays=30, range=60.0), self)


class TestLaneLineDetector(SensorConformance):
    sensor = LaneLineDetector(rays=24, range=40.0)

    def test_matches_shapely(self, simulation):  # noqa: F811
        compare(simulation, self.sensor, self)


def compare(simulation, sensor, suite):  # noqa: F811
    """Compare float32 observations within their precision; the kernel itself is compared below."""
    state, batch = simulation.state, simulation.batch
    agents = simulation.agents[::4].copy()
    found = suite.observed(simulation, sensor, agents)
    for (world, row), shares in zip(agents, found, strict=True):
        roads = batch.worlds[world].roads
        is_seen = np.isin(roads.segment_type, sensor.types)
        shapes = shapely.linestrings(roads.segments[is_seen].reshape(-1, 2, 2).astype(float))
        wanted = [
            oracle.seen(oracle.ray(state, world, row, 2 * np.pi * k / sensor.rays, sensor.range), shapes, sensor.range)
            for k in range(sensor.rays)
        ]
        np.testing.assert_allclose(shares, wanted, atol=2e-7)
    assert (found < 1).any()


@cache
def alone():
    return World.from_scenario(make_drive())


@kernel
def cast_at_lines(me, lines, rays, out):
    ranges_to_lines(0, me, lines, rays, out)


def cast(roads, position, heading, rays, reach):
    """Return ranges in float64."""
    found, me = np.empty(rays), np.zeros(7)
    me[[X, Y, HEADING]] = *position, heading
    lines = WorldBatch([replace(alone(), roads=roads)]).lines
    cast_at_lines(me, lines, RayFan(directions(rays), reach, table(BOUNDARIES)), found)
    return found


@given(st.integers(0, 10**6), st.integers(1, 40), st.sampled_from([3.0, 30.0, 300.0]))
def test_grid_traversal_misses_no_segment(seed, count, scale):
    """Random lines, from inside and outside of their grid, agree with brute force."""
    rng = np.random.default_rng(seed)
    builder = MapBuilder()
    for number in range(count):
        builder.add(f"{number}", EDGE, polyline=rng.uniform(-scale, scale, (rng.integers(2, 5), 2)))
    roads = Roads.from_map(builder.build(np.zeros(3)))
    position, heading = rng.uniform(-1.5 * scale, 1.5 * scale, 2), rng.uniform(-4, 4)
    found = cast(roads, position, heading, 16, 50.0)
    for k, angle in enumerate(heading + np.arange(16) * np.pi / 8):
        forward = np.array([np.cos(angle), np.sin(angle)])
        assert found[k] == pytest.approx(brute_force(roads.segments.astype(float), position, forward, 50.0), abs=1e-9)


def brute_force(segments, position, forward, reach):
    """Every segment in turn: intersect its line with the ray's by solving for both parameters."""
    start, along = segments[:, :2] - position, segments[:, 2:] - segments[:, :2]
    cross = forward[0] * along[:, 1] - forward[1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
        share = (start[:, 0] * forward[1] - start[:, 1] * forward[0]) / cross
    hit = (cross != 0) & (share >= 0) & (share <= 1) & (distance >= 0)
    return min(1.0, distance[hit].min(initial=reach) / reach)


@pytest.mark.parametrize("heading", [0.0, np.pi / 2, -np.pi, -np.pi / 2])
def test_rays_along_cell_borders(heading):
    """Rays parallel to the axes, from a corner of the grid's cells."""
    builder = MapBuilder()
    builder.add("square", EDGE, polygon=[[-30, -30], [30, -30], [30, 30], [-30, 30]])
    roads = Roads.from_map(builder.build(np.zeros(3)))
    np.testing.assert_allclose(cast(roads, [0.0, 0.0], heading, 4, 50.0), 0.6, atol=1e-9)


def test_a_ray_along_an_axis_stays_in_its_row_of_cells():
    """A wall that is in the row of the agent alone."""
    builder = MapBuilder()
    builder.add("wall", EDGE, polyline=[[20, 1], [20, 4]])
    builder.add("border", EDGE, polyline=[[-30, -30], [60, -30], [60, 60]])
    roads = Roads.from_map(builder.build(np.zeros(3)))
    assert cast(roads, [0.0, 2.5], 0.0, 4, 50.0)[0] == pytest.approx(0.4)


def test_ranges_to_the_road_edges():
    """The road's edges are 1.75 m to the right and 5.25 m to the left of the ego."""
    drive = simulate(make_drive(), steps=0)
    detector = BoundaryDetector(rays=4)
    shares = detector.observe(drive.batch, drive.state, drive.agents, np.random.default_rng(0), detector.empty(1))
    np.testing.assert_allclose(shares[0] * 50, [50, 5.25, 50, 1.75], atol=1e-5)


def test_empty_types_are_refused():
    with pytest.raises(BadParameter, match="at least one line type"):
        BoundaryDetector(types=())
