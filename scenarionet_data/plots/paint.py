"""Geometry of road markings in metres: dashes, double lines, zebra stripes and arrows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.plots.palette import ARROW_EVERY, DASH, GAP, LINE, STRIPE
from scenarionet_data.scenario.vocabulary import MapFeatureType


class PaintStroke(NamedTuple):
    """One painted stroke: lateral offset to the left of the recorded line [m], and whether it is broken."""

    left: float
    is_broken: bool


_SINGLE = {False: (PaintStroke(0.0, False),), True: (PaintStroke(0.0, True),)}
_STROKES = {
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE: _SINGLE[True],
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_YELLOW: _SINGLE[True],
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE: (PaintStroke(LINE, False), PaintStroke(-LINE, False)),
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW: (PaintStroke(LINE, False), PaintStroke(-LINE, False)),
    MapFeatureType.ROAD_LINE_BROKEN_DOUBLE_YELLOW: (PaintStroke(LINE, True), PaintStroke(-LINE, True)),
    MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW: (PaintStroke(LINE, False), PaintStroke(-LINE, True)),
}
"""Strokes of each line type; other types are a single solid stroke."""

_LEAST_LANE = 12.0
"""Minimum length of a lane with an arrow [m]."""

_STRAIGHT = 0.97
"""A lane counts as a turn if the distance of its ends is below this share of its length."""


def paint(feature_type: MapFeatureType, lines: Ragged) -> list[Ragged]:
    """Return the painted strokes (n, 2) [m] along lines of one type."""
    strokes = []
    for stroke in _STROKES.get(feature_type, _SINGLE[False]):
        moved = beside(lines, stroke.left) if stroke.left else lines
        strokes.append(dashes(moved) if stroke.is_broken else moved)
    return strokes


def beside(lines: Ragged, left: float) -> Ragged:
    """Return lines (n, 2) shifted to the left [m]."""
    points, offsets = lines.values.astype(np.float64), lines.offsets
    step = np.zeros_like(points)
    step[:-1] = np.diff(points, axis=0)
    filled = lines.lengths > 0
    step[offsets[1:][filled] - 1] = 0.0
    before = np.roll(step, 1, axis=0)  # the first point of a line sees the last step of the previous line: 0
    along = before + step
    length = np.hypot(along[:, 0], along[:, 1])
    along = along / np.where(length > 0, length, 1.0)[:, None]
    return Ragged(offsets, points + left * np.stack([-along[:, 1], along[:, 0]], axis=1))


def dashes(lines: Ragged) -> Ragged:
    """Cut lines (n, 2) into dashes of fixed length in metres, independent of the visible part."""
    lines = lines.take(np.flatnonzero(lines.lengths > 1))
    if not len(lines):
        return Ragged(np.zeros(1, np.int32), np.zeros((0, 2)))
    points, period = lines.values.astype(np.float64), DASH + GAP
    arc, length, first = _arcs(points, lines)
    count = np.ceil(length / period).astype(np.int64)
    line = np.repeat(np.arange(len(lines)), count)
    number = np.arange(count.sum())
    begin = (number - np.repeat(np.cumsum(count) - count, count)) * period
    end = np.minimum(begin + DASH, length[line])
    owner = np.repeat(np.arange(len(lines)), lines.lengths)
    inner = np.flatnonzero((arc % period > 0) & (arc % period < DASH) & (arc < length[owner]))
    dash = (np.cumsum(count) - count)[owner[inner]] + (arc[inner] // period).astype(np.int64)
    which = np.concatenate([number, number, dash])
    at = np.concatenate([begin, end, arc[inner]])
    order = np.lexsort([at, which])
    walked = first + arc
    ends = _along(points, walked, np.concatenate([begin, end]) + np.tile(first[lines.offsets[:-1]][line], 2))
    return Ragged.from_flat(np.bincount(which, minlength=len(number)), np.concatenate([ends, points[inner]])[order])


def arrows(lanes: Ragged) -> Ragged:
    """Return triangles (3, 2) [m] along lanes in driving direction.

    Short lanes get one in the middle, longer ones several at equal distances. Very short lanes and turns, which cross
    other lanes, get none.
    """
    lanes = lanes.take(np.flatnonzero(lanes.lengths > 1))
    if not len(lanes):
        return Ragged(np.zeros(1, np.int32), np.zeros((0, 2)))
    points = lanes.values.astype(np.float64)
    arc, length, first = _arcs(points, lanes)
    straight = np.hypot(*(points[lanes.offsets[1:] - 1] - points[lanes.offsets[:-1]]).T)
    has_some = (length > _LEAST_LANE) & (straight > _STRAIGHT * length)
    count = np.where(has_some, np.maximum(length // ARROW_EVERY, 1), 0).astype(np.int64)
    lane = np.repeat(np.arange(len(lanes)), count)
    number = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    middle = first[lanes.offsets[:-1]][lane] + (number + 0.5) * (length[lane] / count[lane])
    walked = first + arc
    back, tip = (_along(points, walked, middle + shift) for shift in (-1.0, 1.0))
    side = 0.22 * np.stack([-(tip - back)[:, 1], (tip - back)[:, 0]], axis=1)
    triangles = np.stack([tip, back + side, back - side], axis=1)
    return Ragged.from_flat(np.full(len(triangles), 3), triangles.reshape(-1, 2))


def _arcs(points: Float64, lines: Ragged) -> tuple[Float64, Float64, Float64]:
    """Arc length of each point (P,), lengths of the lines (K,) and start of each point's line (P,), in metres.

    The starts refer to all lines laid end to end with gaps of 1 m.
    """
    step = np.hypot(*np.diff(points, axis=0, prepend=points[:1]).T)
    step[lines.offsets[1:-1]] = 1.0
    walked = np.cumsum(step)
    start = np.repeat(walked[lines.offsets[:-1]], lines.lengths)
    arc = walked - start
    return arc, arc[lines.offsets[1:] - 1], start


def _along(points: Float64, walked: Float64, places: Float64) -> Float64:
    return np.stack([np.interp(places, walked, points[:, axis]) for axis in (0, 1)], axis=1)


def zebra(outline: Float64) -> list[Float64]:
    """Return the stripes (n, 2) [m] of a crosswalk, along the direction of the crossing traffic."""
    area = shapely.Polygon(outline)
    frame = shapely.minimum_rotated_rectangle(area)
    if not isinstance(frame, shapely.Polygon) or not area.is_valid:
        return [outline]
    corners = shapely.get_coordinates(frame)[:4]
    sides = np.diff(corners[:3], axis=0)
    lengths = np.hypot(*sides.T)
    along, across = (sides[0], sides[1]) if lengths[0] >= lengths[1] else (sides[1], -sides[0])
    start = corners[0] if lengths[0] >= lengths[1] else corners[1]
    share = np.arange(STRIPE / 2, lengths.max(), 2 * STRIPE)[:, None, None] / lengths.max()
    end = np.minimum(share + STRIPE / lengths.max(), 1.0)
    quads = np.concatenate([share, end, end, share], axis=1) * along + start
    quads[:, 2:] += across
    parts = shapely.get_parts(shapely.intersection(shapely.polygons(quads), area))
    return [shapely.get_coordinates(part) for part in parts if part.area > 0]
