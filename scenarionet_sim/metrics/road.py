"""Off-road driving."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, IntP
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.scenario.lane_polygons import HALF_WIDTH
from scenarionet_sim.arrays.containment import is_near_outline
from scenarionet_sim.roads.roads import Roads

OFF_ROAD_TOLERANCE = 0.3
"""Distance from the drivable area at which a corner is off the road [m] (nuPlan's ``drivable_area_compliance``)."""

_BEYOND_THE_MAP = 10.0  # [m]


def is_off_road(corners: Float64, roads: Roads, on_lane: Bool | None = None) -> Bool:
    """Return the moments (T,) with a corner off the road: nuPlan's ``drivable_area_compliance``, negated.

    A lane without a following one, or without one before, is taken to go on for some metres: there the map ends.

    Args:
        corners: (T, 4, 2) [m].
        roads: The map, with at least one drivable polygon.
        on_lane: (T, 4) corners that are known to be on a lane.
    """
    points = corners.reshape(-1, 2)
    is_off = np.ones(len(points), np.bool_) if on_lane is None else ~on_lane.reshape(-1)
    rest = np.flatnonzero(is_off)
    is_off[rest] = ~roads.is_on_road(points[rest])
    rest = rest[is_off[rest]]
    if len(rest):
        outlines, bounds, asked = roads.polygons, roads.polygon_bounds, points[rest]
        near: Bool = np.zeros(len(rest), np.bool_)
        rows = np.flatnonzero(roads.is_road & _is_beside(bounds, asked))
        _mark_near(asked, outlines.values, outlines.offsets, rows, OFF_ROAD_TOLERANCE**2, near)
        start, direction = _beyond(roads, np.flatnonzero(roads.is_road & _is_beside(bounds, points)))
        away = asked[:, None] - start
        along = away[..., 0] * direction[:, 0] + away[..., 1] * direction[:, 1]
        across = away[..., 1] * direction[:, 0] - away[..., 0] * direction[:, 1]
        before = np.maximum(np.maximum(-along, along - _BEYOND_THE_MAP), 0.0)
        beside = np.maximum(np.abs(across) - HALF_WIDTH, 0.0)
        near |= (before**2 + beside**2 <= OFF_ROAD_TOLERANCE**2).any(axis=1)
        is_off[rest[near]] = False
    off: Bool = np.any(is_off.reshape(corners.shape[:2]), axis=1)
    return off


@kernel(allocates=False)
def _mark_near(points: Float64, outlines: Float32, offsets: Int32, rows: IntP, square: float, near: Bool) -> None:
    """Mark the points (Q, 2) whose squared distance from the outline of one of some polygons is at most ``square``."""
    for q in range(len(points)):
        for row in rows:
            if is_near_outline(points[q, 0], points[q, 1], outlines, offsets[row], offsets[row + 1], square):
                near[q] = True
                break


def _is_beside(bounds: Float32, points: Float64) -> Bool:
    """Return which boxes, lower and upper corners (B, 4), are within the tolerance of the box around points (Q, 2)."""
    lower, upper = bounds[:, :2], bounds[:, 2:]
    beside = (lower <= points.max(axis=0) + OFF_ROAD_TOLERANCE) & (upper >= points.min(axis=0) - OFF_ROAD_TOLERANCE)
    found: Bool = beside.all(axis=1)
    return found


def _beyond(roads: Roads, rows: IntP) -> tuple[Float64, Float64]:
    """Return ends (E, 2) [m] at which the map ends, and directions (E, 2) out of the lanes among some polygons."""
    lanes = rows[rows < roads.num_lanes]
    lanes = lanes[roads.lanes.lengths[lanes] > 1]
    is_entered = np.isin(lanes, roads.successors.values)
    starts = roads.lanes.offsets[lanes[~is_entered]]
    stops = roads.lanes.offsets[lanes[roads.successors.lengths[lanes] == 0] + 1] - 1
    end = roads.lanes.values[np.concatenate([starts, stops])].astype(np.float64)
    away = end - roads.lanes.values[np.concatenate([starts + 1, stops - 1])]
    return end, away / np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)[:, None]
