"""The traffic light that the agent comes to next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS
from scenarionet_sim.kernels.route_observation import observe_light
from scenarionet_sim.sensors.base import Sensor, require, require_arcs
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class LightAhead(Sensor):
    """The next light on the agent's own path: how far its stop point is, and what it shows now.

    Observes (4,) float32 in [0, 1]: the distance along the path from the agent's centre as a share of ``range``; 1 for
    green, 1 for yellow, 1 for red. A light whose colour is unknown has three zeros; without a light in reach it is
    (1, 0, 0, 0). After the recording's end lights show what they showed last.

    Attributes:
        range: [m] along the path.
    """

    range: float = 50.0

    def __post_init__(self) -> None:
        require(self.range > 0, f"the range of a light ahead is above 0 m, found range={self.range}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(4,)."""
        return (4,)

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """See the class."""
        require_arcs(state, agents)
        stops = batch.stop_arc, batch.stop_light, batch.stop_offsets
        lights = batch.light_state, batch.num_steps, LIGHT_COLORS
        observe_light(agents, state.arc, state.timestep, *stops, *lights, self.range, out)
        return out
