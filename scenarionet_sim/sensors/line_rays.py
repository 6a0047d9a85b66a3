"""Rays at the lines of the map: detectors of the road boundary and of lane lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from scenarionet_data.scenario.settings import Count, Positive
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_road_edge, is_road_line
from scenarionet_sim.sensors.base import map_types, require
from scenarionet_sim.sensors.compiled import RaySensor
from scenarionet_sim.sensors.observation_kernels import LINE_RAYS

BOUNDARIES = (
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE,
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE,
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_YELLOW,
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW,
    *map_types(is_road_edge),
)
"""Lines that a vehicle must not cross: edges and solid lines, as in MetaDrive's side detector. Solid lines are included
because some sources (nuScenes and nuPlan in ScenarioNet's pickles) record the road edge as a solid white line."""


@dataclass(frozen=True)
class LineRays(RaySensor):
    """Rays from the agent's centre to the nearest line of the map.

    Observes (rays,) float32 in [0, 1]: the distance as a share of ``range``, 1 without a line in reach or without
    a map. Ray k points 2 pi k / rays counter-clockwise from straight ahead and turns with the agent.
    Objects do not occlude lines.

    Attributes:
        rays: Number of rays.
        range: Largest distance from the agent's centre [m].
        types: Visible line types.
        noise: Standard deviation of the Gaussian range error [m].
        dropout: Probability that a ray has no return.
    """

    kind: ClassVar[int] = LINE_RAYS

    rays: Count = 12
    range: Positive = 50.0
    types: tuple[MapFeatureType, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        require(len(self.types) > 0, f"{type(self).__name__} needs at least one line type, found types=()")


@dataclass(frozen=True)
class BoundaryDetector(LineRays):
    """Rays at road edges and solid lines; the paper uses 12 over 50 m. See :class:`LineRays`."""

    types: tuple[MapFeatureType, ...] = BOUNDARIES


@dataclass(frozen=True)
class LaneLineDetector(LineRays):
    """Rays at painted lines, broken and solid, over 20 m. See :class:`LineRays`."""

    range: Positive = 20.0
    types: tuple[MapFeatureType, ...] = map_types(is_road_line)
