"""Planners as policies: every driver that comes along, actions and trajectories, several objects and episodes."""

from __future__ import annotations

import os
import pickle
import sys
import time

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.drivers.by_name import MANUAL, PLANNERS, resolve_drivers
from scenarionet_sim.planners.base import Planner, Trajectory
from scenarionet_sim.planners.following import ConstantVelocityPlanner, IdmPlanner, LogReplayPlanner, PurePursuitPlanner
from scenarionet_sim.planners.lane_graph import LaneGraphPlanner
from scenarionet_sim.planners.policy import Planned
from scenarionet_sim.planners.tracking import PerfectTracking
from scenarionet_sim.planners.view import View
from scenarionet_sim.policies.objects import other_vehicles
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.lane_routes import LaneRoute
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive


def drive(planner, scenario, steps: int = 40, **options) -> Simulation:
    policies = Replay(), Planned(planner=planner, **options)
    simulation = Simulation([World.from_scenario(scenario)], policies, has_passengers=True)
    for _ in range(steps):
        simulation.step()
    return simulation


@pytest.mark.parametrize("planner", [kind for name, kind in PLANNERS.items() if name not in MANUAL])
def test_every_planner_drives_an_empty_road(planner):
    simulation = drive(planner, make_drive("empty"))
    x, y = simulation.state.position[0, 0]
    assert 25.0 < x < 45.0 and abs(y) < 0.2
    assert not simulation.hits[0]
    assert 5.0 < np.hypot(*simulation.state.velocity[0, 0]) < 14.0


@pytest.mark.parametrize("planner", [IdmPlanner, LaneGraphPlanner])
@pytest.mark.parametrize("options", [{"others": (Other(35.0),)}, {"red": True, "num_steps": 81}])
def test_idm_stops_for_objects_and_red_lights(planner, options):
    simulation = drive(planner, make_drive("stop", **options), steps=90)
    (x, _), speed = simulation.state.position[0, 0], np.hypot(*simulation.state.velocity[0, 0])
    assert speed < 0.3 and not simulation.hits[0]
    assert 24.0 < x < 40.0


def test_log_replay_with_perfect_tracking_is_the_log():
    scenario = make_drive("log")
    simulation = drive(LogReplayPlanner, scenario, 30, tracker=PerfectTracking())
    np.testing.assert_allclose(simulation.state.position[0, 0], [30.0, 0.0], atol=1e-5)
    np.testing.assert_allclose(simulation.state.velocity[0, 0], [10.0, 0.0], atol=1e-4)


def test_actions_move_through_the_backend():
    pytest.importorskip("pybullet", reason="pybullet has a wheel for CPython 3.11 only")
    wall = make_drive("wall", speed=5.0, others=(Other(16.0),))
    through, against = (
        drive(PurePursuitPlanner, wall, 20, **options).state.velocity[0, 0, 0]
        for options in ({}, {"backend": Bullet()})
    )
    assert against < 3.0 < 8.0 < through, "bodies collide in Bullet alone"


def test_planners_drive_traffic_and_begin_anew():
    others = (Other(30.0, vx=6.0), Other(60.0, 3.5, vx=4.0, first=3))
    world = World.from_scenario(make_drive("traffic", others=others))
    policies = Replay(), Planned(planner=ConstantVelocityPlanner, objects=other_vehicles, tracker=PerfectTracking())
    simulation = Simulation([world, world], policies, threads=2)
    ends = []
    for _ in range(2):
        for _ in range(10):
            simulation.step()
        np.testing.assert_allclose(simulation.state.position[1, 1:], [[36.0, 0.0], [64.0, 3.5]], atol=1e-3)
        ends.append(simulation.state.position.copy())
        for slot in range(2):
            simulation.reset(slot)
    np.testing.assert_array_equal(*ends)


def test_a_policy_is_a_specification():
    policy = Planned(planner=LaneGraphPlanner, tracker=PerfectTracking(), route=LaneRoute((3.0, 4.0)))
    again = pickle.loads(pickle.dumps(policy))
    assert again == policy and hash(again) == hash(policy)


class Wrong(Planner):
    answer: object = (0.0,)

    def act(self, view: View) -> object:
        return self.answer


def test_wrong_answers_are_named():
    with pytest.raises(BadParameter, match=r"Wrong.act returned \(0.0,\); expected a Trajectory, or steering"):
        drive(Wrong, make_drive("wrong"), 1)
    short = type("Short", (Wrong,), {"answer": Trajectory(np.zeros((1, 3)), np.array([0.05]))})
    with pytest.raises(BadParameter, match=r"ends after 0\.05 s"):
        drive(short, make_drive("wrong"), 1)


def test_planners_of_ones_own_by_name():
    drivers = resolve_drivers("tests.scenarionet_sim.planners.test_planned:Wrong", tracker="perfect", route="lanes")
    assert drivers.driver is None
    assert drivers.policies[-1] == Planned(planner=Wrong, tracker=PerfectTracking(), route=LaneRoute())
    with pytest.raises(BadParameter, match="unknown tracker 'magic'; choose from lqr, perfect"):
        resolve_drivers("idm-planner", tracker="magic")


class Ending(Planner):
    """Answers by a function, from its third call on."""

    calls = 0

    def __init__(self, answer):
        self._answer = answer

    def act(self, view):
        self.calls += 1
        return self._answer() if self.calls > 2 else [0.0, 0.0]


@pytest.mark.parametrize(
    ("answer", "limits", "kind", "message"),
    [
        (sys.exit, {}, BadParameter, r"Ending.act called exit\(None\)"),
        (lambda: os._exit(3), {}, BadParameter, r"exit\(3\)"),
        (lambda: [np.inf, 0.0], {}, BadParameter, "not finite"),
        (lambda: time.sleep(60), {"step_limit": 0.05}, TimeoutError, "more than 0.05 s"),
        (lambda: time.sleep(0.02) or [0.0, 0.0], {"episode_limit": 0.1}, TimeoutError, "raise step_limit or episode"),
    ],
)
def test_planners_end_neither_the_process_nor_never(answer, limits, kind, message):
    at_exit, started = os._exit, time.perf_counter()
    with pytest.raises(kind, match=message):
        drive(lambda: Ending(answer), make_drive("end"), **limits)
    assert time.perf_counter() - started < 30.0 and os._exit is at_exit


class Leaving(Planner):
    """Leaves when it is made, or before its first answer."""

    def __init__(self, when):
        if when == "made":
            sys.exit(3)

    def expect(self, view):
        os._exit(4)

    def act(self, view):
        raise NotImplementedError


@pytest.mark.parametrize(
    ("when", "message"), [("made", r"\(\) called exit\(3\)"), ("asked", r"expect called exit\(4\)")]
)
def test_planners_end_the_process_neither_when_made_nor_before_they_are_asked(when, message):
    with pytest.raises(BadParameter, match=message):
        drive(lambda: Leaving(when), make_drive("end"))
