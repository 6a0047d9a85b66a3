"""Replay: the log, exactly."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_sim.arrays.log import YAW_RATE
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.scenarios import make_scenario


@pytest.mark.parametrize("seed", range(6))
def test_objects_are_at_their_recorded_states_while_valid(seed):
    scenario = make_scenario(seed)
    tracks, simulation = scenario.tracks, Simulation([World.from_scenario(scenario)], [Replay()])
    for t in range(scenario.num_timesteps):
        state, valid = simulation.state, tracks.valid[:, t]
        assert state.timestep[0] == t
        np.testing.assert_array_equal(state.present[0], valid)
        for ours, recorded in (
            (state.position, tracks.position[:, t, :2]), (state.z, tracks.position[:, t, 2]),
            (state.heading, tracks.heading[:, t]), (state.velocity, tracks.velocity[:, t]),
            (state.yaw_rate, simulation.batch.worlds[0].log[t, :, YAW_RATE]),
        ):  # fmt: skip
            np.testing.assert_array_equal(ours[0][valid], recorded[valid])
        simulation.step()


def test_after_the_log_objects_are_at_rest():
    world = World.from_scenario(make_scenario(1))
    simulation = Simulation([world], [Replay()])
    for _ in range(world.num_steps - 1):
        simulation.step()
    there = world.log_valid[-1]
    assert simulation.state.velocity[0, there].any()
    for _ in range(3):
        simulation.step()
        state = simulation.state
        np.testing.assert_array_equal(state.present[0], there)
        np.testing.assert_array_equal(state.position[0, there], world.log_position[-1, there])
        assert not state.velocity[0, there].any() and not state.yaw_rate[0, there].any()
