"""Rules of the road: off-road driving, driving direction and red lights."""

from __future__ import annotations

import numpy as np
import shapely

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32
from scenarionet_sim.roads.roads import Roads

OFF_ROAD_TOLERANCE = 0.3
"""Distance from the drivable area at which a corner is off the road [m] (nuPlan's ``drivable_area_compliance``)."""

ON_LANE = 2.0
"""Largest distance from a centreline at which a vehicle's centre is on the lane [m]."""

_WRONG_WAY_WINDOW = 1.0  # [s]
_STOP_REACH = 2.0  # [m] to either side of a stop point


def is_off_road(corners: Float64, roads: Roads) -> Bool:
    """Return the moments (T,) with a corner off the road: nuPlan's ``drivable_area_compliance``, negated.

    Args:
        corners: (T, 4, 2) [m].
        roads: The map, with at least one drivable polygon.
    """
    polygons = shapely.STRtree(
        [shapely.Polygon(outline) for outline in roads.polygons.take(np.flatnonzero(roads.is_road))]
    )
    near, _ = polygons.query(shapely.points(corners.reshape(-1, 2)), predicate="dwithin", distance=OFF_ROAD_TOLERANCE)
    is_off = np.ones(corners.shape[0] * corners.shape[1], np.bool_)
    is_off[near] = False
    off: Bool = np.any(is_off.reshape(corners.shape[:2]), axis=1)
    return off


@kernel
def lane_progress(position: Float64, lanes: Float32, offsets: Int32, reach: float) -> Float64:
    """Return the progress along the lanes in each step: of the lanes it is on, along the one it follows best.

    Args:
        position: (T, 2) centre of the vehicle [m].
        lanes: (P, 2) points of every centreline.
        offsets: (M + 1,) start of each lane in ``lanes``.
        reach: Largest distance from a centreline at which it is on the lane [m].

    Returns:
        (T,) [m]; 0 first and off all lanes; negative against the direction of all lanes it is on.
    """
    progress = np.zeros(len(position))
    for t in range(1, len(position)):
        x, y = position[t - 1, 0], position[t - 1, 1]
        dx, dy = position[t, 0] - x, position[t, 1] - y
        best = -np.inf
        for lane in range(len(offsets) - 1):
            for k in range(offsets[lane], offsets[lane + 1] - 1):
                ax, ay = lanes[k + 1, 0] - lanes[k, 0], lanes[k + 1, 1] - lanes[k, 1]
                bx, by = x - lanes[k, 0], y - lanes[k, 1]
                square = ax * ax + ay * ay
                if square == 0.0:
                    continue
                share = min(1.0, max(0.0, (ax * bx + ay * by) / square))
                if (bx - share * ax) ** 2 + (by - share * ay) ** 2 <= reach * reach:
                    best = max(best, (ax * dx + ay * dy) / np.sqrt(square))
        if best > -np.inf:
            progress[t] = best
    return progress


def wrong_way(progress: Float64, dt: float) -> tuple[float, float]:
    """Return the largest distance driven against the traffic within a second, and nuPlan's score for it.

    The score is ``driving_direction_compliance``: 1 below 2 m, 0.5 below 6 m, else 0.

    Args:
        progress: (T,) see :func:`lane_progress`.
        dt: [s].
    """
    window = max(1, round(_WRONG_WAY_WINDOW / dt))
    total = np.concatenate((np.zeros(window), np.cumsum(progress)))
    within = total[window:] - total[:-window]
    distance = max(0.0, -float(within.min()))
    return distance, 1.0 if distance < 2.0 else 0.5 if distance < 6.0 else 0.0


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
