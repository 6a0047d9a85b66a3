"""Height of the ground and edges of the road, from the points of Argoverse 2's maps in the city frame [m]."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64


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


TILE = 30.0
"""Drivable areas are cut along lines x or y = a multiple of 30 m, where two areas meet and where a log's map ends
(observed in real maps). Such a cut is not a road edge."""


def outline(points: Float64) -> Float64:
    """Return an area's outline (n, 3), open and counter-clockwise: the road is on the left of its edges."""
    ring = points[:-1] if np.array_equal(points[0], points[-1]) else points
    x, y = ring[:, 0] - ring[0, 0], ring[:, 1] - ring[0, 1]
    doubled_area = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
    return ring if doubled_area >= 0 else ring[::-1]


def road_edges(outlines: list[Float64]) -> list[list[Float64]]:
    """Find the road edges along each outline.

    Args:
        outlines: (n, 3) [m] each, open.

    Returns:
        Edges (k, 3) of each outline; an outline that is entirely an edge is closed, repeating its first point.
    """
    if not outlines:
        return []
    start = np.concatenate([ring[:, :2] for ring in outlines])
    end = np.concatenate([np.roll(ring[:, :2], -1, axis=0) for ring in outlines])
    points = np.concatenate([start, end])
    nodes = points[:, 0] + 1.0j * points[:, 1]
    code = np.unique(nodes, return_inverse=True)[1].astype(np.int64).reshape(2, -1)
    keys = code.min(axis=0) * len(nodes) + code.max(axis=0)
    _, inverse, counts = np.unique(keys, return_inverse=True, return_counts=True)
    repeated: Bool = counts[inverse] > 1
    # Segments along the border of a tile cut an area: they are no edge of the road.
    on_tile = np.abs(start - TILE * np.round(start / TILE)) < 1e-6
    kept = ~(((start == end) & on_tile).any(axis=1) | repeated)
    parts = np.split(kept, np.cumsum([len(ring) for ring in outlines])[:-1])
    return [_runs(ring, part) for ring, part in zip(outlines, parts, strict=True)]


def _runs(ring: Float64, kept: Bool) -> list[Float64]:
    """Parts of a ring with segments in ``kept``; segment i starts at point i."""
    if kept.all():
        return [np.concatenate([ring, ring[:1]])]
    shift = -int(np.argmin(kept))  # start at a segment that is not kept, so that no run wraps around
    ring, kept = np.roll(ring, shift, axis=0), np.roll(kept, shift)
    closed = np.concatenate([ring, ring[:1]])
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], kept, [False]]).astype(np.int8)))
    return [closed[first : last + 1] for first, last in bounds.reshape(-1, 2)]
