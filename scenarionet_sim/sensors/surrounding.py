"""True states of the objects around an agent, as from perfect perception."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Int32, is_count
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.sensors.base import Sensor, require, visible_objects
from scenarionet_sim.sensors.route_kernels import observe_others
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class Surrounding(Sensor):
    """The objects nearest to the agent, nearest first, in its frame.

    Observes (objects, 13) float32 in [-1, 1], each clipped there; a row of zeros where there is no object:

    0.       1 for an object
    1. - 2.  centre, x forward and y left / ``range``
    3. - 4.  cosine and sine of its heading minus the agent's
    5. - 6.  velocity minus the agent's, forward and left / ``max_speed``
    7. - 9.  length, width, height / ``max_size``
    10. - 12. 1 for a vehicle, a pedestrian, a cyclist; all 0 for other types

    Attributes:
        objects: Largest number of objects.
        range: Largest distance between centres [m].
        types: Reported object types; None for all.
        max_speed: [m/s].
        max_size: [m].
    """

    low: ClassVar[float] = -1.0

    objects: int = 16
    range: float = 50.0
    types: tuple[ObjectType, ...] | None = None
    max_speed: float = 40.0
    max_size: float = 20.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require(is_count(self.objects, 1), f"Surrounding needs objects >= 1, found objects={self.objects}")
        scales = self.range, self.max_speed, self.max_size
        require(min(scales) > 0, f"range, max_speed and max_size must be above 0, found {scales}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(objects, 13)."""
        return self.objects, 13

    def observe(self, batch: WorldBatch, state: State, agents: Int32, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """Write the states."""
        observed = np.empty((len(agents), *self.shape))
        is_visible = visible_objects(state, self.types)
        observe_others(agents, state.motion, state.size, state.object_type, is_visible, self.range, observed)
        full = [1.0, *[self.range] * 2, 1.0, 1.0, *[self.max_speed] * 2, *[self.max_size] * 3, 1.0, 1.0, 1.0]
        np.multiply(observed, 1.0 / np.array(full), out=out, casting="same_kind")
        return np.clip(out, -1.0, 1.0, out=out)
