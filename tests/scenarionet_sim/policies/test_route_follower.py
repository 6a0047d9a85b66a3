"""Paths that continue along lanes."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.building import MapBuilder
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.objects import ego
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.policies.route_follower import RouteFollower
from scenarionet_sim.roads.roads import Roads
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.routes import continued
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive

DRIVE = make_drive(others=(Other(0.0, 4.5, vx=8.0, last=20), Other(0.0, 30.0, vx=5.0)), red=True)


def test_paths_continue_along_their_lane_and_the_next():
    world = World.from_scenario(DRIVE)
    longer = continued(world, np.array([True, True, True]), 100.0)
    np.testing.assert_allclose(longer.paths.length()[:2], world.paths.length()[:2] + 100.0, atol=0.1)
    assert longer.paths.length()[2] == world.paths.length()[2]  # not on any lane
    for n in (0, 1):
        here = slice(longer.paths.path_offsets[n], longer.paths.path_offsets[n + 1])
        points, recorded = longer.paths.path_points[here], np.diff(world.paths.path_offsets)[n]
        old = world.paths.path_offsets[n]
        np.testing.assert_array_equal(points[:recorded], world.paths.path_points[old : old + recorded])
        assert points[-1, 1] == pytest.approx(3.5 * n, abs=1e-4)  # back on the centreline of its lane
        assert (np.diff(points[:, 0]) > 0).all()


def test_straightest_successor_is_taken():
    lane, builder = MapFeatureType.LANE_SURFACE_STREET, MapBuilder()
    builder.add("here", lane, polyline=[[-50, 0], [60, 0]], exit_lanes=["left", "ahead"])
    builder.add("left", lane, polyline=[[60, 0], [70, 3], [75, 20]])
    builder.add("ahead", lane, polyline=[[60, 0], [80, 0], [120, 1]])
    world = World.from_scenario(make_drive())
    roads = Roads.from_map(builder.build(np.zeros(3), has_z=False))
    object.__setattr__(world, "roads", roads)
    longer = continued(world, np.array([True]), 60.0)
    np.testing.assert_allclose(longer.paths.path_points[-1], [100.0, 0.5], atol=0.05)


def test_vehicle_continues_where_idm_leaves():
    world = World.from_scenario(make_drive(others=(Other(0.0, 3.5, vx=8.0, last=20),)))
    there = {}
    for policy in (Idm(), RouteFollower()):
        simulation = Simulation([world], (Replay(), policy))
        for _ in range(60):
            simulation.step()
        there[type(policy)] = bool(simulation.state.present[0, 1])
    assert there == {Idm: False, RouteFollower: True}


def test_without_a_map_it_equals_idm():
    world = World.from_scenario(make_drive(has_map=False, others=(Other(-30.0, vx=9.0),)))
    ends = []
    for policy in (Idm(), RouteFollower(objects=Idm().objects), RouteFollower()):
        simulation = Simulation([world], (Replay(), policy, Replay(objects=ego)))
        for _ in range(30):
            simulation.step()
        ends.append(simulation.state.position.copy())
    np.testing.assert_array_equal(ends[0], ends[1])
    np.testing.assert_array_equal(ends[0], ends[2])
