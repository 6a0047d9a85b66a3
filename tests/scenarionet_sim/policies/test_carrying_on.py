"""Constant velocity and agents: motion, and appearance with the log."""

from __future__ import annotations

from functools import cache

import numpy as np

from scenarionet_sim.policies.constant_velocity import ConstantVelocity
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.objects import vehicles
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.policies.sampled import NoisyVelocity
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive


@cache
def world() -> World:
    others = (Other(5.0, 9.0, vx=3.0, vy=4.0), Other(-9.0, 3.5, vx=7.0, first=5, last=8))
    return World.from_scenario(make_drive(others=others))


def test_constant_velocity_continues():
    simulation = Simulation([world()], [ConstantVelocity()])
    for _ in range(50):  # also beyond the end of the log
        simulation.step()
    position, present = simulation.state.position[0], simulation.state.present[0]
    assert present.all()
    np.testing.assert_allclose(position[:2], [[50.0, 0.0], [20.0, 29.0]], atol=1e-3)
    x, y = world().log_position[5, 2]
    np.testing.assert_allclose(position[2], [x + 7.0 * 4.5, y], atol=1e-3)


def test_noise_of_an_episode_leaves_the_recording_as_it_is():
    drive, recorded = World.from_scenario(make_drive()), world().log[:, :1]
    for seed in range(3):
        simulation = Simulation([drive], [NoisyVelocity(seed=seed)])
        assert not np.array_equal(simulation.state.velocity[0], recorded[0, :, 4:6])
    np.testing.assert_array_equal(drive.log, recorded)


def test_agents_appear_with_the_log_and_stay():
    simulation = Simulation([world()], (Replay(), External(objects=vehicles)))
    assert simulation.agents.tolist() == [[0, 0], [0, 1]]
    for _ in range(5):
        simulation.step(np.zeros((len(simulation.agents), 2)))
    assert simulation.agents.tolist() == [[0, 0], [0, 1], [0, 2]]
    np.testing.assert_array_equal(simulation.state.position[0, 2], world().log_position[5, 2])
    assert simulation.state.arc[0, 2] == 0.0
    for _ in range(20):
        simulation.step(np.zeros((3, 2)))
    assert simulation.state.present[0, 2]  # absent from the log from step 9 on
    assert simulation.state.position[0, 2, 0] > world().log_position[5, 2, 0] + 13.0


def test_retired_agents_do_not_return():
    simulation = Simulation([world()], (Replay(), External(objects=vehicles)))
    for _ in range(6):
        simulation.step()
    simulation.retire([[0, 2], [0, 1]])
    assert simulation.agents.tolist() == [[0, 0]]
    for _ in range(5):
        simulation.step([[0.0, 0.0]])
        assert simulation.state.present[0].tolist() == [True, False, False]
    simulation.reset(0)
    assert simulation.agents.tolist() == [[0, 0], [0, 1]]
