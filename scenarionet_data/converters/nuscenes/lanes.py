"""nuScenes' lanes and lane connectors: centrelines, links and dividers on their sides."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.converters.cities import complete_links
from scenarionet_data.converters.nuscenes.dividers import Divider, Point, places
from scenarionet_data.converters.nuscenes.dubins import centerlines
from scenarionet_data.converters.nuscenes.expansion import BadFeature, Expansion, LayerRecord


@dataclass(frozen=True, eq=False)
class NuScenesLane:
    """A lane or a lane connector.

    Attributes:
        id: Its token.
        layer: ``lane``, or ``lane_connector`` for a connector between lanes.
        kind: ``CAR`` or ``BIKE`` for a lane.
        center: (n, 2) [m] in driving direction; empty without centreline.
        outline: (k, 2) [m]; empty without a polygon.
        entries, exits: Ids of predecessors and successors.
        left, right: Ids of the dividers on its sides.
    """

    id: str
    layer: str
    kind: str
    center: Float64
    outline: Float64
    entries: list[str]
    exits: list[str]
    left: list[str] = field(default_factory=list)
    right: list[str] = field(default_factory=list)


def read_lanes(expansion: Expansion, dividers: list[Divider]) -> list[NuScenesLane]:
    """Return all lanes and connectors of a map, with mutual links."""
    records = [(layer, record) for layer in ("lane", "lane_connector") for record in expansion.layer(layer)]
    centers = centerlines([expansion.paths(record["token"]) for _, record in records])
    lanes = []
    for row, (layer, record) in enumerate(records):
        kind = record.get("lane_type") if layer == "lane" else None
        entries, exits = expansion.links(record["token"])
        outline = _outline(expansion, layer, record)
        lanes.append(NuScenesLane(record["token"], layer, str(kind), centers[row], outline, entries, exits))
    complete_links({lane.id: lane.entries for lane in lanes}, {lane.id: lane.exits for lane in lanes})
    _find_sides(lanes, dividers)
    return lanes


def _outline(expansion: Expansion, layer: str, record: LayerRecord) -> Float64:
    """(k, 2) outline of a lane [m], empty if it has none."""
    if record.get("polygon_token"):
        try:
            return expansion.polygon(layer, record)[0]
        except BadFeature as error:
            expansion.assume(layer, record["token"], f"{error}; the lane has no outline")
    return np.zeros((0, 2))


def _find_sides(lanes: list[NuScenesLane], dividers: list[Divider]) -> None:
    """Assign dividers to lanes: those that share at least two nodes with the lane's outline."""
    at: dict[Point, set[int]] = defaultdict(set)
    for row, divider in enumerate(dividers):
        for place in places(divider.points):
            at[place].add(row)
    for lane in lanes:
        if len(lane.center) < 2:
            continue
        corners = dict(zip(places(lane.outline), lane.outline, strict=True))
        shared = Counter(row for place in corners for row in at.get(place, ()))
        for row in sorted(row for row, count in shared.items() if count >= 2):
            touching = np.array([point for place, point in corners.items() if row in at.get(place, ())])
            side = lane.left if _is_left(lane.center, touching.mean(axis=0)) else lane.right
            side.append(dividers[row].id)


def _is_left(center: Float64, point: Float64) -> bool:
    """Whether a point is left of the nearest segment of a line."""
    middles, ahead = (center[1:] + center[:-1]) / 2.0, np.diff(center, axis=0)
    nearest = int(np.hypot(*(middles - point).T).argmin())
    across = point - middles[nearest]
    return bool(ahead[nearest, 0] * across[1] - ahead[nearest, 1] * across[0] > 0)


def neighbors(lanes: list[NuScenesLane], dividers: list[Divider]) -> dict[str, tuple[list[str], list[str]]]:
    """Left and right neighbours of each lane: of the same direction, separated by one lane divider."""
    between = {divider.id for divider in dividers if divider.is_lane_divider}
    left_of, right_of = defaultdict(list), defaultdict(list)
    for lane in lanes:
        for line in lane.right:
            left_of[line].append(lane.id)
        for line in lane.left:
            right_of[line].append(lane.id)
    return {
        lane.id: (
            list(dict.fromkeys(other for line in lane.left if line in between for other in left_of[line])),
            list(dict.fromkeys(other for line in lane.right if line in between for other in right_of[line])),
        )
        for lane in lanes
    }


def lanes_inside(lanes: list[NuScenesLane], areas: list[shapely.Polygon]) -> list[list[str]]:
    """Lanes whose midpoint is in each area."""
    drawn = [lane for lane in lanes if len(lane.center) > 1]
    return _matches(drawn, [shapely.Point(lane.center[len(lane.center) // 2]) for lane in drawn], areas)


def lanes_across(lanes: list[NuScenesLane], areas: list[shapely.Polygon]) -> list[list[str]]:
    """Lanes whose centreline crosses each area."""
    drawn = [lane for lane in lanes if len(lane.center) > 1]
    return _matches(drawn, [shapely.LineString(lane.center) for lane in drawn], areas)


def _matches(
    lanes: list[NuScenesLane], shapes: Sequence[shapely.Geometry], areas: list[shapely.Polygon]
) -> list[list[str]]:
    found: list[list[str]] = [[] for _ in areas]
    if areas:
        pairs = shapely.STRtree(shapes).query(areas, predicate="intersects")
        for area, lane in pairs[:, np.lexsort(pairs[::-1])].T:
            found[area].append(lanes[lane].id)
    return found
