"""Pedestrians and cyclists that react: the law against NumPy, the recorded way alone, and a car in the way."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.arrays.log import YAW_RATE
from scenarionet_sim.policies.constant_velocity import ConstantVelocity
from scenarionet_sim.policies.objects import all_objects
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.policies.social_force import SocialForce
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.scenarios import make_scenario


def acceleration(law: SocialForce, world: World, state, n: int) -> np.ndarray:
    """The repulsion of an object by all others, formula by formula."""
    position, velocity, heading = state.position[0], state.velocity[0], state.heading[0]
    total = np.zeros(2)
    for m in np.flatnonzero(state.present[0]):
        if m == n:
            continue
        apart, radius = position[n] - position[m], state.size[0, n, 1] / 2
        strength, reach = law.strength, law.reach
        if state.object_type[0, m] == ObjectType.VEHICLE:
            strength, reach = law.vehicle_strength, law.vehicle_reach
            turn = np.array([[np.cos(heading[m]), np.sin(heading[m])], [-np.sin(heading[m]), np.cos(heading[m])]])
            local, ahead = turn @ apart, (turn @ velocity[m])[0] * law.look_ahead
            half = state.size[0, m, :2] / 2
            low, high = np.add(-half, (min(ahead, 0.0), 0.0)), np.add(half, (max(ahead, 0.0), 0.0))
            over = local - np.clip(local, low, high)
            apart = turn.T @ (over if over.any() else np.array([0.0, np.copysign(1e-3, local[1])]))
        else:
            radius += state.size[0, m, 1] / 2
        distance = np.linalg.norm(apart)
        if distance - radius > law.horizon * reach or distance == 0.0:
            continue
        speed = np.linalg.norm(velocity[n])
        cosine = -velocity[n] @ apart / distance / speed if speed else 1.0
        weight = law.behind + (1 - law.behind) * (1 + cosine) / 2
        total += strength * weight * np.exp(min(radius - distance, 0.0) / reach) * apart / distance
    return total


@pytest.mark.parametrize("seed", range(3))
def test_the_law_is_that_of_the_oracle(seed):
    world, law = World.from_scenario(make_scenario(seed, num_objects=12)), SocialForce(objects=all_objects)
    simulation = Simulation([world], (law,))
    for _ in range(6):
        before = simulation.state.resized(world.num_objects)
        simulation.step()
        step = int(simulation.state.timestep[0])
        log = world.log[min(step, world.num_steps - 1)].astype(np.float64)
        stayed = before.present[0] & simulation.state.present[0]
        for n in np.flatnonzero(stayed):
            there, flow = log[n, :2], log[n, 4:6]
            fastest = law.hurry * max(float(world.top_speed[n]), 1.0)
            wanted = flow + (there - flow * 0.1 - before.position[0, n]) / law.return_time
            wanted *= min(fastest / max(np.linalg.norm(wanted), 1e-9), 1.0)
            velocity = before.velocity[0, n] + (wanted - before.velocity[0, n]) * 0.1 / law.relaxation
            velocity = velocity + acceleration(law, world, before, n) * 0.1
            velocity *= min(fastest / max(np.linalg.norm(velocity), 1e-9), 1.0)
            np.testing.assert_allclose(simulation.state.velocity[0, n], velocity, atol=1e-9)
            expected = before.position[0, n] + velocity * 0.1
            np.testing.assert_allclose(simulation.state.position[0, n], expected, atol=1e-9)
            if np.linalg.norm(velocity) > 0.3:  # it turns to where it goes
                turn = np.angle(np.exp(1j * (np.arctan2(velocity[1], velocity[0]) - before.heading[0, n])))
                assert simulation.state.motion[0, n, YAW_RATE] == pytest.approx(turn / 0.1, abs=1e-6)


def test_alone_it_goes_as_recorded():
    walker = Other(20.0, 40.0, vx=0.5, vy=-1.2, type=ObjectType.PEDESTRIAN, first=3, last=30)
    world = World.from_scenario(make_drive("alone", others=(walker,)))
    simulation = Simulation([world], (Replay(), SocialForce()))
    for step in range(1, 40):
        simulation.step()
        assert simulation.state.present[0, 1] == (3 <= step <= 30)
        if 3 <= step <= 30:
            np.testing.assert_allclose(simulation.state.position[0, 1], world.log_position[step, 1], atol=2e-3)


def test_it_lets_a_car_pass_and_walks_on():
    """The recorded pedestrian would be hit: the car was not there in the recording's way."""
    walker = Other(24.0, -4.0, vy=1.4, type=ObjectType.PEDESTRIAN)
    world = World.from_scenario(make_drive("crossing", others=(walker,), num_steps=121, speed=8.0))
    hits, ends = [], []
    for policy in (Replay(), SocialForce()):
        simulation = Simulation([world], (Replay(), policy, ConstantVelocity(objects=lambda w: np.arange(2) == 0)),
                                has_passengers=True)  # fmt: skip
        touched = False
        for _ in range(110):
            simulation.step()
            touched |= bool(simulation.contacts[0, 1])
        hits.append(touched)
        ends.append(simulation.state.position[0, 1].copy())
    assert hits == [True, False]
    np.testing.assert_allclose(ends[1], ends[0], atol=0.5)  # behind the car it catches up with the recording


def test_impossible_parameters_are_refused():
    with pytest.raises(BadParameter, match=r"reach=0\.0; expected a number above 0"):
        SocialForce(reach=0.0)
