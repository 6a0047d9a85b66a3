"""How far it is to the road's boundary."""

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
"""What a vehicle may not drive over: edges and solid lines, as for MetaDrive's side detector. Solid lines count because
some sources (nuScenes and nuPlan in ScenarioNet's pickles) record the road's edge as a solid white line."""


@dataclass(frozen=True)
class BoundaryDetector(LineRays):
    """Rays at road edges and solid lines; the paper's has 12 over 50 m. See :class:`LineRays`."""

    types: tuple[MapFeatureType, ...] = BOUNDARIES
