"""Whether lanes cross: the sign of an intersection in maps that do not mark them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import shapely

from scenarionet_data import vocabulary
from scenarionet_data.scenario import MapFeatures

Array = npt.NDArray[Any]

_POINT = 0  # shapely's type id


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
    first, second = first[first < second], second[first < second]
    crossings = shapely.intersection(shapes[first], shapes[second])
    points, pair = shapely.get_parts(crossings, return_index=True)  # two lanes may cross more than once
    trail = shapely.linestrings(path) if len(path) > 1 else shapely.points(path[0])
    is_near = (shapely.get_type_id(points) == _POINT) & (shapely.distance(points, trail) <= distance)
    entries = [set(features.entry_lanes[row]) for row in rows]
    for a, b, point in zip(first[pair[is_near]], second[pair[is_near]], points[is_near], strict=True):
        at = shapely.get_coordinates(point)[0]
        if entries[a].isdisjoint(entries[b]) and _angle_between(lines[a], lines[b], at) > angle:
            return True
    return False


def _lanes_near(features: MapFeatures, path: Array, distance: float) -> Array:
    """Rows of lanes whose bounding box meets the path's, widened by ``distance``."""
    lower, upper = features.polyline.bounds()
    meets = (lower[:, :2] <= path.max(axis=0) + distance) & (upper[:, :2] >= path.min(axis=0) - distance)
    return np.flatnonzero(meets.all(axis=1) & vocabulary.is_lane(features.types) & (features.polyline.lengths > 1))


def _angle_between(first: Array, second: Array, at: Array) -> float:
    """Angle in [0, pi/2] [rad] between two lines where they pass the point ``at``."""
    turn = abs(_direction(first, at) - _direction(second, at)) % np.pi
    return float(min(turn, np.pi - turn))


def _direction(line: Array, at: Array) -> float:
    """Direction [rad] of the line's segment nearest to a point."""
    start, step = line[:-1], np.diff(line, axis=0)
    length = np.maximum((step**2).sum(axis=1), np.finfo(np.float64).tiny)
    along = np.clip(((at - start) * step).sum(axis=1) / length, 0.0, 1.0)
    nearest = np.argmin(np.hypot(*(start + along[:, None] * step - at).T))
    return float(np.arctan2(step[nearest, 1], step[nearest, 0]))
