"""What is around an agent as rows of numbers, as from perfect perception: objects, and the road."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.sensors.base import require, table
from scenarionet_sim.sensors.compiled import CompiledSensor
from scenarionet_sim.sensors.observation_kernels import OBJECTS_NEAR, PIECES_NEAR, SensorForm


@dataclass(frozen=True)
class Surrounding(CompiledSensor):
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

    @property
    def form(self) -> SensorForm:
        """The sensor as kernels take it: its range, and factors."""
        factors = 1.0 / self.range, 1.0 / self.max_speed, 1.0 / self.max_size
        return SensorForm(OBJECTS_NEAR, [self.range, *factors], self.objects, table(self.types))


@dataclass(frozen=True)
class RoadSegments(CompiledSensor):
    """The pieces of lanes, road lines and road edges whose midpoints are nearest to the agent, in its frame.

    Polylines are thinned first: a point is left out while its triangle with its neighbours has less than 0.1 m², and
    segments of more than 20 m are cut into equal pieces. Of pieces at the same distance, those are taken that come
    first on the map; the rows are in the order of the map, not of the distance.

    Observes (segments, 8) float32 in [-1, 1]; a row of zeros where there is no piece:

    0. - 1.  midpoint, x forward and y left / ``range``
    2.       half of the length / 10 m
    3. - 4.  cosine and sine of its direction minus the agent's heading
    5. - 7.  1 for a lane, a road line, a road edge

    Attributes:
        segments: Largest number of pieces.
        range: Largest distance of a midpoint [m].
    """

    low: ClassVar[float] = -1.0

    segments: int = 200
    range: float = 50.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require(is_count(self.segments, 1), f"RoadSegments needs segments >= 1, found segments={self.segments}")
        require(0 < self.range < np.inf, f"RoadSegments needs a range above 0 m, found range={self.range}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(segments, 8)."""
        return self.segments, 8

    @property
    def form(self) -> SensorForm:
        """The sensor as kernels take it."""
        return SensorForm(PIECES_NEAR, [self.range], self.segments)
