"""Paint on the road: the lines of a map as painted rectangles, with their dashes, doubles and colours."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, IntP, UInt8
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_road_line
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.roads.roads import Roads

LINE_WIDTH, STOP_WIDTH, DOUBLE_GAP = 0.13, 0.45, 0.16
"""Widths of a lane line and of a stop line, and distance between the middles of a double line and its parts [m]."""

DASH, GAP = 3.0, 6.0
"""Lengths of a dash and of the gap after it [m]."""

BAR, BAR_PERIOD = 0.5, 1.1
"""Width of the bars of a crosswalk and distance from one to the next [m]."""

_M = MapFeatureType
_YELLOW = (
    _M.ROAD_LINE_BROKEN_SINGLE_YELLOW, _M.ROAD_LINE_BROKEN_DOUBLE_YELLOW, _M.ROAD_LINE_SOLID_SINGLE_YELLOW,
    _M.ROAD_LINE_SOLID_DOUBLE_YELLOW, _M.ROAD_LINE_PASSING_DOUBLE_YELLOW,
)  # fmt: skip
_BROKEN = (
    _M.ROAD_LINE_BROKEN_SINGLE_WHITE, _M.ROAD_LINE_BROKEN_SINGLE_YELLOW, _M.ROAD_LINE_BROKEN_DOUBLE_YELLOW,
)  # fmt: skip
_DOUBLE = (
    _M.ROAD_LINE_SOLID_DOUBLE_WHITE, _M.ROAD_LINE_BROKEN_DOUBLE_YELLOW, _M.ROAD_LINE_SOLID_DOUBLE_YELLOW,
    _M.ROAD_LINE_PASSING_DOUBLE_YELLOW,
)  # fmt: skip


def lane_paint(roads: Roads) -> tuple[Float32, UInt8]:
    """Return the strokes (S, 6) and their kinds (S,) of all lines between lanes and stop lines of a map.

    A dashed line is 3 m of paint and 6 m without, along the whole line; of a passing line, the left part is dashed.
    """
    is_painted = is_road_line(roads.segment_type) | (roads.segment_type == MapFeatureType.STOP_LINE)
    rows = np.flatnonzero(is_painted & (np.abs(roads.segments).max(axis=1, initial=0.0) < 1e6))
    if not len(rows):
        return np.zeros((0, 6), np.float32), np.zeros(0, np.uint8)
    ends = roads.segments[rows].astype(np.float64)
    kinds = roads.segment_type[rows]
    vector = ends[:, 2:] - ends[:, :2]
    length = np.hypot(vector[:, 0], vector[:, 1])
    kept = length > 1e-6
    rows, ends, kinds, vector, length = rows[kept], ends[kept], kinds[kept], vector[kept], length[kept]
    unit = vector / length[:, None]
    before = np.maximum(rows - 1, 0)
    is_new = roads.segment_feature[rows] != roads.segment_feature[before]  # does not continue the one before it
    is_new |= (roads.segments[rows, :2] != roads.segments[before, 2:]).any(axis=1)
    is_new[:1] = True
    total = np.cumsum(length) - length
    arc = total - total[np.maximum.accumulate(np.where(is_new, np.arange(len(length)), 0))]  # on its line
    half = np.where(kinds == MapFeatureType.STOP_LINE, STOP_WIDTH / 2, LINE_WIDTH / 2)
    strokes, colors = [], []
    for side in (0.0, DOUBLE_GAP, -DOUBLE_GAP):
        is_double = np.isin(kinds, _DOUBLE)
        chosen = is_double if side else ~is_double
        is_dashed = np.isin(kinds, _BROKEN)
        if side > 0:
            is_dashed = is_dashed | (kinds == MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW)
        for dashed in (False, True):
            (here,) = np.nonzero(chosen & (is_dashed == dashed))
            begin, end = np.zeros(len(here)), length[here]
            if dashed:
                here, begin, end = _dashes(here, arc, length)
            start = ends[here, :2] + unit[here] * begin[:, None]
            start = start + side * np.stack([-unit[here, 1], unit[here, 0]], axis=1)
            strokes.append(np.column_stack([start, unit[here], end - begin, half[here]]))
            colors.append(np.where(np.isin(kinds[here], _YELLOW), codes.YELLOW, codes.WHITE))
    return np.concatenate(strokes).astype(np.float32), np.concatenate(colors).astype(np.uint8)


def _dashes(rows: IntP, arc: Float64, length: Float64) -> tuple[IntP, Float64, Float64]:
    """Return the dashes on segments: rows, and where each begins and ends on its segment [m]."""
    period = DASH + GAP
    first = np.floor(arc[rows] / period)
    count = (np.floor((arc[rows] + length[rows]) / period) - first + 1).astype(np.int64)
    owner = np.repeat(rows, count)
    number = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + np.repeat(first, count)
    begin = np.clip(number * period - arc[owner], 0.0, length[owner])
    end = np.clip(number * period + DASH - arc[owner], 0.0, length[owner])
    kept = end - begin > 1e-6
    return owner[kept], begin[kept], end[kept]


def crosswalk_paint(outlines: list[Float64]) -> tuple[Float32, UInt8]:
    """Return the bars of crosswalks: along their short side, one after another along the long one.

    Args:
        outlines: (n, 2) corners of each crosswalk [m].
    """
    strokes: list[Float64] = []
    for outline in outlines:
        middle = outline.mean(axis=0)
        _, _, axes = np.linalg.svd(outline - middle, full_matrices=False)
        if axes.shape != (2, 2):
            continue
        along = (outline - middle) @ axes[0]
        for place in np.arange(along.min() + 0.3 + BAR / 2, along.max() - 0.3, BAR_PERIOD):
            reach = _extent(outline, middle + place * axes[0], axes[1])
            if reach is not None and reach[1] - reach[0] > 0.3:
                start = middle + place * axes[0] + reach[0] * axes[1]
                strokes.append(np.array([*start, *axes[1], reach[1] - reach[0], BAR / 2]))
    kinds = np.full(len(strokes), codes.CROSSWALK_BAR, np.uint8)
    return np.array(strokes, np.float32).reshape(-1, 6), kinds


def _extent(outline: Float64, point: Float64, way: Float64) -> tuple[float, float] | None:
    """Return where a line enters and leaves an outline, from the point along the line; None if it does not."""
    after = np.roll(outline, -1, axis=0)
    beside = (outline - point) @ np.array([-way[1], way[0]])
    beside_after = np.roll(beside, -1)
    crosses = (beside <= 0) != (beside_after <= 0)
    if not crosses.any():
        return None
    share = (beside / np.where(crosses, beside - beside_after, 1.0))[crosses]
    places = (outline[crosses] + share[:, None] * (after - outline)[crosses] - point) @ way
    return float(places.min()), float(places.max())
