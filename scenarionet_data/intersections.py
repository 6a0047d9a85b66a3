"""Whether lanes cross: the sign of an intersection in maps that do not mark them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import shapely

from scenarionet_data import vocabulary
from scenarionet_data.scenario import MapFeatures

Array = npt.NDArray[Any]


def lanes_cross_near(features: MapFeatures, path: Array, distance: float, angle: float) -> bool:
    """Whether two lanes with different predecessors cross close to a path.

    Args:
        features: The map.
        path: (n, 2) [m] in the map's frame.
        distance: How far from the path a crossing counts [m].
        angle: Smallest angle between the lanes that counts as crossing [rad].
    """
    rows = _lanes_near(features, path, distance)
    if len(rows) < 2:
        return False
    lines = [features.polyline[row][:, :2].astype(np.float64) for row in rows]
    shapes = np.array([shapely.linestrings(line) for line in lines])
    first, second = shapely.STRtree(shapes).query(shapes, predicate="crosses")
    trail = shapely.linestrings(path) if len(path) > 1 else shapely.points(path[0])
    entries = [set(features.entry_lanes[row]) for row in rows]
    for a, b in zip(first, second, strict=True):
        if a < b and not (entries[a] & entries[b]):
            point = shapely.get_point(shapely.intersection(shapes[a], shapes[b]), 0)
            if point is None:  # several crossing points: the first of them
                point = shapely.get_geometry(shapely.intersection(shapes[a], shapes[b]), 0)
            at = shapely.get_coordinates(point)[0]
            if _angle_between(lines[a], lines[b], at) > angle and shapely.distance(point, trail) <= distance:
                return True
    return False


def _lanes_near(features: MapFeatures, path: Array, distance: float) -> Array:
    """Rows of lanes with a point in the path's bounding box widened by ``distance``."""
    lower, upper = path.min(axis=0) - distance, path.max(axis=0) + distance
    points = features.polyline.values[:, :2]
    inside = ((points >= lower) & (points <= upper)).all(axis=1)
    per_point = np.repeat(np.arange(len(features)), features.polyline.lengths)
    near = np.bincount(per_point[inside], minlength=len(features)) > 0
    return np.flatnonzero(near & vocabulary.is_lane(features.types) & (features.polyline.lengths > 1))


def _angle_between(first: Array, second: Array, at: Array) -> float:
    """Angle in [0, pi/2] [rad] between two lines where they pass the point ``at``."""
    directions = []
    for line in (first, second):
        middle = (line[1:] + line[:-1]) / 2
        step = np.diff(line, axis=0)
        # The segment that holds the point is the one whose middle is nearest relative to its length.
        nearest = np.argmin(np.hypot(*(middle - at).T) - np.hypot(*step.T) / 2)
        directions.append(np.arctan2(step[nearest, 1], step[nearest, 0]))
    turn = abs(directions[0] - directions[1]) % np.pi
    return float(min(turn, np.pi - turn))
