"""An arena of one world for every timestep length: a batch of scenarios is played in as few arenas as it takes."""

from __future__ import annotations

from types import TracebackType
from typing import Self

from scenarionet_sim.backends.base import Backend
from scenarionet_sim.environments.arena import Arena
from scenarionet_sim.environments.config import PAPER_OBSERVATION, EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.policies import Policy
from scenarionet_sim.scenarios import Scenarios
from scenarionet_sim.sensors.base import Sensor
from scenarionet_sim.worlds.world import World


class Theatre:
    """Arenas of one world each, made when first wanted.

    Args:
        policies: Who drives what.
        backend: How agents move.
        sensors: What the agent observes; what the paper's observes for None.
    """

    def __init__(
        self, policies: tuple[Policy, ...], backend: Backend, sensors: tuple[Sensor, ...] | None = None
    ) -> None:
        self._observation = Observation(sensors or PAPER_OBSERVATION, "flat")
        self._config = EnvConfig(Scenarios("."), policies, backend)
        self._arenas: dict[float, Arena] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.clear()

    def arena(self, world: World) -> Arena:
        """The arena for a world; its episode has yet to begin."""
        key = round(world.dt, 3)
        if key not in self._arenas:
            self._arenas[key] = Arena(self._config, self._observation, [world])
        return self._arenas[key]

    def clear(self) -> None:
        """Close the arenas, for example because what happened in one leaves it in doubt."""
        for arena in self._arenas.values():
            arena.close()
        self._arenas = {}
