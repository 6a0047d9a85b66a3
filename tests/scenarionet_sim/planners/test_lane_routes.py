"""Routes along the lanes, to the recorded goal or to another one."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.planners.following import IdmPlanner
from scenarionet_sim.planners.policy import Planned
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.objects import ego
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.lane_routes import LaneRoute, route_between
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import make_drive
from tests.fixtures.simulations import generated


def path_of(world: World, route: LaneRoute) -> np.ndarray:
    changed = route.applied(world, ego(world))
    first, end = changed.paths.path_offsets[world.ego : world.ego + 2]
    return changed.paths.path[first:end]


def test_the_route_to_the_recorded_goal_is_near_the_recorded_path():
    for seed in (0, 3, 5):
        world = World.from_scenario(generated(seed))
        path, recorded = path_of(world, LaneRoute()), path_of(world, LaneRoute(goal=None))
        log = world.log_position[world.log_valid[:, world.ego], world.ego]
        apart = np.hypot(*(path[:, None, :2] - log[None]).T)
        assert apart.min(axis=0).max() < 3.0, "the route leaves the recorded path"
        np.testing.assert_allclose(path[0, :2], log[0], atol=1e-3)
        np.testing.assert_array_equal(path, recorded)
        assert (np.diff(path[:, 4]) > 0.0).all()


def test_another_goal_is_reached_with_a_lane_change():
    world = World.from_scenario(make_drive("change"))
    path = path_of(world, LaneRoute((90.0, 3.5)))
    np.testing.assert_allclose(path[[0, -1], :2], [[0.0, 0.0], [90.0, 3.5]], atol=1e-3)
    assert (np.abs(np.diff(path[:, 1])) < 0.2).all()
    simulation = Simulation([world], (Replay(), Idm(objects=ego, route=LaneRoute((90.0, 3.5)))), has_passengers=True)
    for _ in range(60):
        simulation.step()
    x, y = simulation.state.position[0, 0]
    assert 50.0 < x < 61.0 and y == pytest.approx(3.5, abs=0.01)


def test_planners_and_agents_have_the_route():
    world = World.from_scenario(make_drive("goal"))
    route = LaneRoute(lambda world, row: (world.log_position[-1, row, 0] + 30.0, 3.5))
    planned = Simulation([world], (Replay(), Planned(planner=IdmPlanner, route=route)), has_passengers=True)
    driven = Simulation([world], (Replay(), External(route=route)))
    for _ in range(50):
        planned.step()
        driven.step([[0.0, 0.2]])
    assert planned.state.position[0, 0, 1] == pytest.approx(3.5, abs=0.4)
    assert driven.state.lateral[0, 0] == pytest.approx(-3.5, abs=0.1), "the agent is beside its route"


def test_a_goal_that_no_lane_leads_to_is_an_error():
    world = World.from_scenario(make_drive("lost"))
    with pytest.raises(BadParameter, match=r"no lanes lead from the start of t0 to \[-20.0, 0.0\]; choose a goal"):
        path_of(world, LaneRoute((-20.0, 0.0)))
    assert route_between(world.roads, (0.0, 100.0), 0.0, (50.0, 0.0)) is None
    parked = World.from_scenario(make_drive("parked", speed=0.0))
    assert LaneRoute((9.0, 0.0)).applied(parked, ego(parked)) is parked
