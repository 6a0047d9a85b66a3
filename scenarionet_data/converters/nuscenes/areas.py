"""nuScenes' areas: outlines of polygons without holes, and the road edges around drivable areas.

A drivable area may cover a whole district, with every block of houses as a hole. A map feature has a single outline and
is loaded as a whole, so such areas are cut into parts.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
import shapely
from shapely.geometry.polygon import orient

from scenarionet_data.arrays.dtypes import Float64

CELL = 100.0
"""Maximum extent of a part of an area, and length of a piece of road edge [m]."""


def outlines(exterior: Float64, holes: Sequence[Float64], cell: float = CELL) -> list[Float64]:
    """Cut a polygon into parts without holes and not larger than ``cell``; return their outlines.

    Args:
        exterior: (n, 2) [m], open or closed.
        holes: Outlines of its holes.
        cell: Maximum extent of a part [m].

    Returns:
        Outlines (k, 2), open; a small polygon without holes is returned unchanged, even if invalid.
    """
    ring = _open(exterior)
    if not holes and np.ptp(ring, axis=0).max(initial=0.0) <= cell:
        return [ring]
    area = shapely.make_valid(shapely.Polygon(exterior, holes))
    parts = [part for polygon in _polygons(area) for part in _cut(polygon, cell)]
    return [_open(shapely.get_coordinates(part.exterior)) for part in parts]


def _cut(polygon: shapely.Polygon, cell: float) -> list[shapely.Polygon]:
    """Halve a polygon until no part has a hole or is too large; cuts go through holes first."""
    low_x, low_y, high_x, high_y = polygon.bounds
    if not polygon.interiors and max(high_x - low_x, high_y - low_y) <= cell:
        return [polygon]
    through = polygon.interiors[0].bounds if polygon.interiors else polygon.bounds
    if high_x - low_x > high_y - low_y:
        middle = (through[0] + through[2]) / 2.0
        halves = shapely.box(low_x, low_y, middle, high_y), shapely.box(middle, low_y, high_x, high_y)
    else:
        middle = (through[1] + through[3]) / 2.0
        halves = shapely.box(low_x, low_y, high_x, middle), shapely.box(low_x, middle, high_x, high_y)
    pieces = [piece for half in halves for piece in _polygons(shapely.intersection(polygon, half))]
    return [part for piece in pieces for part in _cut(piece, cell)]


def _polygons(geometry: shapely.Geometry) -> list[shapely.Polygon]:
    """Polygons of a geometry, which may have lines and points too if a cut is along an edge."""
    parts = shapely.get_parts(shapely.get_parts(geometry))  # nested at most once: a collection of multi-polygons
    return list(parts[(shapely.get_type_id(parts) == shapely.GeometryType.POLYGON) & (shapely.area(parts) > 0)])


def road_edges(areas: Iterable[tuple[Float64, Sequence[Float64]]], cell: float = CELL) -> list[Float64]:
    """Return road edges: the outline of the union of all drivable areas, with the road on its left.

    Args:
        areas: Exterior and holes of each polygon.
        cell: Length of a piece [m].

    Returns:
        Lines (k, 2) of about ``cell`` length; a shorter outline is closed.
    """
    valid = [shapely.make_valid(shapely.Polygon(exterior, holes)) for exterior, holes in areas]
    whole = shapely.union_all([polygon for area in valid for polygon in _polygons(area)])
    rings = [ring for p in _polygons(whole) for ring in (orient(p).exterior, *orient(p).interiors)]
    return [piece for ring in rings for piece in _pieces(shapely.get_coordinates(ring), cell)]


def _pieces(line: Float64, length: float) -> list[Float64]:
    """Cut a line at points every ``length`` or more; adjacent pieces share a point."""
    travelled = np.cumsum(np.hypot(*np.diff(line, axis=0).T))
    ends = np.flatnonzero(np.diff(np.floor(travelled / length), prepend=0.0)) + 1
    cuts = np.unique(np.concatenate([[0], ends, [len(line) - 1]]))
    return [line[first : last + 1] for first, last in pairwise(cuts)]


def _open(ring: Float64) -> Float64:
    return ring[:-1] if len(ring) > 1 and np.array_equal(ring[0], ring[-1]) else ring
