"""nuScenes' dividers: painted lines between lanes of one direction, and between opposite directions.

A lane divider has a type for each segment (the type at a node applies up to the next node). A road divider has no
types; adjacent lanes may define them. A divider with several types is split into lines of one type.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import groupby, pairwise
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.converters.nuscenes.expansion import Expansion, LayerRecord
from scenarionet_data.converters.nuscenes.types import INEXACT_LINES, LINES, UNTYPED_DIVIDER
from scenarionet_data.scenario.vocabulary import MapFeatureType

Point = tuple[int, int]
Edge = frozenset[Point]


@dataclass(frozen=True, eq=False)
class Divider:
    """A line of one type.

    Attributes:
        id: The divider's token, with suffix ``-0``, ``-1``, ... if it was split.
        type: Its type.
        points: (n, 2) [m].
        is_lane_divider: Whether the lanes on its sides have the same direction.
        extras: Details that the type does not cover.
    """

    id: str
    type: MapFeatureType
    points: Float64
    is_lane_divider: bool
    extras: dict[str, Any]


def places(points: Float64) -> list[Point]:
    """Points rounded to millimetres: touching lanes and dividers may have different nodes at the same point."""
    return [(x, y) for x, y in np.round(points * 1000.0).astype(np.int64).tolist()]


def read_dividers(expansion: Expansion) -> list[Divider]:
    """Return all dividers of a map."""
    stated: dict[Edge, str] = {}
    for lane in expansion.layer("lane"):
        for side in ("left", "right"):
            stated.update(_typed(expansion, "lane", lane, f"{side}_lane_divider_segments"))
    found: list[Divider] = []
    for record in expansion.layer("lane_divider"):
        with expansion.dropping("lane_divider", record):
            types = dict(_typed(expansion, "lane_divider", record, "lane_divider_segments"))
            found += _lines(expansion, "lane_divider", record, types)
    for record in expansion.layer("road_divider"):
        with expansion.dropping("road_divider", record):
            found += _lines(expansion, "road_divider", record, stated)
    return found


def _typed(expansion: Expansion, layer: str, record: LayerRecord, field: str) -> list[tuple[Edge, str]]:
    """Edges and their types; a lane lists both ends of every edge, a lane divider each node once."""
    segments = record.get(field)
    spots: list[Point | None] = []
    kinds: list[str | None] = []
    for segment in segments if isinstance(segments, list) else ():
        stated = segment if isinstance(segment, dict) else {}
        place, kind = expansion.node(stated.get("node_token")), stated.get("segment_type")
        spots.append(None if place is None else (round(place[0] * 1000.0), round(place[1] * 1000.0)))
        kinds.append(kind if isinstance(kind, str) else None)
    if not isinstance(segments, list) or None in spots or None in kinds:
        expansion.assume(layer, record["token"], f"expected nodes and types in {field}, found others; left out")
    edges = zip(pairwise(spots), kinds, strict=False)
    return [
        (frozenset((start, end)), kind)
        for (start, end), kind in edges
        if start is not None and end is not None and kind is not None and start != end
    ]


def _lines(expansion: Expansion, layer: str, record: LayerRecord, types: dict[Edge, str]) -> list[Divider]:
    """Split a divider into lines of one type; none if it has no nodes."""
    points, is_lane_divider = expansion.line(layer, record), layer == "lane_divider"
    unstated = "NIL" if is_lane_divider else None
    kinds = [types.get(frozenset(edge), unstated) for edge in pairwise(places(points))]
    runs = [(kind, [index for index, _ in run]) for kind, run in groupby(enumerate(kinds), key=lambda item: item[1])]
    found = []
    for number, (kind, edges) in enumerate(runs):
        name = record["token"] if len(runs) == 1 else f"{record['token']}-{number}"
        kind_of_line, extras = _type(kind)
        found.append(Divider(name, kind_of_line, points[edges[0] : edges[-1] + 2], is_lane_divider, extras))
    return found


def _type(word: str | None) -> tuple[MapFeatureType, dict[str, Any]]:
    if word is None:
        return UNTYPED_DIVIDER, {"is_type_assumed": True}
    is_exact = word in LINES and word not in INEXACT_LINES
    return LINES.get(word, MapFeatureType.UNKNOWN_LINE), {} if is_exact else {"segment_type": word}
