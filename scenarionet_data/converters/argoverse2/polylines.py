"""Arithmetic on many polylines at once, for Argoverse 2's lanes: resampling, centrelines, widths, the ground.

Lines are :class:`Ragged` with float64 points (P, 3) [m] in the city frame, each of two points or more.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.arrays.ragged import Ragged

SPACING = 2.0
"""Largest distance [m] between points of a derived centreline. With this, its points are as many as those of the
dataset's own centrelines, and lie within 12 cm of them (half of them within 5 mm)."""


def positions_along(lines: Ragged) -> Float64:
    """(P,) how far each point lies along its line: line ``i`` runs from 2 i to 2 i + 1, by arc length.

    The lines' ranges do not touch, so that one ``np.interp`` serves all of them.
    """
    starts, counts = lines.offsets[:-1], lines.lengths
    travelled = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(lines.values[:, :2], axis=0).T))])
    travelled -= np.repeat(travelled[starts], counts)
    length = np.repeat(travelled[lines.offsets[1:] - 1], counts)
    # A line that stays in one point (the inside of a sharp turn) has no arc length: its points count instead.
    index = (np.arange(len(travelled)) - np.repeat(starts, counts)) / np.repeat(counts - 1, counts)
    along: Float64 = np.divide(travelled, length, out=index, where=length > 0)
    along += 2.0 * np.repeat(np.arange(len(lines)), counts)
    return along


def points_at(lines: Ragged, positions: Float64) -> Float64:
    """(Q, 3) points of ``lines`` at ``positions`` (Q,) in the measure of :func:`positions_along`."""
    along = positions_along(lines)
    return np.stack([np.interp(positions, along, lines.values[:, axis]) for axis in range(3)], axis=-1)


def midlines(left: Ragged, right: Ragged) -> Ragged:
    """Lines halfway between left and right sides, by arc length, with a point every 2 m or less."""
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
    """Centrelines seen with their sides, each point with those at the same fraction of arc length.

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
    """(P, 2) unit vectors to the left of each line, across the step from the point before to the one after."""
    index = np.arange(len(lines.values))
    after = np.minimum(index + 1, np.repeat(lines.offsets[1:] - 1, lines.lengths))
    before = np.maximum(index - 1, np.repeat(lines.offsets[:-1], lines.lengths))
    ahead = lines.values[after, :2] - lines.values[before, :2]
    norm = np.hypot(ahead[:, 0], ahead[:, 1])
    unit: Float64 = np.column_stack([-ahead[:, 1], ahead[:, 0]]) / np.where(norm > 0, norm, 1.0)[:, None]
    return unit


def ground_height(ground: Float64, places: Float64, cell: float = 8.0) -> Float64:
    """Height [m] of the ground at places in the plane, from scattered points on it.

    Shepard's interpolation (weights 1 / distance^4) at the corners of the lattice cells that hold a place, and
    bilinear inside a cell: smooth along a path, and cheap, as places share cells. Where roads cross
    above each other the result lies between them.

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
    # Not `@`: its threads cost more than they save here, much more when workers share the processor.
    height = np.einsum("kp,p->k", weights, (ground[:, 2] - lowest).astype(np.float32)) / weights.sum(axis=1)
    corners = height[node_of_corner.reshape(-1, 4)][cell_of_place]
    u, v = (places / cell - low).T
    blend = np.stack([(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v], axis=-1)
    result: Float64 = (corners * blend).sum(axis=1) + lowest
    return result


def _inverse_fourth_powers(nodes: Float64, points: Float64) -> Float32:
    """(K, P) 1 / distance^4, with distances of 0.1 m at least; in place, as the array is the cost."""
    u, v = (nodes - points[0]).astype(np.float32), (points - points[0]).astype(np.float32)
    weights: Float32 = u[:, :1] - v[:, 0]
    np.square(weights, out=weights)
    across = u[:, 1:] - v[:, 1]
    np.square(across, out=across)
    weights += across
    np.maximum(weights, np.float32(0.01), out=weights)
    np.square(weights, out=weights)
    return np.reciprocal(weights, out=weights)
