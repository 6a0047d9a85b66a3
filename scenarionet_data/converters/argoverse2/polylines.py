"""Batched operations on Argoverse 2's polylines: resampling, centrelines, widths, ground height.

Lines are :class:`Ragged` with float64 points (P, 3) [m] in the city frame, with at least two points each.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.arrays.ragged import Ragged

SPACING = 2.0
"""Maximum distance between points of a derived centreline [m]. It gives as many points as the dataset's centrelines
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
    lengths: Float64 = np.add.reduceat(step, lines.offsets[:-1])
    return lengths


def between(centers: Ragged, left: Ragged, right: Ragged) -> tuple[Ragged, Ragged]:
    """Combine centrelines with their sides, point by point at the same fraction of arc length.

    Returns:
        The centrelines with the mean height of their sides, and per point the distance of the left and right
        side across the driving direction, (P, 2) [m].
    """
    positions = positions_along(centers)
    sides = points_at(left, positions), points_at(right, positions)
    points = np.column_stack([centers.values[:, :2], (sides[0][:, 2] + sides[1][:, 2]) / 2.0])
    across = _leftward(centers)
    to_left, to_right = ((side[:, :2] - points[:, :2]) * across for side in sides)
    distances = np.column_stack([to_left.sum(axis=1), -to_right.sum(axis=1)]).clip(min=0.0)
    return Ragged(centers.offsets, points), Ragged(centers.offsets, distances)


def _leftward(lines: Ragged) -> Float64:
    """(P, 2) unit normals to the left of each line, from the previous to the next point."""
    index = np.arange(len(lines.values))
    after = np.minimum(index + 1, np.repeat(lines.offsets[1:] - 1, lines.lengths))
    before = np.maximum(index - 1, np.repeat(lines.offsets[:-1], lines.lengths))
    ahead = lines.values[after, :2] - lines.values[before, :2]
    norm = np.hypot(ahead[:, 0], ahead[:, 1])
    unit: Float64 = np.column_stack([-ahead[:, 1], ahead[:, 0]]) / np.where(norm > 0, norm, 1.0)[:, None]
    return unit


def ground_height(ground: Float64, places: Float64, cell: float = 8.0) -> Float64:
    """Interpolate the height of the ground [m] at points in the plane from scattered points on it.

    Shepard's interpolation (weights 1 / distance^4) at the corners of lattice cells, bilinear within a cell: smooth
    along a path, and cheap, as points share cells. Where roads cross at different heights the result is in between.

    Args:
        ground: (G, 3) points on the ground.
        places: (Q, 2).
        cell: Size of a lattice cell [m].

    Returns:
        (Q,), to 0.1 mm of the formula: the weights are float32, for speed.
    """
    low = np.floor(places / cell)
    cells, cell_of_place = np.unique(low[:, 0] + 1.0j * low[:, 1], return_inverse=True)
    nodes, node_of_corner = np.unique(cells[:, None] + np.array([0.0, 1.0, 1.0j, 1.0 + 1.0j]), return_inverse=True)
    weights = _inverse_fourth_powers(np.stack([nodes.real, nodes.imag], axis=-1) * cell, ground[:, :2])
    lowest = ground[:, 2].min()
    # Not `@`: its threads cost more than they save, especially if workers share the processor.
    height = np.einsum("kp,p->k", weights, (ground[:, 2] - lowest).astype(np.float32)) / weights.sum(axis=1)
    corners = height[node_of_corner.reshape(-1, 4)][cell_of_place]
    u, v = (places / cell - low).T
    blend = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=-1)
    result: Float64 = (corners * blend).sum(axis=1) + lowest
    return result


def _inverse_fourth_powers(nodes: Float64, points: Float64) -> Float32:
    """(K, P) 1 / distance^4, with distances of at least 0.1 m; computed in place to save memory."""
    u, v = (nodes - points[0]).astype(np.float32), (points - points[0]).astype(np.float32)
    weights: Float32 = u[:, :1] - v[:, 0]
    np.square(weights, out=weights)
    across = u[:, 1:] - v[:, 1]
    np.square(across, out=across)
    weights += across
    np.maximum(weights, np.float32(0.01), out=weights)
    np.square(weights, out=weights)
    return np.reciprocal(weights, out=weights)
