"""The conformance suite of sensors: a test class inherits it and sets ``sensor``."""

from __future__ import annotations

import pickle
from dataclasses import fields, replace
from functools import lru_cache

import numpy as np
import pytest

from scenarionet_sim.sensors.base import Sensor
from scenarionet_sim.simulation.simulation import Simulation
from tests.fixtures.simulations import alone, crowd, simulate


@pytest.fixture
def simulation() -> Simulation:
    return _crowd()


@lru_cache
def _crowd(steps: int = 4) -> Simulation:
    return simulate(*crowd(), steps=steps, history=2)


class SensorConformance:
    """Inherit, set ``sensor``, import the fixture ``simulation``."""

    sensor: Sensor

    @property
    def exact(self) -> Sensor:
        """The sensor without noise."""
        noises = {field.name: 0.0 for field in fields(self.sensor) if field.name in ("noise", "dropout")}
        return replace(self.sensor, **noises)

    def observed(self, simulation, sensor=None, agents=None, seed=0):
        sensor = sensor or self.sensor
        agents = simulation.agents if agents is None else agents
        out = np.full((len(agents), *sensor.shape), 77, sensor.dtype)
        found = sensor.observe(simulation.batch, simulation.state, agents, np.random.default_rng(seed), out)
        assert found is out
        return out

    def check(self, simulation):
        """Every agent's observation is in the space."""
        space = self.sensor.space()
        observed = self.observed(simulation)
        assert observed.dtype == self.sensor.dtype == space.dtype
        assert observed.shape[1:] == self.sensor.shape == space.shape
        assert all(space.contains(one) for one in observed)
        return observed

    def test_observations_are_in_the_space(self, simulation):
        assert len(simulation.agents) > 20
        observed = self.check(simulation)
        assert len(np.unique(observed)) > 1
        assert self.sensor.empty(3).shape == (3, *self.sensor.shape)

    def test_equal_seeds_are_bit_identical(self, simulation):
        np.testing.assert_array_equal(self.observed(simulation), self.observed(simulation))

    def test_batch_equals_its_agents_one_by_one(self, simulation):
        together = self.observed(simulation, self.exact)
        for place in range(0, len(simulation.agents), 5):
            one = self.observed(simulation, self.exact, simulation.agents[place : place + 1])
            np.testing.assert_array_equal(one[0], together[place])

    def test_observation_does_not_depend_on_other_worlds(self, simulation):
        """Sizes of other worlds and padding have no effect."""
        third = simulate(crowd()[2], steps=0, history=2)
        among = _crowd(steps=0)
        rows = among.agents[:, 0] == 2
        np.testing.assert_array_equal(
            self.observed(third, self.exact), self.observed(among, self.exact, among.agents[rows])
        )

    def test_observing_does_not_change_the_state(self, simulation):
        before = pickle.dumps(simulation.state)
        self.observed(simulation)
        assert pickle.dumps(simulation.state) == before

    def test_no_agents(self, simulation):
        assert self.observed(simulation, agents=np.zeros((0, 2), np.int32)).shape == (0, *self.sensor.shape)

    @pytest.mark.parametrize("has_map", [True, False])
    def test_one_object_without_lights(self, has_map):
        self.check(simulate(alone(has_map=has_map), history=2))

    def test_sensor_is_picklable_and_compares_by_value(self):
        copy = pickle.loads(pickle.dumps(self.sensor))
        assert copy == self.sensor
        assert hash(copy) == hash(self.sensor)
