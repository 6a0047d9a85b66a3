"""Artists of the map: surfaces, arrows, crosswalks, lane lines in their real colours and dashes, edges."""

from __future__ import annotations

from itertools import chain

import numpy as np
from matplotlib.artist import Artist

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.plots.artists import Strokes, areas
from scenarionet_data.plots.paint import arrows, paint, zebra
from scenarionet_data.plots.palette import ARROW, EDGE, LINE, ROAD, STOP_LINE, WHITE, YELLOW
from scenarionet_data.plots.shapes import MapShapes
from scenarionet_data.scenario.vocabulary import AREAS_TO_DRIVE_ON, MapFeatureType, is_lane, is_road_edge


def map_artists(shapes: MapShapes) -> list[Artist]:
    """Return the artists of a map, for axes in metres."""
    is_road = is_lane(shapes.area_type) | np.isin(shapes.area_type, AREAS_TO_DRIVE_ON)
    is_edge, is_stop = is_road_edge(shapes.line_type), shapes.line_type == MapFeatureType.STOP_LINE
    white, yellow = painted(shapes)
    return [
        areas(_of(shapes.areas, is_road), ROAD, linewidth=0.6, zorder=1),
        areas(arrows(shapes.lanes), ARROW, zorder=1.5),
        areas(stripes(shapes), WHITE, alpha=0.85, zorder=2),
        Strokes(white, WHITE, LINE, zorder=3),
        Strokes(yellow, YELLOW, LINE, zorder=3),
        Strokes(_of(shapes.lines, is_edge), EDGE, 1.2 * LINE, zorder=4),
        Strokes(_of(shapes.lines, is_stop), WHITE, STOP_LINE, zorder=3),
    ]


def stripes(shapes: MapShapes) -> Ragged:
    """Return the outlines of the stripes of all crosswalks."""
    crosswalks = _of(shapes.areas, shapes.area_type == MapFeatureType.CROSSWALK)
    return Ragged.from_lists(list(chain.from_iterable(map(zebra, crosswalks))), width=2)


def painted(shapes: MapShapes) -> tuple[Ragged, Ragged]:
    """Return the strokes of white and yellow lines, without stop lines."""
    is_painted = ~is_road_edge(shapes.line_type) & (shapes.line_type != MapFeatureType.STOP_LINE)
    found: tuple[list[Ragged], list[Ragged]] = [], []
    for code in np.unique(shapes.line_type[is_painted]):
        kind = MapFeatureType(code)
        found["YELLOW" in kind.name].extend(paint(kind, _of(shapes.lines, shapes.line_type == code)))
    white, yellow = (Ragged.joined([Ragged.empty(0, 2), *parts]) for parts in found)
    return white, yellow


def _of(lines: Ragged, is_wanted: np.ndarray[tuple[int], np.dtype[np.bool_]]) -> Ragged:
    return lines.take(np.flatnonzero(is_wanted))
