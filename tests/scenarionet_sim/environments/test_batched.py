"""The compiled step: equal to the sensors' own observations, and in place for the episodes that begin in it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import BOUNDARY, PAPER_OBSERVATION, EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.policies import External, Idm, Replay, vehicles
from scenarionet_sim.scenarios import Scenarios
from scenarionet_sim.sensors import Lidar, LightAhead, Navigation, Surrounding
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.scenarios import make_scenario

SENSORS = (
    *PAPER_OBSERVATION, *BOUNDARY, Lidar(30, 20.0, types=(ObjectType.PEDESTRIAN,)), LightAhead(), Surrounding(4),
    Navigation(3, 5.0), Lidar(20, noise=0.1),
)  # fmt: skip

ALL_DRIVE = (Replay(), Idm(), External(vehicles))


@cache
def worlds() -> list[World]:
    walker = Other(8.0, 2.0, type=ObjectType.PEDESTRIAN)
    drives = [make_drive(others=(walker, Other(20.0, vx=5.0)), red=True), make_drive(has_map=False)]
    return [World.from_scenario(scenario) for scenario in (*drives, make_scenario(1), make_scenario(2))]


def make(form="flat", policies=ALL_DRIVE, sensors=SENSORS, threads=1):
    config = EnvConfig(Scenarios("."), policies, Kinematic(), sensors=sensors)
    return BatchedEnvironment(config, Observation(sensors, form), worlds(), threads), Observation(sensors, form)


def drive(core, steps):
    rng = np.random.default_rng(0)
    for _ in range(steps):
        core.step(rng.uniform(-1, 1, (len(core.agents), 2)))


@pytest.mark.parametrize("form", ["flat", "dict"])
def test_compiled_sensors_observe_as_sensors_do(form):
    """Bit for bit, with agents that appear and leave."""
    core, observation = make(form)
    for part in range(4):
        drive(core, 3)
        if part == 2:
            core.retire([1])
        found = core.observe(np.random.default_rng(5))
        state, batch = core.simulation.state, core.simulation.batch
        wanted = observation.of(batch, state, core.agents, np.random.default_rng(5))
        for name in observation.names if form == "dict" else [...]:
            np.testing.assert_array_equal(found[name], wanted[name])


def test_episode_that_begins_in_a_step_is_that_of_a_reset():
    """Its world sits the step out; the others are not affected."""
    policies = (Replay(), Idm(), External())
    (core, _), (alone, _), (others, _) = (make(policies=policies) for _ in range(3))
    actions = np.full((4, 2), 0.3)
    for env in (core, others):
        for _ in range(7):
            env.step(actions)
    core.begin_in_step([1, 3], [worlds()[0], worlds()[2]])
    alone.begin([1, 3], [worlds()[0], worlds()[2]])
    begun, rng = [1, 3], np.random.default_rng
    for step in range(3):
        core.step(actions)
        others.step(actions)
        if step:
            alone.step(actions)
        seen, first, rest = (env.observe(rng(0)) for env in (core, alone, others))
        exact = slice(0, -20)  # without noise
        np.testing.assert_array_equal(seen[begun, exact], first[begun, exact])
        np.testing.assert_array_equal(seen[[0, 2], exact], rest[[0, 2], exact])
        np.testing.assert_array_equal(core.numbers[begun], alone.numbers[begun])
        np.testing.assert_array_equal(core.numbers[[0, 2]], others.numbers[[0, 2]])
    assert core.simulation.state.timestep.tolist() == [10, 2, 10, 2]
