"""Rules of the road: off-road driving and red lights."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Bool, Float64, IntP
from scenarionet_data.scenario.lane_polygons import HALF_WIDTH
from scenarionet_sim.roads.roads import Roads

OFF_ROAD_TOLERANCE = 0.3
"""Distance from the drivable area at which a corner is off the road [m] (nuPlan's ``drivable_area_compliance``)."""

_BEYOND_THE_MAP = 10.0  # [m]
_STOP_REACH = 2.0  # [m] to either side of a stop point


def is_off_road(corners: Float64, roads: Roads) -> Bool:
    """Return the moments (T,) with a corner off the road: nuPlan's ``drivable_area_compliance``, negated.

    A lane without a following one, or without one before, is taken to go on for some metres: there the map ends.

    Args:
        corners: (T, 4, 2) [m].
        roads: The map, with at least one drivable polygon.
    """
    flat = corners.reshape(-1, 2)
    is_off = ~roads.is_on_road(flat)
    rest = np.flatnonzero(is_off)
    if len(rest):
        is_off[rest[_is_near_road(flat, rest, roads)]] = False
    off: Bool = np.any(is_off.reshape(corners.shape[:2]), axis=1)
    return off


def _is_near_road(points: Float64, rest: IntP, roads: Roads) -> Bool:
    """Return which of the points (Q, 2) [m] in the rows ``rest`` are within the tolerance of the road."""
    near_rows = _near(roads, points)
    polygons = [shapely.Polygon(roads.polygons[row]) for row in np.intersect1d(near_rows, _near(roads, points[rest]))]
    beyond = [shapely.LineString(line).buffer(HALF_WIDTH, cap_style="flat") for line in _beyond(roads, near_rows)]
    near, _ = shapely.STRtree([*polygons, *beyond]).query(
        shapely.points(points[rest]), predicate="dwithin", distance=OFF_ROAD_TOLERANCE
    )
    return np.isin(np.arange(len(rest)), near)


def _near(roads: Roads, points: Float64) -> IntP:
    """Rows of the drivable polygons around points (Q, 2) [m]."""
    lower, upper = roads.polygons.bounds()
    is_near = (lower <= points.max(axis=0) + OFF_ROAD_TOLERANCE) & (upper >= points.min(axis=0) - OFF_ROAD_TOLERANCE)
    return np.flatnonzero(roads.is_road & is_near.all(axis=1))


def _beyond(roads: Roads, rows: IntP) -> Iterator[Float64]:
    """Lines (2, 2) from the ends of lanes at which the map ends, out of some lanes [m]."""
    lanes = rows[rows < roads.num_lanes]
    lanes = lanes[roads.lanes.lengths[lanes] > 1]
    is_entered = np.isin(np.arange(roads.num_lanes), roads.successors.values)
    for lane in lanes.tolist():
        line = roads.lanes[lane].astype(np.float64)
        ends = [(line[-1], line[-2])] if not roads.successors.lengths[lane] else []
        ends += [] if is_entered[lane] else [(line[0], line[1])]
        for end, inner in ends:
            away = end - inner
            yield np.array([end, end + _BEYOND_THE_MAP / max(float(np.hypot(*away)), 1e-9) * away])


def runs_red_light(position: Float64, stop: Float64, direction: Float64, is_red: Bool) -> Bool:
    """Return the lights (L,) whose stop point the vehicle's centre passes in the lane's direction while they are red.

    Args:
        position: (T, 2) [m].
        stop: (L, 2) stop points [m].
        direction: (L, 2) unit vectors of the lanes at the stop points.
        is_red: (L, T).
    """
    away = position[None] - stop[:, None]
    along = (away * direction[:, None]).sum(axis=-1)
    across = away[..., 1] * direction[:, None, 0] - away[..., 0] * direction[:, None, 1]
    passes = (along[:, :-1] < 0.0) & (along[:, 1:] >= 0.0) & (np.abs(across[:, 1:]) <= _STOP_REACH)
    ran: Bool = (passes & is_red[:, 1:]).any(axis=1)
    return ran
