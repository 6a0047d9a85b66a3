"""The map in a picture: surfaces, crosswalks, lines in their true colours and dashes, edges."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection

from scenarionet_data.vocabulary import MapFeatureType, is_road_edge
from scenarionet_sim.render.palette import DASH, EDGE, GAP, LINE, ROAD, STOP_LINE, STRIPE, WHITE, YELLOW
from scenarionet_sim.roads.roads import Roads

Points = npt.NDArray[np.float64]


class Stroke(NamedTuple):
    """One line of paint: how far to the left of the recorded line [m], and whether it is broken."""

    left: float
    is_broken: bool


_EDGES = frozenset(kind for kind in MapFeatureType if is_road_edge(np.array(kind, np.uint8)))
_SINGLE = {False: (Stroke(0.0, False),), True: (Stroke(0.0, True),)}
_STROKES = {
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE: _SINGLE[True],
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_YELLOW: _SINGLE[True],
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE: (Stroke(LINE, False), Stroke(-LINE, False)),
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW: (Stroke(LINE, False), Stroke(-LINE, False)),
    MapFeatureType.ROAD_LINE_BROKEN_DOUBLE_YELLOW: (Stroke(LINE, True), Stroke(-LINE, True)),
    MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW: (Stroke(LINE, False), Stroke(-LINE, True)),
}
"""What is painted for a line; one solid stroke for every other."""


def draw_map(axes: Axes, roads: Roads, points_per_metre: float) -> None:
    """Add a map to axes whose data are metres.

    Args:
        axes: Where to.
        roads: The map.
        points_per_metre: How long a metre is on paper [1/72 inch].
    """
    surfaces = [outline for outline, is_road in zip(roads.polygons, roads.is_road, strict=True) if is_road]
    axes.add_collection(PolyCollection(_drawable(surfaces), facecolor=ROAD, edgecolor=ROAD, linewidth=0.6, zorder=1))
    crosswalks = roads.polygons.take(np.flatnonzero(roads.polygon_type == MapFeatureType.CROSSWALK))
    stripes = [stripe for outline in _drawable(crosswalks) for stripe in zebra(outline)]
    axes.add_collection(PolyCollection(stripes, facecolor=WHITE, alpha=0.85, linewidth=0, zorder=2))
    lines: dict[str, list[Points]] = {WHITE: [], YELLOW: [], EDGE: [], "stop": []}
    for feature_type, line in lines_of(roads):
        if feature_type == MapFeatureType.STOP_LINE:
            lines["stop"].append(line)
        elif feature_type in _EDGES:
            lines[EDGE].append(line)
        else:
            lines[YELLOW if "YELLOW" in feature_type.name else WHITE] += paint(feature_type, line)
    for color, width, order in ((WHITE, LINE, 3), (YELLOW, LINE, 3), (EDGE, 1.2 * LINE, 4)):
        _add_lines(axes, lines[color], color, width * points_per_metre, order)
    _add_lines(axes, lines["stop"], WHITE, STOP_LINE * points_per_metre, 3)


def lines_of(roads: Roads) -> Iterator[tuple[MapFeatureType, Points]]:
    """Type and points (n, 2) [m] of every line of a map, put together again from its segments."""
    segments = roads.segments.astype(np.float64)
    if not len(segments):
        return
    is_new = np.ones(len(segments), np.bool_)
    is_new[1:] = (np.diff(roads.segment_feature) != 0) | (segments[1:, :2] != segments[:-1, 2:]).any(axis=1)
    starts = np.flatnonzero(is_new)
    for start, piece in zip(starts, np.split(segments, starts[1:]), strict=True):
        yield MapFeatureType(roads.segment_type[start]), np.concatenate([piece[:, :2], piece[-1:, 2:]])


def paint(feature_type: MapFeatureType, line: Points) -> list[Points]:
    """The strokes of paint (n, 2) [m] along a line."""
    strokes: list[Points] = []
    for stroke in _STROKES.get(feature_type, _SINGLE[False]):
        moved = beside(line, stroke.left) if stroke.left else line
        strokes += dashes(moved) if stroke.is_broken else [moved]
    return strokes


def beside(line: Points, left: float) -> Points:
    """A line (n, 2) moved to its left [m]."""
    along = np.gradient(line, axis=0)
    length = np.hypot(along[:, 0], along[:, 1])
    along = along / np.where(length > 0, length, 1.0)[:, None]
    return line + left * np.stack([-along[:, 1], along[:, 0]], axis=1)


def dashes(line: Points) -> list[Points]:
    """A line (n, 2) cut into dashes, in metres, so that they do not depend on what part of it is drawn."""
    arcs = np.append(0.0, np.cumsum(np.hypot(*np.diff(line, axis=0).T)))
    begin = np.arange(0.0, arcs[-1], DASH + GAP)
    cuts = np.union1d(arcs, np.concatenate([begin, np.minimum(begin + DASH, arcs[-1])]))
    points = np.stack([np.interp(cuts, arcs, line[:, axis]) for axis in (0, 1)], axis=1)
    is_painted = (cuts[:-1] + cuts[1:]) / 2 % (DASH + GAP) < DASH
    ends = np.flatnonzero(np.diff(is_painted.astype(np.int8), prepend=0, append=0))
    return [points[first : end + 1] for first, end in ends.reshape(-1, 2)]


def zebra(outline: Points) -> list[Points]:
    """Stripes (n, 2) [m] across a crosswalk, in the direction of the traffic that it stops."""
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


def _drawable(outlines: Iterable[Points]) -> list[Points]:
    return [outline for outline in outlines if len(outline) > 2]


def _add_lines(axes: Axes, lines: list[Points], color: str, width: float, order: int) -> None:
    width = max(width, 0.5)  # thinner lines fade away
    axes.add_collection(LineCollection(lines, colors=color, linewidths=width, capstyle="butt", zorder=order))
