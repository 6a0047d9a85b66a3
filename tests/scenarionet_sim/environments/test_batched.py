"""The compiled step: equal to the sensors' own observations, and in place for the episodes that begin in it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.backends.fleet import Fleet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import BOUNDARY, PAPER_OBSERVATION, EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.objects import vehicles
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.sensors.bird_view import BirdView
from scenarionet_sim.sensors.lidar import Lidar
from scenarionet_sim.sensors.navigation import LightAhead, Navigation
from scenarionet_sim.sensors.surrounding import RoadSegments, Surrounding
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.scenarios import make_scenario

SENSORS = (
    *PAPER_OBSERVATION, *BOUNDARY, Lidar(30, 20.0, types=(ObjectType.PEDESTRIAN,)), LightAhead(), Surrounding(4),
    Navigation(3, 5.0), RoadSegments(9, 30.0), Lidar(20, noise=0.1),
)  # fmt: skip

ALL_DRIVE = (Replay(), Idm(), External(vehicles))


@cache
def worlds() -> list[World]:
    walker = Other(8.0, 2.0, type=ObjectType.PEDESTRIAN)
    drives = [make_drive(others=(walker, Other(20.0, vx=5.0)), red=True), make_drive(has_map=False)]
    return [World.from_scenario(scenario) for scenario in (*drives, make_scenario(1), make_scenario(2))]


def make(form="flat", policies=ALL_DRIVE, sensors=SENSORS, threads=1, backend=None):
    config = EnvConfig(Scenarios("."), policies, backend or Kinematic(), sensors=sensors)
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


@pytest.mark.parametrize(
    ("policies", "backend", "sensors"),
    [
        ((Replay(), Idm(), External()), Kinematic(), SENSORS),
        ((Replay(), Idm()), Kinematic(), SENSORS),
        (ALL_DRIVE, Kinematic(), SENSORS),
        (ALL_DRIVE, Kinematic(Fleet()), SENSORS),
        ((Replay(), External()), Kinematic(), (*SENSORS[:-1], BirdView(16, 32.0, history=3), SENSORS[-1])),
    ],
    ids=["ego", "passenger", "vehicles", "fleet", "history"],
)
def test_episode_that_begins_in_a_step_is_that_of_a_reset(policies, backend, sensors):
    """Its world sits the step out; the others are not affected."""
    core, alone, others = (make("dict", policies, sensors, backend=backend)[0] for _ in range(3))
    for env in (core, others):
        for _ in range(7):
            env.step(np.full((len(env.agents), 2), 0.3))
    core.simulation.begin([1, 3], [worlds()[2], worlds()[0]])
    alone.begin([1, 3], [worlds()[2], worlds()[0]])
    for step in range(3):
        for env in (core, others, alone) if step else (core, others):
            env.step(np.full((len(env.agents), 2), 0.3))
        for slot, env in ((0, others), (1, alone), (2, others), (3, alone)):
            (here,), (wanted,) = (np.nonzero(other.agents[:, 0] == slot) for other in (core, env))
            assert len(here)
            np.testing.assert_array_equal(core.agents[here], env.agents[wanted])
            np.testing.assert_array_equal(core.numbers[here], env.numbers[wanted])
            np.testing.assert_array_equal(core.contacts[here], env.contacts[wanted])
            seen, expected = (other.observe(np.random.default_rng(0)) for other in (core, env))
            for name in list(seen)[:-1]:  # without noise
                np.testing.assert_array_equal(seen[name][here], expected[name][wanted], name)
    assert core.simulation.state.timestep.tolist() == [10, 2, 10, 2]
