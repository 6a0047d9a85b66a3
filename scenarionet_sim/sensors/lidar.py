"""A planar lidar: distances to other objects all around."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from scenarionet_data.scenario.settings import Count, Positive
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.sensors.compiled import RaySensor
from scenarionet_sim.sensors.observation_kernels import LIDAR


@dataclass(frozen=True)
class Lidar(RaySensor):
    """Rays from the agent's centre to the nearest edge of another object's box.

    Observes (rays,) float32 in [0, 1]: the distance as a share of ``range``, 1 without a hit, 0 inside a box.
    Ray k points 2 pi k / rays counter-clockwise from straight ahead and turns with the agent. Nearer boxes occlude
    farther ones; heights are ignored.

    Attributes:
        rays: Number of rays.
        range: Largest distance from the agent's centre [m].
        types: Visible object types, for example ``(ObjectType.PEDESTRIAN,)``; None for all. Use one lidar per type to
            distinguish types.
        noise: Standard deviation of the Gaussian range error [m].
        dropout: Probability that a ray has no return.
    """

    kind: ClassVar[int] = LIDAR

    rays: Count = 240
    range: Positive = 50.0
    types: tuple[ObjectType, ...] | None = None
