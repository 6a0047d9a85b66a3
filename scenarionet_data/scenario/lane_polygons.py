"""Outlines of lanes: the recorded ones, and buffered centrelines where a source records none."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, IntP
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.scenario.description import MapFeatures

HALF_WIDTH = 1.75
"""Distance from the centreline to either side [m] of lanes of unknown width."""

_PLAUSIBLE = (0.5, 2.75)
"""Plausible half widths [m]: where a lane has no boundary of its own, sources record 0, or the distance to a boundary
across the street."""

_MAX_MITRE = 2.0
"""Maximum mitre length at sharp corners, in half widths."""

_STEP = 5.0
_TURN = 0.02
"""Points of a centreline closer than this [m] whose heading differs by less than this [rad] are omitted from the
outline: with all recorded points it would have ten times as many and differ by less than 2 cm."""


def lane_outlines(features: MapFeatures, rows: IntP) -> Ragged:
    """Outlines (n, 2) float32 [m] of the lanes at ``rows``, implicitly closed.

    A lane without a polygon gets its centreline moved to both sides by the lane's width; one without a
    centreline of two points too gets an empty outline.
    """
    recorded = features.polygon.take(rows)
    lanes = features.polyline.take(rows)
    is_buffered = (recorded.lengths == 0) & (lanes.lengths > 1)
    made = _buffered(lanes.take(np.flatnonzero(is_buffered)), features.width.take(rows[is_buffered]))
    both = Ragged.joined([Ragged(recorded.offsets, recorded.values[:, :2]), made])
    source = np.arange(len(rows))
    source[is_buffered] = len(rows) + np.arange(len(made))
    return both.take(source)


def _buffered(lanes: Ragged, widths: Ragged) -> Ragged:
    """Outline each lane along its right side and back along its left, counter-clockwise."""
    points = lanes.values[:, :2].astype(np.float64)
    before, after = _directions(points, lanes)
    keep = _is_needed(points, before, after, lanes)
    owner = np.repeat(np.arange(len(lanes)), lanes.lengths)[keep]
    to_side = _mitres(before[keep], after[keep])
    half = _half_widths(lanes, widths)[keep]
    right, left = points[keep] - to_side * half[:, 1:], points[keep] + to_side * half[:, :1]
    lengths = np.bincount(owner, minlength=len(lanes))
    start = np.cumsum(lengths) - lengths
    place = np.arange(len(owner)) + start[owner]  # 2 start + (place within the lane)
    outline = np.empty((2 * len(owner), 2), np.float32)
    outline[place] = right
    outline[4 * start[owner] + 2 * lengths[owner] - 1 - place] = left
    return Ragged.from_flat(2 * lengths, outline)


def _directions(points: Float64, lanes: Ragged) -> tuple[Float64, Float64]:
    """Unit vectors (P, 2) along the segments before and after each point; both are the same at an end."""
    step = np.zeros_like(points)
    step[:-1] = np.diff(points, axis=0)
    step[lanes.offsets[1:] - 1] = 0.0
    length = np.hypot(step[:, 0], step[:, 1])
    after = step / np.where(length > 0, length, 1.0)[:, None]
    before = np.roll(after, 1, axis=0)  # that of the last point of the lane before is 0
    is_end, is_start = length == 0, (before[:, 0] == 0) & (before[:, 1] == 0)
    after[is_end] = before[is_end]
    before[is_start] = after[is_start]
    return before, after


def _is_needed(points: Float64, before: Float64, after: Float64, lanes: Ragged) -> Bool:
    """(P,) whether to keep each point: both ends, and one per _STEP of length or _TURN of heading."""
    cross = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
    dot = before[:, 0] * after[:, 0] + before[:, 1] * after[:, 1]
    turned = np.cumsum(np.abs(np.arctan2(cross, dot)))
    run = np.cumsum(np.hypot(*np.diff(points, axis=0, prepend=points[:1]).T))
    keep = np.diff(turned // _TURN, prepend=-1.0) > 0
    keep |= np.diff(run // _STEP, prepend=-1.0) > 0
    keep[lanes.offsets[:-1]] = True
    keep[lanes.offsets[1:] - 1] = True
    return keep


def _mitres(before: Float64, after: Float64) -> Float64:
    """(P, 2) vectors to the left, scaled so that a line offset along them keeps its distance."""
    both = before + after
    cosine = 1.0 + before[:, 0] * after[:, 0] + before[:, 1] * after[:, 1]
    direction = both / np.maximum(cosine, 2.0 / _MAX_MITRE**2)[:, None]
    return np.stack([-direction[:, 1], direction[:, 0]], axis=1)


def _half_widths(lanes: Ragged, widths: Ragged) -> Float64:
    """(P, 2) to the left and right side of every point."""
    owner = np.repeat(np.arange(len(lanes)), lanes.lengths)
    half = np.full((len(owner), 2), HALF_WIDTH)
    if len(widths.values):
        known = widths.lengths[owner]
        within = np.arange(len(owner)) - lanes.offsets[owner]
        row = widths.offsets[owner] + np.where(known == 1, 0, within)
        half[known > 0] = widths.values[row[known > 0]]
    is_plausible = (half >= _PLAUSIBLE[0]) & (half <= _PLAUSIBLE[1])
    return np.where(is_plausible, half, HALF_WIDTH)
