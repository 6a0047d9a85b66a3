"""Ways through the lane graph: for every lane and destination how far it is, and which successor to take."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Float64, Int32

LANE_CHANGE_COST = 80.0  # [m] of detour a driver accepts rather than change lanes


@kernel
def find_routes(
    length: Float64, exit_first: Int32, exit_to: Int32, left: Int32, right: Int32, destination: Int32, count: int
) -> tuple[Float64, Int32]:
    """Bellman-Ford from every destination backwards.

    Args:
        length: (L,) [m], with what a lane costs beyond its length.
        exit_first, exit_to, left, right: As in ``LaneGraph``.
        destination: (L,) the destination reached at the lane's end, -1 for none.
        count: D, the number of destinations.

    Returns:
        cost (D, L) [m] and next_lane (D, L), -1 where the destination cannot be reached by driving on.
    """
    lanes = len(length)
    cost = np.full((count, lanes), np.inf)
    next_lane = np.full((count, lanes), -1, dtype=np.int32)
    for goal in range(count):
        changed = True
        while changed:
            changed = False
            for lane in range(lanes - 1, -1, -1):
                best = length[lane] if destination[lane] == goal else np.inf
                for e in range(exit_first[lane], exit_first[lane + 1]):
                    through = length[lane] + cost[goal, exit_to[e]]
                    if through < best:
                        best = through
                        next_lane[goal, lane] = exit_to[e]
                for beside in (left[lane], right[lane]):
                    if beside >= 0:
                        best = min(best, cost[goal, beside] + LANE_CHANGE_COST)
                if best < cost[goal, lane] - 1e-9:
                    cost[goal, lane] = best
                    changed = True
    return cost, next_lane
