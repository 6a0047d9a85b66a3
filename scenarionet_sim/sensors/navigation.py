"""Points and the next traffic light ahead on the agent's reference path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.scenario.settings import Count, Positive
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS
from scenarionet_sim.sensors.base import Sensor, require_located
from scenarionet_sim.sensors.compiled import CompiledSensor
from scenarionet_sim.sensors.observation_kernels import WAY_AHEAD, SensorForm
from scenarionet_sim.sensors.route_kernels import observe_light
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class Navigation(CompiledSensor):
    """Points of the reference path ahead of the agent, in its frame; the paper uses 10 points at 2 m spacing.

    Observes (points, 2) float32 in [-1, 1]: x forward and y left as shares of ``range``, clipped. The first point is
    one spacing ahead of the agent; points beyond the end of the path are its end. 0 for an agent without a path.

    Attributes:
        points: Number of points.
        spacing: Distance between points along the path [m].
        range: Distance that is scaled to 1 [m].
    """

    low: ClassVar[float] = -1.0

    points: Count = 10
    spacing: Positive = 2.0
    range: Positive = 25.0

    @property
    def shape(self) -> tuple[int, ...]:
        """(points, 2)."""
        return self.points, 2

    @property
    def form(self) -> SensorForm:
        """The sensor as kernels take it."""
        return SensorForm(WAY_AHEAD, [self.spacing, self.range], self.points)


@dataclass(frozen=True)
class LightAhead(Sensor):
    """The next light on the agent's own path: distance to its stop point, and its current colour.

    Observes (4,) float32 in [0, 1]: the distance along the path from the agent's centre as a share of ``range``; 1 for
    green, 1 for yellow, 1 for red. An unknown colour gives three zeros; without a light in reach the observation
    is (1, 0, 0, 0). After the end of the recording lights keep their last state.

    Attributes:
        range: Range along the path [m].
    """

    range: Positive = 50.0

    @property
    def shape(self) -> tuple[int, ...]:
        """(4,)."""
        return (4,)

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """Write distance and colour."""
        lost = observe_light(agents, state.route, state.timestep, batch.recorded, LIGHT_COLORS, self.range, out)
        require_located(lost, agents)
        return out
