"""Parked cars in bays beside straight and bent roads: the edge of the road leads around them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.procedural.graph import NONE, LaneGraph
from scenarionet_data.procedural.roadmap import NO_JUNCTION, Block, Lane, Obstacle, RoadMap
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType

DEPTH = 2.3
"""Depth of a bay [m]."""
_FROM_ENDS = 10.0
"""Distance of bays from the ends of a road [m]."""
_LENGTHS = 12.0, 45.0
"""Shortest and longest bay [m]."""
_PLACE = 6.5
"""Length of a place [m]."""
_TAPER = 1.5
"""Length in which a bay gets deep [m]."""
_SPACING = 0.5
"""Distance between the points of a lane from which bays are measured [m]."""
_TAKEN = 0.7
"""Share of places that are taken."""


def add_parking(road_map: RoadMap, graph: LaneGraph, share: float, rng: np.random.Generator) -> list[Obstacle]:
    """Add bays beside a share of the rightmost lanes of the map's blocks; return the cars that are parked in them."""
    lanes, cars, row = graph.lanes, list[Obstacle](), -1
    is_plain = (lanes.junction == NO_JUNCTION) & (lanes.right == NONE) & (lanes.conflicts_begin == lanes.conflicts_end)
    half = road_map.road.lane_width / 2.0
    for block in road_map.blocks:
        for lane in block.lanes:
            row += 1
            room = lane.path.length - 2.0 * _FROM_ENDS
            if not is_plain[row] or room < _LENGTHS[0] or rng.random() >= share:
                continue
            length = float(rng.uniform(_LENGTHS[0], min(room, _LENGTHS[1])))
            begin = _FROM_ENDS + float(rng.uniform(0.0, room - length))
            at = np.append(np.arange(begin, begin + length, 1.0), begin + length)
            depth = DEPTH * np.minimum(1.0, np.minimum(at - begin, begin + length - at) / _TAPER)
            inner, outer = beside(lane, at, half), beside(lane, at, half + depth)
            bay = shapely.Polygon(np.concatenate([inner, outer[::-1]]))
            if (
                not bay.is_valid
                or road_map.surface.intersects(bay.buffer(-0.1))
                or not _lead_around(block, lane.right_boundaries, inner, outer)
            ):
                continue
            block.add_area(f"parking{row}", MapFeatureType.CARPARK_AREA, np.concatenate([inner, outer[::-1]]))
            for place in range(int((length - 2.0 * _TAPER) / _PLACE)):
                size = rng.uniform((4.1, 1.7, 1.4), (4.9, 1.9, 1.7))
                if rng.random() < _TAKEN:
                    s = begin + _TAPER + (place + 0.5) * _PLACE + float(rng.uniform(-0.4, 0.4))
                    pose = lane.path.pose_at(s).moved(0.0, -half - 0.2 - size[1] / 2.0, float(rng.normal(0.0, 0.01)))
                    cars.append(
                        Obstacle(ObjectType.VEHICLE, "parked car", pose.x, pose.y, pose.heading, tuple(size.tolist()))
                    )
    return cars


def beside(lane: Lane, at: Float64, right: Float64 | float) -> Float64:
    """Points (n, 2) [m] at distances along a lane (n,), to the right of its centre."""
    points, headings = lane.path.sample(_SPACING)
    along = np.linspace(0.0, lane.path.length, len(points))
    x, y, heading = (np.interp(at, along, column) for column in (*points.T, headings))
    return np.stack([x + right * np.sin(heading), y - right * np.cos(heading)], axis=-1)


def _lead_around(block: Block, boundaries: tuple[str, ...], inner: Float64, outer: Float64) -> bool:
    """Lead the edge of the road along ``outer`` in place of ``inner`` (n, 2); False where that is not its edge."""
    for number, line in enumerate(block.lines):
        if line.id not in boundaries or line.type != MapFeatureType.ROAD_EDGE_BOUNDARY:
            continue
        edge = shapely.LineString(line.points)
        along = shapely.line_locate_point(edge, shapely.points(inner[[0, -1]]))
        if along[0] >= along[1] or shapely.distance(edge, shapely.points(inner)).max() > 0.05:
            return False
        stations = shapely.line_locate_point(edge, shapely.points(line.points))
        parts = [line.points[stations < along[0]], outer, line.points[stations > along[1]]]
        block.lines[number] = replace(line, points=np.concatenate(parts))
        return True
    return False
