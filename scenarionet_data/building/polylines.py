"""Batched operations on polylines: resampling, centrelines between two sides, widths.

Lines are :class:`Ragged` with float64 points (P, 3) [m], with at least two points each.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.ragged import Ragged

SPACING = 2.0
"""Maximum distance between points of a derived centreline [m]. It gives as many points as Argoverse 2's centrelines
have, within 12 cm of them (half within 5 mm)."""


def positions_along(lines: Ragged) -> Float64:
    """(P,) position of each point along its line: line ``i`` runs from 2 i to 2 i + 1, by arc length.

    The ranges of lines are disjoint, so that one ``np.interp`` resamples all of them.
    """
    starts, counts = lines.offsets[:-1], lines.lengths
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(lines.values[:, :2], axis=0).T))])
    travelled -= np.repeat(travelled[starts], counts)
    length = np.repeat(travelled[lines.offsets[1:] - 1], counts)
    # A line of identical points (the inside of a sharp turn) has no arc length: use point indices.
    index = (np.arange(len(travelled)) - np.repeat(starts, counts)) / np.repeat(counts - 1, counts)
    along: Float64 = np.divide(travelled, length, out=index, where=length > 0)
    along += 2.0 * np.repeat(np.arange(len(lines)), counts)
    return along


def points_at(lines: Ragged, positions: Float64) -> Float64:
    """(Q, 3) points of ``lines`` at ``positions`` (Q,) as defined by :func:`positions_along`."""
    along = positions_along(lines)
    return np.stack([np.interp(positions, along, lines.values[:, axis]) for axis in range(3)], axis=-1)


def midlines(left: Ragged, right: Ragged) -> Ragged:
    """Compute centrelines halfway between left and right sides, by arc length, with a point at least every 2 m."""
    lengths = (_line_lengths(left) + _line_lengths(right)) / 2.0
    counts = np.maximum(np.ceil(lengths / SPACING).astype(np.int64), 1) + 1
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    index = np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)
    positions = 2.0 * np.repeat(np.arange(len(left)), counts) + index / np.repeat(counts - 1, counts)
    return Ragged(offsets, (points_at(left, positions) + points_at(right, positions)) / 2.0)


def _line_lengths(lines: Ragged) -> Float64:
    step = np.hypot(*np.diff(lines.values[:, :2], axis=0, append=0.0).T)
    step[lines.offsets[1:] - 1] = 0.0
    return np.add.reduceat(step, lines.offsets[:-1])


def directions(lines: Ragged) -> Float64:
    """(P, 2) unit tangents of each line, from the previous to the next point."""
    index = np.arange(len(lines.values))
    after = np.minimum(index + 1, np.repeat(lines.offsets[1:] - 1, lines.lengths))
    before = np.maximum(index - 1, np.repeat(lines.offsets[:-1], lines.lengths))
    step = lines.values[after, :2] - lines.values[before, :2]
    norm = np.hypot(step[:, 0], step[:, 1])[:, None]
    return step / np.where(norm > 0, norm, 1.0)


def between(centers: Ragged, left: Ragged, right: Ragged) -> tuple[Ragged, Ragged]:
    """Combine centrelines with their sides, point by point at the same fraction of arc length.

    Returns:
        The centrelines with the mean height of their sides, and per point the distance of the left and right
        side across the driving direction, (P, 2) [m].
    """
    positions = positions_along(centers)
    sides = points_at(left, positions), points_at(right, positions)
    points = np.column_stack([centers.values[:, :2], (sides[0][:, 2] + sides[1][:, 2]) / 2.0])
    ahead = directions(centers)
    across = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    to_left, to_right = ((side[:, :2] - points[:, :2]) * across for side in sides)
    distances = np.column_stack([to_left.sum(axis=1), -to_right.sum(axis=1)]).clip(min=0.0)
    return Ragged(centers.offsets, points), Ragged(centers.offsets, distances)
