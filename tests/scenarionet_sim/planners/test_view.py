"""What planners see: values in both frames, the route and its lanes, lights, and past moments."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.scenario.vocabulary import LightColor, ObjectType
from scenarionet_sim.planners.base import Planner, Trajectory
from scenarionet_sim.planners.policy import Planned
from scenarionet_sim.planners.view import View
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.scenarios import make_scenario

OTHERS = (Other(30.0, 3.5, vx=6.0), Other(12.0, -4.0, vy=2.0, type=ObjectType.PEDESTRIAN, first=2))


def drive() -> World:
    return World.from_scenario(make_drive("seen", others=OTHERS, red=True))


class Witness(Planner):
    """Remembers what it saw, and goes on at constant velocity."""

    history = 3

    def __init__(self) -> None:
        self.seen: list[tuple[np.ndarray, np.ndarray, np.ndarray, float]] = []
        WITNESSES.append(self)

    def act(self, view: View) -> Trajectory:
        past = view.objects.past_position.copy(), view.objects.past_present.copy(), view.past_poses.copy()
        self.seen.append((*past, view.ego.acceleration))
        here, step = np.array([view.ego.x, view.ego.y, view.ego.heading]), 1.0 + 0.1 * len(self.seen)
        return Trajectory.every(0.1, here + np.outer([1, 2, 3], [step, 0.0, 0.0]))


WITNESSES: list[Witness] = []


def test_the_scene_in_metres():
    world = drive()
    simulation = Simulation([world], (Replay(),))
    for _ in range(5):
        simulation.step()
    view = View(world, simulation.state, 0, world.ego)
    assert (view.timestep, view.time, view.dt) == (5, pytest.approx(0.5), 0.1)
    assert (view.ego.x, view.ego.y, view.ego.speed) == (pytest.approx(5.0), 0.0, pytest.approx(10.0))
    assert view.objects.track_ids.tolist() == ["t1", "t2"] and len(view.objects) == 2
    np.testing.assert_allclose(view.objects.position, [[33.0, 3.5], [12.0, -3.0]], atol=1e-5)
    np.testing.assert_allclose(view.objects.velocity, [[6.0, 0.0], [0.0, 2.0]], atol=1e-5)
    assert view.objects.object_type.tolist() == [ObjectType.VEHICLE, ObjectType.PEDESTRIAN]
    assert (view.route.position, view.route.lateral) == (pytest.approx(5.0), pytest.approx(0.0))
    np.testing.assert_allclose(view.goal, [40.0, 0.0], atol=1e-5)
    assert [str(world.roads.lane_ids[lane]) for lane in view.route.lanes] == ["right_a", "right_b"]
    (lane,) = view.lanes.successors(int(view.route.lanes[0]))
    assert lane == view.route.lanes[1]
    np.testing.assert_allclose(view.lanes.centreline(int(lane))[0], [20.0, 0.0])
    assert view.lanes.is_on_road(np.array([[0.0, 0.0], [0.0, 50.0]])).tolist() == [True, False]
    np.testing.assert_allclose(view.route.stop_arc, [20.0], atol=1e-5)
    assert view.lights.color[view.route.stop_light].tolist() == [LightColor.RED]


def test_both_frames_show_the_same():
    world = World.from_scenario(make_scenario(1))
    simulation = Simulation([world], (Replay(),))
    row = int(np.flatnonzero(simulation.state.present[0])[-1])
    there, here = (View(world, simulation.state, 0, row, frame) for frame in ("scenario", "ego"))
    assert (here.ego.x, here.ego.y, here.ego.heading) == (0.0, 0.0, 0.0)
    assert here.ego.speed == there.ego.speed and here.route.position == there.route.position
    for name, part in (("position", "objects"), ("centreline", "route"), ("stop", "lights")):
        mine, given = getattr(getattr(here, part), name), getattr(getattr(there, part), name)
        apart = given - np.array([there.ego.x, there.ego.y])
        np.testing.assert_allclose(np.hypot(*mine.T), np.hypot(*apart.T), atol=1e-4)
        angle = np.arctan2(mine[:, 1], mine[:, 0]) - (np.arctan2(apart[:, 1], apart[:, 0]) - there.ego.heading)
        far = np.hypot(*mine.T) > 0.1
        np.testing.assert_allclose(np.exp(1j * angle[far]), 1.0, atol=1e-3)
    np.testing.assert_allclose(here.frame.points_to_scenario(here.objects.position), there.objects.position, atol=1e-9)
    turned = np.exp(1j * (here.objects.heading + there.ego.heading - there.objects.heading))
    np.testing.assert_allclose(turned, 1.0, atol=1e-9)
    poses = here.frame.poses_to_scenario(np.array([[2.0, 1.0, 0.3]]))
    assert poses[0, 2] == pytest.approx((there.ego.heading + 0.3 + np.pi) % (2 * np.pi) - np.pi)


def test_planners_get_the_past_they_ask_for():
    WITNESSES.clear()
    world = drive()
    simulation = Simulation([world], (Replay(), Planned(planner=Witness)), has_passengers=True)
    for _ in range(5):
        simulation.step()
    (witness,) = [each for each in WITNESSES if each.seen]
    first, last = witness.seen[0], witness.seen[4]
    assert not first[1].any() and np.isnan(first[2]).all() and first[3] == 0.0
    np.testing.assert_allclose(last[0][:, 0, 0], [30.0 + 0.6 * step for step in (3, 2, 1)], atol=1e-4)
    assert last[1].tolist() == [[True, True], [True, True], [True, False]]  # the pedestrian appears at step 2
    assert (np.diff(last[2][:, 0]) < -0.9).all() and last[3] > 0.0
    simulation.reset(0)
    simulation.step()
    assert not [each for each in WITNESSES if each.seen][-1].seen[0][1].any(), "past of the episode before"


def test_arrays_are_views_of_the_simulation():
    world = drive()
    simulation = Simulation([world], (Replay(),))
    view = View(world, simulation.state, 0, world.ego)
    assert view.lights.stop is world.light_stop
    for array in (view.route.centreline, view.route.arc):
        assert np.shares_memory(array, world.paths.path)
    assert np.shares_memory(view.lanes.centreline(0), world.roads.lanes.values)
