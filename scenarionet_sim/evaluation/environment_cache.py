"""A single-world environment that is reused over a batch of scenarios."""

from __future__ import annotations

from types import TracebackType
from typing import Self

import numpy as np

from scenarionet_sim.backends.base import Backend
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import PAPER_OBSERVATION, EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.policies import Policy
from scenarionet_sim.scenarios import Scenarios
from scenarionet_sim.sensors.base import Sensor
from scenarionet_sim.worlds.world import World


class EnvironmentCache:
    """One environment, created on first use; a context manager that closes it.

    Args:
        policies: Policies of the simulation.
        backend: Vehicle dynamics of the agents.
        sensors: Sensors of the agent; None for the paper's observation.
    """

    def __init__(
        self, policies: tuple[Policy, ...], backend: Backend, sensors: tuple[Sensor, ...] | None = None
    ) -> None:
        self._observation = Observation(sensors or PAPER_OBSERVATION, "flat")
        self._config = EnvConfig(Scenarios("."), policies, backend, cache_size=1)
        self._environment: BatchedEnvironment | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.clear()

    def environment_for(self, world: World, rng: np.random.Generator | None = None) -> BatchedEnvironment:
        """Return the environment that can play a world; call its ``begin`` to start the episode.

        Args:
            world: The world.
            rng: Draws the parameters of stochastic policies; None leaves them as they are.
        """
        if self._environment is None:
            self._environment = BatchedEnvironment(self._config, self._observation, [world])
        if rng is not None:
            self._environment.simulation.policies = tuple(policy.sampled(rng) for policy in self._config.policies)
        return self._environment

    def clear(self) -> None:
        """Close the environment, for example after an error has left it in an undefined state."""
        if self._environment is not None:
            self._environment.close()
        self._environment = None
