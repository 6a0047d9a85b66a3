"""IDM: headway to objects on the path, including the ego; red lights; bends; appearing and leaving."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.arrays.idm import free_acceleration, interaction
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState, ObjectType
from scenarionet_sim.metrics.comfort import body_acceleration, measure_comfort
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.idm_kernels import Law, speed_before_stop, speed_for_bends
from scenarionet_sim.policies.objects import ego, vehicles
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive

BRAKE, COAST = [[0.0, -1.0]], [[0.0, 0.0]]


def run(scenario: ScenarioDescription, policies, actions=None, steps=None):
    """Positions (T, N, 2) and presence (T, N) of a run of one world."""
    simulation = Simulation([World.from_scenario(scenario)], policies)
    moments = []
    for _ in range(steps or scenario.num_timesteps - 1):
        simulation.step(actions)
        moments.append((simulation.state.position[0].copy(), simulation.state.present[0].copy()))
    position, present = map(np.array, zip(*moments, strict=True))
    return position, present


def test_follower_keeps_its_headway_to_a_braking_ego():
    scenario = make_drive(num_steps=101, others=(Other(-25.0, vx=10.0),))
    position, present = run(scenario, (Replay(), Idm(), External()), BRAKE)
    gaps = position[:, 0, 0] - position[:, 1, 0] - 4.6
    assert present.all()
    assert gaps.min() > 1.0
    assert gaps[-1] == pytest.approx(2.0, abs=0.7)  # the standstill gap
    replayed, _ = run(scenario, (Replay(), External()), BRAKE)
    assert (replayed[:, 0, 0] - replayed[:, 1, 0] - 4.6).min() < 0.0  # the logged vehicle drives through


def test_approach_to_a_standing_vehicle_is_the_law_integrated_by_hand_and_comfortable():
    world = World.from_scenario(make_drive(num_steps=201, others=(Other(150.0),)))
    law, place, speed = Idm(objects=ego), 0.0, 10.0
    simulation = Simulation([world], (Replay(), law))
    velocity = [[speed, 0.0]]
    for _ in range(250):
        gap = 150.0 - place - 4.6
        free = free_acceleration.py_func(speed, 10.0, law.acceleration, law.deceleration)
        numbers = law.headway, law.acceleration, law.deceleration, law.standstill
        braked = speed + 0.1 * (free - interaction.py_func(speed, gap, speed, *numbers))
        place, speed = place + 0.1 * (speed + braked) / 2.0, braked
        simulation.step()
        velocity.append(simulation.state.velocity[0, 0].tolist())
        assert simulation.state.position[0, 0, 0] == pytest.approx(place, abs=0.01)
    assert speed < 0.1 and 2.0 < gap < 2.5
    heading = np.zeros(len(velocity))
    comfort = measure_comfort(body_acceleration(np.array(velocity), heading, 0.1), heading, 0.1)
    assert comfort.is_comfortable and comfort.max_lon_jerk < 1.0


def test_free_road_is_driven_at_the_recorded_speed():
    scenario = make_drive(num_steps=61, others=(Other(40.0, vx=12.0),))
    position, _ = run(scenario, (Replay(), Idm()), steps=50)
    recorded = scenario.tracks.position[1, 1:51, 0]
    np.testing.assert_allclose(position[:, 1, 0], recorded, atol=0.3)
    np.testing.assert_allclose(position[:, 1, 1], 0.0, atol=1e-6)


def test_objects_on_another_lane_are_ignored():
    others = (Other(-25.0, 3.5, vx=10.0),)
    beside, _ = run(make_drive(others=others), (Replay(), Idm(), External()), BRAKE)
    alone, _ = run(make_drive(others=others), (Replay(), Idm()))
    np.testing.assert_array_equal(beside[:, 1], alone[:, 1])


@pytest.mark.parametrize("kind", [ObjectType.PEDESTRIAN, ObjectType.TRAFFIC_CONE, ObjectType.CYCLIST])
def test_any_object_on_the_path_stops_the_vehicle(kind):
    scenario = make_drive(speed=0.0, num_steps=101, others=(Other(-60.0, 3.5, vx=10.0), Other(10.0, 3.5, type=kind)))
    position, _ = run(scenario, (Replay(), Idm()), steps=180)
    assert 4.0 < position[-1, 1, 0] < 10.0 - 2.3


def test_vehicle_waits_for_a_crossing_object():
    crossing = Other(-20.0, -8.0, vy=1.6, type=ObjectType.PEDESTRIAN)
    scenario = make_drive(speed=0.0, num_steps=161, others=(Other(-60.0, vx=8.0), crossing))
    position, _ = run(scenario, (Replay(), Idm()))
    car, walker = position[:, 1], position[:, 2]
    on_the_strip = np.abs(walker[:, 1]) < 0.5
    assert (car[on_the_strip, 0] < -20.0 - 2.3).all()
    assert car[-1, 0] > -10.0


def test_objects_at_another_height_are_ignored():
    scenario = make_drive(speed=0.0, others=(Other(-30.0, 3.5, vx=10.0), Other(-10.0, 3.5)))
    scenario.tracks.position[2, :, 2] = 6.0
    position, _ = run(scenario, (Replay(), Idm()))
    assert position[:, 1, 0].max() > -5.0


def test_vehicle_stops_at_a_red_light_of_its_lane_and_starts_on_green():
    scenario = make_drive(num_steps=121, red=True)  # the ego's path meets it after 60 m
    state = scenario.lights.state
    state[:, 100:] = LightState.TRAFFIC_LIGHT_GREEN
    position, _ = run(scenario, [Idm(objects=ego)])
    front = position[:, 0, 0] + 2.3
    assert 55.0 < front[95] < 60.0
    assert front[-1] > front[95] + 1.0


def test_yellow_is_passed_when_comfortable_braking_is_impossible():
    scenario = make_drive(num_steps=81, red=True)  # the light is 40 m ahead
    scenario.lights.state[:] = LightState.TRAFFIC_LIGHT_GREEN
    scenario.lights.state[:, 30:] = LightState.TRAFFIC_LIGHT_YELLOW  # from 8 m on
    passing, _ = run(scenario, [Idm(objects=ego)])
    assert passing[-1, 0, 0] > 60.0
    scenario.lights.state[:] = LightState.TRAFFIC_LIGHT_YELLOW
    stopping, _ = run(scenario, [Idm(objects=ego)])
    assert stopping[-1, 0, 0] + 2.3 < 40.0


def test_vehicle_slows_down_for_a_bend():
    time = np.arange(201) * 0.1
    angle = np.clip((10.0 * time - 60.0) / 10.0, 0.0, np.pi / 2)  # 60 m straight, then a bend of 10 m
    scenario = make_drive(num_steps=201)
    tracks = scenario.tracks
    tracks.velocity[0] = 10.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    tracks.heading[0] = angle
    tracks.position[0, :, :2] = np.cumsum(tracks.velocity[0], axis=0) * 0.1
    position, _ = run(scenario, [Idm(objects=ego)], steps=120)
    speed = np.hypot(*np.diff(position[:, 0], axis=0).T) / 0.1
    turning = (position[1:, 0, 0] > 62.0) & (position[1:, 0, 1] < 8.0)
    assert speed[turning].max() < 1.2 * np.sqrt(3.0 * 10.0)  # lateral acceleration of 3
    assert speed[:30].min() > 9.0


def test_vehicle_appears_once_its_place_is_free_and_leaves_at_the_end_of_its_path():
    coming = Other(20.0, vx=10.0, first=10, last=30)
    scenario = make_drive(num_steps=61, others=(coming,))
    _, present = run(scenario, (Replay(), Idm()), steps=55)
    assert present[9, 1] and not present[8, 1]
    assert not present[-1, 1]
    slow = replace(coming, x=4.0, vx=6.0)  # the ego occupies the place at first, then leaves it behind
    _, present = run(make_drive(num_steps=61, others=(slow,)), (Replay(), Idm()), steps=30)
    first = int(np.argmax(present[:, 1])) + 1
    assert 4.6 < 0.4 * first - 4.0 < 6.2  # distance between centres when it appears


def test_stationary_objects_are_replayed():
    world = World.from_scenario(make_drive(others=(Other(30.0, 3.5), Other(-30.0, 3.5, vx=9.0))))
    simulation = Simulation([world], (Replay(), Idm(objects=vehicles)))
    assert simulation.driver[0].tolist() == [1, 0, 1]


def test_parameters_must_be_positive():
    with pytest.raises(BadParameter, match="headway=0"):
        Idm(headway=0.0)


def test_the_ego_stops_at_the_end_of_its_path_and_stays_while_others_leave():
    """From 10 m/s it brakes by 3 m/s² over the last 16.7 m, to the last step, in which it would need less."""
    scenario = make_drive(num_steps=61, others=(Other(-25.0, vx=10.0),))
    simulation = Simulation([World.from_scenario(scenario)], (Replay(), Idm(objects=ego)))
    places, speeds = [0.0], [10.0]
    for _ in range(100):
        simulation.step()
        assert simulation.state.present[0, 0]
        places.append(float(simulation.state.position[0, 0, 0]))
        speeds.append(float(np.hypot(*simulation.state.velocity[0, 0])))
    braking = -np.diff(speeds) / 0.1
    assert places[-1] == pytest.approx(60.0, abs=0.01) and speeds[-1] == 0.0
    distance = 60.0 - np.array(places)
    is_stopping = (distance[:-1] < 15.0) & (distance[1:] > 0.01)
    np.testing.assert_allclose(braking[is_stopping][:-1], 3.0, atol=0.02)
    np.testing.assert_allclose(np.array(speeds)[:-1][is_stopping] ** 2, 6.0 * distance[:-1][is_stopping], atol=0.1)
    assert max(braking) < 3.1 and np.all(np.diff(places) >= 0.0)


def test_a_speed_before_a_stop_by_hand():
    """3 m/s² over 6 m need 6 m/s: after a step of 0.1 s from 6 m/s it is 5.7 m/s, after 0.585 m."""
    assert speed_before_stop.py_func(6.0, 6.0, 3.0, 0.1) == pytest.approx(5.7)
    assert speed_before_stop.py_func(-1.0, 2.0, 3.0, 0.1) == 0.0


def speed_after_a_step(scenario):
    """Speed of the ego, which IDM drives at 10 m/s, after a step from the beginning."""
    simulation = Simulation([World.from_scenario(scenario)], (Replay(), Idm(objects=ego)))
    simulation.step()
    return float(np.hypot(*simulation.state.velocity[0, 0]))


def test_one_step_before_a_red_light_is_the_law_with_the_gap_to_the_front():
    law = Idm(objects=ego)
    gap = 60.0 - 4.6 / 2.0  # of the front: the light is 60 m ahead of the centre
    dynamic = 10.0 * law.headway + 10.0 * 10.0 / (2.0 * np.sqrt(law.acceleration * law.deceleration))
    braking = law.acceleration * ((law.standstill + dynamic) / gap) ** 2
    speed = speed_after_a_step(make_drive(num_steps=121, red=True))
    assert speed == pytest.approx(10.0 - 0.1 * braking, abs=2e-4)  # at its desired speed it does not accelerate


@pytest.mark.parametrize(("leader", "dynamic"), [(6.5, 15.0 + 10.0 * 3.5 / 24.0**0.5), (20.0, 0.0)])
def test_one_step_behind_a_leader_is_the_law_with_the_gap_between_bumpers(leader, dynamic):
    """By hand: 1.5 s of headway, and closing at 3.5 m/s; a leader that draws away leaves the standstill gap of 2 m."""
    law = Idm(objects=ego)
    assert (law.headway, law.acceleration, law.deceleration, law.standstill) == (1.5, 2.0, 3.0, 2.0)
    braking = 2.0 * ((2.0 + dynamic) / (30.0 - 4.6)) ** 2
    speed = speed_after_a_step(make_drive(num_steps=121, others=(Other(30.0, vx=leader),)))
    assert speed == pytest.approx(10.0 - 0.1 * braking, abs=1e-4)


def test_a_follower_does_not_count_even_beside_the_centre():
    assert speed_after_a_step(make_drive(others=(Other(-0.5, 0.5, vx=10.0),))) == pytest.approx(10.0, abs=1e-4)


@pytest.mark.parametrize(("height", "is_met"), [(1.55, True), (1.65, False)])
def test_objects_are_met_up_to_half_of_both_heights(height, is_met):
    """Both are 1.6 m high, and wider than that."""
    scenario = make_drive(num_steps=121, others=(Other(12.0, vx=6.0),))
    scenario.tracks.position[1, :, 2] = height
    assert (speed_after_a_step(scenario) < 9.9) == is_met


def test_an_object_on_a_diagonal_street_is_met():
    """The same street turned by 45 degrees gives the same step."""
    scenario = make_drive(num_steps=121, others=(Other(30.0, vx=6.5),))
    straight, tracks, root = speed_after_a_step(scenario), scenario.tracks, np.sqrt(0.5)
    for moving in (tracks.position, tracks.velocity):
        moving[..., 1] = root * moving[..., 0]
        moving[..., 0] *= root
    tracks.heading[:] = np.pi / 4
    assert straight < 9.9
    assert speed_after_a_step(scenario) == pytest.approx(straight, abs=1e-4)


@pytest.mark.parametrize(("start", "appears"), [(-9.0, False), (-10.0, True)])
def test_a_long_vehicle_waits_for_its_whole_place(start, appears):
    """A bus of 12 m, a metre further after 10 steps: its front would reach 0.3 m into the ego, or stay away 0.7 m."""
    scenario = make_drive(speed=0.0, others=(Other(start, vx=1.0, first=10),))
    scenario.tracks.size[1] = 12.0, 2.5, 3.0
    _, present = run(scenario, (Replay(), Idm(objects=lambda world: np.arange(2) == 1)), steps=12)
    assert present[9:, 1].all() if appears else not present[:, 1].any()


@kernel(allocates=False)
def speed_ahead(top_speed, stations, count, law):
    """Call the device function."""
    return speed_for_bends(top_speed, stations, count, law)


@pytest.mark.parametrize(
    ("distance", "top_speed", "speed"),
    [
        (0.0, 20.0, np.sqrt(3.0 * 10.0)),  # v²/r is the lateral acceleration
        (8.0, 20.0, np.sqrt(3.0 * 10.0 + 2.0 * 8.0)),  # half of a deceleration of 2 over 8 m: v² falls by 2 * 8
        (8.0, 5.0, 5.0),
    ],
)
def test_speed_before_a_bend_of_ten_metres(distance, top_speed, speed):
    law = Law(1.5, 1.5, 2.0, 2.0, 1.0, 3.0, 0.0, 8.0)
    stations = np.zeros((64, 7))
    stations[:3, 2], stations[:3, 3] = [0.0, distance, distance + 2.0], [0.0, 0.0, 0.2]  # arc [m], heading [rad]
    first = 0 if distance else 1
    assert speed_ahead(top_speed, stations[first:], 3 - first, law) == pytest.approx(speed)
