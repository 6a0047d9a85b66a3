"""Routes through the lane graph: for every lane and destination the cost, and the successor to take."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Int64, RecordArray
from scenarionet_data.compiled.decorators import kernel

LANE_CHANGE_COST = 80.0  # [m] of detour a driver accepts rather than change lanes

ROUTE = np.dtype([("cost", "f8"), ("next_lane", "i8")])
"""Cost from a lane to a destination [m], infinite where unreachable, and the successor to take, -1 for none."""


def find_routes(lanes: RecordArray, successors: Int64) -> RecordArray:
    """Find the cheapest routes to all destinations.

    Args:
        lanes: (L,) ``LANE`` records.
        successors: (E,) of all lanes.

    Returns:
        (D, L) ``ROUTE`` records.
    """
    routes: RecordArray = np.recarray((int(lanes.destination.max()) + 1, len(lanes)), ROUTE)
    routes.cost, routes.next_lane = np.inf, -1
    _relax(lanes, successors, routes)
    return routes


@kernel
def _relax(lanes: RecordArray, successors: Int64, routes: RecordArray) -> None:
    """Bellman-Ford from every destination backwards."""
    for goal in range(len(routes)):
        changed = True
        while changed:
            changed = False
            for number in range(len(lanes) - 1, -1, -1):
                lane, route = lanes[number], routes[goal, number]
                length = lane.length + lane.detour
                best = length if lane.destination == goal else np.inf
                for e in range(lane.successors_begin, lane.successors_end):
                    through = length + routes[goal, successors[e]].cost
                    if through < best:
                        best = through
                        route.next_lane = successors[e]
                if lane.left >= 0:
                    best = min(best, routes[goal, lane.left].cost + LANE_CHANGE_COST)
                if lane.right >= 0:
                    best = min(best, routes[goal, lane.right].cost + LANE_CHANGE_COST)
                if best < route.cost - 1e-9:
                    route.cost = best
                    changed = True
