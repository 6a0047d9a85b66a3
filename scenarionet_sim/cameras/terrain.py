"""The ground of a world: surfaces and paint of its map in the cells of a grid."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float32, Float64, Int64, UInt8
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw.ground import fill_corners, list_strokes
from scenarionet_sim.cameras.paint import crosswalk_paint, lane_paint
from scenarionet_sim.roads.roads import Roads

CELL = 0.5
"""Side of a cell [m]; larger on maps of more than ``MAX_CELLS``."""

MAX_CELLS = 1 << 22

CLOSED_GAP = 1.0
"""Gaps between lanes narrower than twice this are road too [m]: their outlines rarely meet exactly."""

SIDEWALK_WIDTH, KERB_WIDTH = 2.4, 0.16
"""[m]."""


@dataclass(frozen=True, eq=False)
class Terrain:
    """The ground of one world.

    Attributes:
        frame: (5,) see ``cameras.draw.structures.Ground``, as the other arrays.
        corner: (C,).
        cell_start: (C + 1,) from 0.
        strokes: (K, 6).
        stroke_kind: (K,).
        road: Surface that is road, as a geometry.
        paved: Road and sidewalks.
    """

    frame: Float64
    corner: UInt8
    cell_start: Int64
    strokes: Float32
    stroke_kind: UInt8
    road: shapely.Geometry
    paved: shapely.Geometry

    @classmethod
    def of(cls, roads: Roads, *, has_sidewalks: bool) -> Terrain:
        """Build the ground of a map.

        Args:
            roads: The map; polygons that cross themselves are repaired, others without an area dropped.
            has_sidewalks: Whether roads have kerbs and sidewalks; else they have verges.
        """
        road = _surface([outline for outline, is_road in zip(_outlines(roads), roads.is_road, strict=True) if is_road])
        road = road.buffer(CLOSED_GAP, join_style="mitre").buffer(-CLOSED_GAP, join_style="mitre")
        is_crosswalk = roads.polygon_type == MapFeatureType.CROSSWALK
        crossings = [outline for outline, is_one in zip(_outlines(roads), is_crosswalk, strict=True) if is_one]
        crosswalk = _surface(crossings)
        paved = road
        parts: list[tuple[Float32, UInt8]] = [lane_paint(roads), crosswalk_paint([c for c in crossings if len(c) > 3])]
        if has_sidewalks:
            paved = road.buffer(SIDEWALK_WIDTH, quad_segs=4)
            parts.insert(0, _kerbs(road))
        strokes, kinds = [part[0] for part in parts], [part[1] for part in parts]
        borders = [(_edges(road), codes.ROAD_BORDER), (_edges(crosswalk), codes.CROSSWALK_BORDER)]
        if has_sidewalks:
            borders.append((_edges(paved), codes.SIDEWALK_BORDER))
        for edges, kind in borders:
            strokes.append(np.column_stack([edges, np.zeros((len(edges), 2))]).astype(np.float32))
            kinds.append(np.full(len(edges), kind, np.uint8))
        every, every_kind = np.concatenate(strokes), np.concatenate(kinds)
        frame = _frame(every, every_kind)
        corner = np.zeros(int(frame[3] * frame[4]), np.uint8)
        for edges, kind in borders:
            fill_corners(np.ascontiguousarray(edges.astype(np.float32).astype(np.float64)), 1 << kind, frame, corner)
        starts = np.zeros(int(frame[3] * frame[4]) + 1, np.int64)
        list_strokes(every, every_kind, frame, starts, np.zeros(0, np.int64), True)
        np.cumsum(starts, out=starts)
        items = np.empty(int(starts[-1]), np.int64)
        list_strokes(every, every_kind, frame, starts[:-1].copy(), items, False)
        corner[starts[1:] > starts[:-1]] |= codes.HAS_STROKES
        return cls(frame, corner, starts, every[items], every_kind[items], road, paved)


def _outlines(roads: Roads) -> list[Float64]:
    """Return the polygons of a map (n, 2); empty where a coordinate is unusable."""
    values, offsets = roads.polygons.values.astype(np.float64), roads.polygons.offsets
    outlines = [values[first:end] for first, end in pairwise(offsets.tolist())]
    return [outline if (np.abs(outline) < 1e6).all() else outline[:0] for outline in outlines]


def _surface(outlines: list[Float64]) -> shapely.Geometry:
    """Return the union of outlines as a valid area, which may be empty."""
    polygons = np.array([shapely.Polygon(outline) for outline in outlines if len(outline) > 2], dtype=object)
    if not len(polygons):
        return shapely.Polygon()
    repaired = shapely.make_valid(polygons)
    areas = [part for part in shapely.get_parts(repaired) if part.geom_type in ("Polygon", "MultiPolygon")]
    return shapely.union_all(areas, grid_size=0.001) if areas else shapely.Polygon()


def _edges(area: shapely.Geometry) -> Float64:
    """Return the edges (E, 4) of all rings of an area."""
    parts = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon" and not part.is_empty]
    rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(parts)] if parts else []
    edges = [np.concatenate([ring[:-1], ring[1:]], axis=1) for ring in rings]
    return np.concatenate(edges) if edges else np.zeros((0, 4))


def _kerbs(road: shapely.Geometry) -> tuple[Float32, UInt8]:
    """Return the kerbs along the outline of the road, outside of it, with the gutters inside."""
    edges = _edges(road)
    vector = edges[:, 2:] - edges[:, :2]
    length = np.hypot(vector[:, 0], vector[:, 1])
    kept = length > 1e-6
    unit = vector[kept] / length[kept, None]
    half = np.full((kept.sum(), 1), KERB_WIDTH)
    strokes = np.column_stack([edges[kept, :2], unit, length[kept], half]).astype(np.float32)
    return strokes, np.full(len(strokes), codes.KERB, np.uint8)


def _frame(strokes: Float32, kinds: UInt8) -> Float64:
    """Return the frame of the grid around all strokes."""
    if not len(strokes):
        return np.array([0.0, 0.0, CELL, 1.0, 1.0])
    is_border = kinds <= codes.CROSSWALK_BORDER
    start = strokes[:, :2].astype(np.float64)
    end = np.where(is_border[:, None], strokes[:, 2:4], start + strokes[:, 2:4] * strokes[:, 4:5])
    low, high = np.minimum(start, end).min(axis=0) - 1.0, np.maximum(start, end).max(axis=0) + 1.0
    # Corners between the millimetres that outlines lie on: no border passes through a corner.
    origin = np.floor(low) + 0.00037
    side = CELL
    while np.prod(np.ceil((high - origin) / side)) > MAX_CELLS:
        side *= 2.0
    return np.array([*origin, side, *np.ceil((high - origin) / side)])
