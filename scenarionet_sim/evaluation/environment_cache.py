"""Single-world environments by timestep length, reused over a batch of scenarios."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from scenarionet_sim.backends.base import Backend
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import PAPER_OBSERVATION, EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.policies import Policy
from scenarionet_sim.scenarios import Scenarios
from scenarionet_sim.sensors.base import Sensor
from scenarionet_sim.worlds.world import World


class EnvironmentCache:
    """One environment per timestep length, created on first use; a context manager that closes them.

    Args:
        policies: Policies of the simulation.
        backend: Vehicle dynamics of the agents.
        sensors: Sensors of the agent; None for the paper's observation.
    """

    def __init__(
        self, policies: tuple[Policy, ...], backend: Backend, sensors: tuple[Sensor, ...] | None = None
    ) -> None:
        self._observation = Observation(sensors or PAPER_OBSERVATION, "flat")
        self._config = EnvConfig(Scenarios("."), policies, backend)
        self._environments: dict[float, BatchedEnvironment] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.clear()

    def environment_for(self, world: World) -> BatchedEnvironment:
        """Return the environment that can play a world; call its ``begin`` to start the episode."""
        key = round(world.dt, 3)
        if key not in self._environments:
            self._environments[key] = BatchedEnvironment(self._config, self._observation, [world])
        return self._environments[key]

    def clear(self) -> None:
        """Close all environments, for example after an error has left one in an undefined state."""
        for environment in self._environments.values():
            environment.close()
        self._environments = {}
