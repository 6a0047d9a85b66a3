"""Stop points of traffic lights."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Int32, Object
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.scenario.description import Lights


def light_places(lights: Lights, lane_ids: Object, lanes: Ragged) -> tuple[Int32, Float32]:
    """Return the rows of the lights' lanes and their stop points.

    Args:
        lights: L lights.
        lane_ids: (M,) str.
        lanes: M x (n, 2 or more) [m] centrelines in driving direction.

    Returns:
        (L,) int32 rows in ``lane_ids``, -1 where the map lacks the lane, and (L, 2) float32 [m]: the recorded place,
        else the start of the lane, else NaN.
    """
    if not len(lights):
        return np.zeros(0, np.int32), np.zeros((0, 2), np.float32)
    row_of = {lane: row for row, lane in enumerate(lane_ids)}
    lane = np.array([row_of.get(name, -1) for name in lights.lane_ids], np.int32)
    stop = lights.stop_point[:, :2].copy()  # ascontiguousarray would return a view for a single light
    assumed = np.isnan(stop).any(axis=1) & (lane >= 0)
    assumed[assumed] = lanes.lengths[lane[assumed]] > 0
    stop[assumed] = lanes.values[lanes.offsets[lane[assumed]], :2]
    return lane, stop
