"""Distance to the road boundary."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.scenario.vocabulary import MapFeatureType, is_road_edge
from scenarionet_sim.sensors.base import map_types
from scenarionet_sim.sensors.line_rays import LineRays

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
class BoundaryDetector(LineRays):
    """Rays at road edges and solid lines; the paper uses 12 over 50 m. See :class:`LineRays`."""

    types: tuple[MapFeatureType, ...] = BOUNDARIES
