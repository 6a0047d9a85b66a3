"""Reference observations by shapely and NumPy."""

from __future__ import annotations

import numpy as np
import shapely
from shapely.affinity import rotate, translate


def box(state, world, row):
    """An object's box as a polygon."""
    length, width = state.size[world, row, :2]
    around = shapely.box(-length / 2, -width / 2, length / 2, width / 2)
    return translate(rotate(around, state.heading[world, row], (0, 0), use_radians=True), *state.position[world, row])


def others(state, world, row):
    """Rows of the other objects that are present."""
    return [n for n in np.flatnonzero(state.present[world]) if n != row]


def ray(state, world, row, angle, reach):
    """A ray of an agent at ``angle``, counter-clockwise from its heading."""
    start = state.position[world, row]
    turned = state.heading[world, row] + angle
    return shapely.LineString([start, start + reach * np.array([np.cos(turned), np.sin(turned)])])


def seen(line, shapes, reach):
    """Distance from the line's start to the first shape on it, as a fraction of ``reach``."""
    tree = shapely.STRtree(shapes)
    start = shapely.Point(line.coords[0])
    hits = [shapely.intersection(line, shapes[k]) for k in tree.query(line, predicate="intersects")]
    return min((shapely.distance(start, hit) / reach for hit in hits), default=1.0)


def in_frame(state, world, row, points):
    """Points (n, 2) in an agent's frame."""
    cos, sin = np.cos(state.heading[world, row]), np.sin(state.heading[world, row])
    return (np.asarray(points, float) - state.position[world, row]) @ np.array([[cos, -sin], [sin, cos]])
