"""Distance to lane lines."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.scenario.vocabulary import MapFeatureType, is_road_line
from scenarionet_sim.sensors.base import map_types
from scenarionet_sim.sensors.line_rays import LineRays


@dataclass(frozen=True)
class LaneLineDetector(LineRays):
    """Rays at painted lines, broken and solid, over 20 m. See :class:`LineRays`."""

    range: float = 20.0
    types: tuple[MapFeatureType, ...] = map_types(is_road_line)
