"""Sensors that are a part of the compiled step."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32
from scenarionet_data.scenario.settings import Count, NonNegative, Positive, Share
from scenarionet_sim.sensors.base import Sensor, add_noise, directions, require_located, table
from scenarionet_sim.sensors.observation_kernels import (
    OWN_MOTION,
    PIECES_NEAR,
    WAY_AHEAD,
    Sensing,
    SensorForm,
    observe_by_one,
)
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


class CompiledSensor(Sensor):
    """Base class of these sensors."""

    @property
    @abstractmethod
    def form(self) -> SensorForm:
        """The sensor as kernels take it."""

    @property
    def is_exact(self) -> bool:
        """Whether the sensor adds no noise, so that the compiled step observes all of it."""
        return True

    def disturb(self, out: Array, rng: np.random.Generator) -> None:
        """Add noise to exact observations."""

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:
        """Write the observations by the code of the compiled step."""
        sensing = _sensing_of(self)._replace(out=out.reshape(-1))
        if sensing.kind[0] == PIECES_NEAR:
            batch.show_pieces()
        lost = observe_by_one(agents, batch.recorded, batch.lines, state.moment, sensing)
        if sensing.kind[0] in (OWN_MOTION, WAY_AHEAD):
            require_located(lost, agents)
        self.disturb(out, rng)
        return out


@lru_cache
def _sensing_of(sensor: CompiledSensor) -> Sensing:
    """Return the arrays of one sensor, without an output."""
    sensing = Sensing.of([sensor.form])
    sensing.place[0, 1] = np.prod(sensor.shape)
    return sensing


def compiled_form(sensor: Sensor) -> SensorForm | None:
    """Return a sensor as kernels take it; None if only ``observe`` can be called, as it is noisy or a class's own."""
    if isinstance(sensor, CompiledSensor) and type(sensor).observe is CompiledSensor.observe and sensor.is_exact:
        return sensor.form
    return None


@dataclass(frozen=True)
class RaySensor(CompiledSensor):
    """Evenly spread rays from the agent's centre to the nearest thing of some types.

    Observes (rays,) float32 in [0, 1]: the distance as a share of ``range``, 1 without a hit. Ray k points 2 pi k /
    rays counter-clockwise from straight ahead and turns with the agent.

    Attributes:
        rays: Number of rays.
        range: Largest distance from the agent's centre [m].
        types: Visible types; None for all.
        noise: Standard deviation of the Gaussian range error [m].
        dropout: Probability that a ray has no return.
    """

    kind: ClassVar[int]

    rays: Count
    range: Positive
    types: tuple[IntEnum, ...] | None
    noise: NonNegative = 0.0
    dropout: Share = 0.0

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the observation: (rays,)."""
        return (self.rays,)

    @property
    def form(self) -> SensorForm:
        """The rays as kernels take them."""
        return SensorForm(self.kind, [self.range], self.rays, table(self.types), directions(self.rays))

    @property
    def is_exact(self) -> bool:
        """Whether there is neither noise nor dropout."""
        return not self.noise and not self.dropout

    def disturb(self, out: Array, rng: np.random.Generator) -> None:
        """Add noise and dropout."""
        add_noise(out, self.noise / self.range, self.dropout, rng)
