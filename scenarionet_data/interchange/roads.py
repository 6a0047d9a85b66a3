"""From a lane graph to roads: the step that formats with roads share.

Lanes that lie beside each other from start to end become one road; every other lane is a road of its own. Where
several roads meet, or lanes do not continue one to one, a junction has one short connection for each link.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.curves import Curve, distinct, fit, joining, trimmed
from scenarionet_data.interchange.lane_graph import Sides, is_beside, read_lanes
from scenarionet_data.scenario.description import MapFeatures

_TRIM = 0.05  # [m] that roads end before a junction, to leave room for its connections
_AHEAD = 0.6  # [m] by which a lane may begin behind the road or end before it
_STEP = 1.0  # [m] between the places at which lanes are measured
_FINE = 0.2  # [m] between the points at which deviations are measured
_DEVIATION = 0.03  # [m] of the centre of a parallel lane from the recorded one
_NOTICED = 0.001  # [m] deviations that are reported
_SHORTEST = 0.005  # [m] of a connection
_GAP = 0.005  # [m] of borders up to which a road continues in the next without a connection
_NARROWEST = 0.1  # [m]


@dataclass
class LaneRoad:
    """A road: parallel lanes from left to right, along the centre of the leftmost one.

    Attributes:
        number: Its number in the network, from 0.
        lanes: Rows of the map.
        curve: The centre of the leftmost lane.
        stations: (S,) places [m] along the curve at which the lanes are measured.
        centres: (L, S) distance of each lane's centre to the left of the curve [m]; 0 for the first.
        borders: (L + 1, S) the same of their borders.
        junction: Junction it connects roads in; None for other roads.
        start, end: What it begins and ends at.
    """

    number: int
    lanes: tuple[int, ...]
    curve: Curve
    stations: Float64
    centres: Float64
    borders: Float64
    junction: int | None = None
    start: End = field(default_factory=lambda: End())
    end: End = field(default_factory=lambda: End())


@dataclass
class End:
    """What a road begins or ends at: nothing, another road, or a junction.

    Attributes:
        road: Number of the road that continues this one without a connection.
        junction: Number of the junction.
        lanes: Place of the lane that continues each lane, from left to right.
    """

    road: int | None = None
    junction: int | None = None
    lanes: tuple[int, ...] = ()


@dataclass(frozen=True)
class Connection:
    """A link through a junction: from a lane of a road, along a road of the junction, to a lane of another.

    Attributes:
        junction: Number of the junction.
        joint: The link.
        road: Number of the connecting road.
    """

    junction: int
    joint: Joint
    road: int


@dataclass(frozen=True)
class RoadNetwork:
    """The roads of a map.

    Attributes:
        roads: All roads; those of junctions follow the others.
        place_of: Number of the road and place of the lane for each row of the map that is a lane.
        connections: Links through junctions.
        num_junctions: Number of junctions.
    """

    roads: list[LaneRoad]
    place_of: dict[int, tuple[int, int]]
    connections: list[Connection]
    num_junctions: int


def make_roads(features: MapFeatures, losses: Losses) -> RoadNetwork:
    """Make roads of the lanes of a map.

    Args:
        features: The map.
        losses: Collects lanes that are no lines, and links that lead out of the map.
    """
    graph = read_lanes(features, losses)
    lines, widths = graph.lines, graph.sides

    @cache
    def curve_of(row: int) -> Curve:
        return fit(lines[row])

    groups = [
        part
        for group in _parallel(features, lines, graph.row_of)
        for part in ([group] if _is_measurable(group, lines, widths, curve_of) else [(row,) for row in group])
    ]
    place_of = {row: (number, place) for number, group in enumerate(groups) for place, row in enumerate(group)}
    joints = [Joint(*place_of[row], *place_of[other]) for row, other in graph.links]
    nodes = _nodes(joints)
    roads = [_fit_road(number, group, lines, widths, curve_of(group[0])) for number, group in enumerate(groups)]
    going_on = {node for node, found in nodes.items() if _goes_on(found, roads)}
    trims = dict.fromkeys(range(len(roads)), (0.0, 0.0))
    for node, found in nodes.items():
        for joint in found if node not in going_on else ():
            trims[joint.road] = trims[joint.road][0], _TRIM
            trims[joint.other] = _TRIM, trims[joint.other][1]
    for number, trim in trims.items():
        if any(trim):
            curve = fit(distinct(trimmed(lines[groups[number][0]], *trim)))
            roads[number] = _fit_road(number, groups[number], lines, widths, curve)
    _report(roads, lines, widths, losses)
    connections: list[Connection] = []
    num_junctions = 0
    for node, found in nodes.items():
        if node in going_on:
            first, second = roads[found[0].road], roads[found[0].other]
            first.end = End(road=second.number, lanes=tuple(joint.other_lane for joint in found))
            second.start = End(road=first.number, lanes=tuple(joint.lane for joint in found))
            continue
        for joint in found:
            roads[joint.road].end = roads[joint.other].start = End(junction=num_junctions)
            connections.append(Connection(num_junctions, joint, len(roads)))
            roads.append(_connecting(len(roads), num_junctions, roads, joint))
        num_junctions += 1
    return RoadNetwork(roads, place_of, connections, num_junctions)


class Joint(NamedTuple):
    """A link: the end of a lane of a road, and the start of a lane of another."""

    road: int
    lane: int
    other: int
    other_lane: int


def _parallel(features: MapFeatures, lines: dict[int, Float64], row_of: dict[str, int]) -> list[tuple[int, ...]]:
    """Groups of lanes that begin and end beside each other, from left to right."""
    right_of: dict[int, int] = {}
    for row, line in lines.items():
        beside = [row_of[other] for other in features.right_neighbors[row] if other in row_of]
        fitting = [other for other in beside if other != row and is_beside(line, lines[other])]
        if len(fitting) == 1:
            right_of[row] = fitting[0]
    left_of: dict[int, int] = {}
    for row, other in list(right_of.items()):
        if other in left_of or right_of.get(other) == row:
            del right_of[row]
        else:
            left_of[other] = row
    groups, seen = [], set[int]()
    for row in lines:
        if row in seen or row in left_of:
            continue
        group = [row]
        while group[-1] in right_of and right_of[group[-1]] not in group:
            group.append(right_of[group[-1]])
        seen.update(group)
        groups.append(tuple(group))
    groups += [(row,) for row in lines if row not in seen]
    return groups


def _nodes(joints: list[Joint]) -> dict[int, list[Joint]]:
    """Group joints by the place where their roads meet."""
    parent: dict[tuple[int, bool], tuple[int, bool]] = {}

    def find(key: tuple[int, bool]) -> tuple[int, bool]:
        parent.setdefault(key, key)
        while parent[key] != key:
            parent[key] = parent[parent[key]]
            key = parent[key]
        return key

    for joint in joints:
        parent[find((joint.road, True))] = find((joint.other, False))
    numbers: dict[tuple[int, bool], int] = {}
    nodes: dict[int, list[Joint]] = {}
    for joint in joints:
        nodes.setdefault(numbers.setdefault(find((joint.road, True)), len(numbers)), []).append(joint)
    return {node: sorted(found) for node, found in nodes.items()}


def _goes_on(found: list[Joint], roads: list[LaneRoad]) -> bool:
    """Whether the joints of a node are those of two roads of equally many lanes, one continuing the other smoothly."""
    first, second = roads[found[0].road], roads[found[0].other]
    lanes = range(len(first.lanes))
    if first is second or found != [Joint(first.number, lane, second.number, lane) for lane in lanes]:
        return False
    gap = _borders_at(first, -1) - _borders_at(second, 0) if len(second.lanes) == len(lanes) else np.inf
    return bool(np.abs(gap).max() < _GAP)


def _borders_at(road: LaneRoad, place: int) -> Float64:
    """Points (L + 1, 2) of the borders of lanes at the start or end of a road [m]."""
    along = road.curve.tangent[place]
    points: Float64 = road.curve.points[place, :2] + road.borders[:, place, None] * np.array([-along[1], along[0]])
    return points


def _is_measurable(
    group: tuple[int, ...], lines: dict[int, Float64], widths: dict[int, Sides], curve_of: Callable[[int], Curve]
) -> bool:
    """Whether all lanes of a group can be measured across the first, and none is narrower than 0.1 m."""
    if len(group) == 1:
        return True
    curve = curve_of(group[0])
    if any(_offsets(curve, lines[row][:, :2]) is None for row in group[1:]):
        return False
    road = _fit_road(0, group, lines, widths, curve)
    if (np.diff(-road.borders, axis=0) < _NARROWEST).any():
        return False
    return all(_deviation(road, place, lines[row]) < _DEVIATION for place, row in enumerate(group[1:], start=1))


def _deviation(road: LaneRoad, place: int, line: Float64) -> float:
    """The largest distance of the inner points of a lane's centre from the lane of the road [m]."""
    samples, stations, tangents = road.curve.sample(_FINE)
    offset = np.interp(stations, road.stations, road.centres[place])
    drawn = samples + offset[:, None] * np.stack([-tangents[:, 1], tangents[:, 0]], axis=1)
    inner = shapely.points(line[1:-1, :2])
    return float(shapely.distance(inner, shapely.LineString(drawn)).max(initial=0.0))


def _fit_road(
    number: int,
    group: tuple[int, ...],
    lines: dict[int, Float64],
    widths: dict[int, Sides],
    curve: Curve,
) -> LaneRoad:
    """Measure the lanes of a group across a curve along the first one."""
    stations = curve.sample(_STEP)[1]
    centres = np.zeros((len(group), len(stations)))
    for place, row in enumerate(group[1:], start=1):
        offsets = _offsets(curve, lines[row][:, :2])
        if offsets is None:
            raise ValueError(f"lane {row} does not lie beside lane {group[0]}")
        centres[place] = offsets
    half = 0.5 * np.interp(stations / stations[-1], *_whole_width(widths[group[0]]))
    borders = np.stack([half, -half, *np.zeros((len(group) - 1, len(stations)))])
    for place in range(1, len(group)):
        borders[place + 1] = 2.0 * centres[place] - borders[place]
    return LaneRoad(number, group, curve, stations, centres, borders)


def _whole_width(sides: Sides) -> tuple[Float64, Float64]:
    """Shares of a lane's length, and its width there."""
    return sides.shares, sides.left + sides.right


def _offsets(curve: Curve, line: Float64) -> Float64 | None:
    """Distances to the left at which the normals of a curve cross a line; None if one does not.

    Args:
        curve: The curve, with S samples.
        line: (P, 2).
    """
    samples, _, tangents = curve.sample(_STEP)
    towards = line[None] - samples[:, None]
    ahead = np.einsum("spk,sk->sp", towards, tangents)
    beside = np.einsum("spk,sk->sp", towards, np.stack([-tangents[:, 1], tangents[:, 0]], axis=1))
    found = np.empty(len(samples))
    for row in range(len(samples)):
        crossing = np.flatnonzero((ahead[row, :-1] <= 0.0) & (ahead[row, 1:] > 0.0))
        if len(crossing):
            first = crossing[np.argmin(np.abs(beside[row, crossing]))]
            part = -ahead[row, first] / (ahead[row, first + 1] - ahead[row, first])
            found[row] = beside[row, first] + part * (beside[row, first + 1] - beside[row, first])
        else:  # before the line begins, or behind its end
            end = 0 if abs(ahead[row, 0]) < abs(ahead[row, -1]) else -1
            if abs(ahead[row, end]) > _AHEAD + 2.0 * _TRIM:
                return None
            found[row] = beside[row, end]
    return found if (found < 0.0).all() else None


def _report(roads: list[LaneRoad], lines: dict[int, Float64], widths: dict[int, Sides], losses: Losses) -> None:
    """Measure how far the lanes of roads are from those of the map."""
    for road in roads:
        for place, row in enumerate(road.lanes):
            deviation = _deviation(road, place, lines[row])
            losses.approximate("lane centres", int(deviation > _NOTICED), deviation, "m")
            off_centre = float(np.abs(widths[row].left - widths[row].right).max())
            losses.approximate(
                "lanes whose centre is not in the middle", int(off_centre > _NOTICED), 0.5 * off_centre, "m"
            )
            drawn_width = road.borders[place] - road.borders[place + 1]
            wanted = np.interp(road.stations / road.stations[-1], *_whole_width(widths[row]))
            off = float(np.abs(drawn_width - wanted).max())
            losses.approximate("widths of lanes", int(off > _NOTICED), off, "m")


def _connecting(number: int, junction: int, roads: list[LaneRoad], joint: Joint) -> LaneRoad:
    """The road from the end of a lane to the start of another, as wide as these at its ends."""
    first, second = roads[joint.road], roads[joint.other]
    begin, begin_along = lane_end(first, joint.lane, -1)
    end, end_along = lane_end(second, joint.other_lane, 0)
    reach = float(np.hypot(*(end - begin)[:2]))
    if reach < _SHORTEST:  # lanes that overlap: a connection needs a length
        end = end + np.append(_SHORTEST * end_along, 0.0)
        reach = _SHORTEST
    curve = joining(begin, begin_along, end, end_along)
    wide = np.array([lane_width(first, joint.lane, -1), lane_width(second, joint.other_lane, 0)])
    borders = np.stack([0.5 * wide, -0.5 * wide])
    return LaneRoad(
        number, (-1,), curve, np.array([0.0, curve.length]), np.zeros((1, 2)), borders, junction,
        End(road=first.number, lanes=(joint.lane,)), End(road=second.number, lanes=(joint.other_lane,)),
    )  # fmt: skip


def lane_end(road: LaneRoad, lane: int, place: int) -> tuple[Float64, Float64]:
    """Return the centre (3,) [m] and direction (2,) of a lane at the start (``place=0``) or end (``-1``) of a road."""
    along = road.curve.tangent[place]
    point = road.curve.points[place].copy()
    point[:2] += road.centres[lane, place] * np.array([-along[1], along[0]])
    return point, along


def lane_width(road: LaneRoad, lane: int, place: int) -> float:
    """Return the width of a lane [m] at one of the stations of a road."""
    return float(road.borders[lane, place] - road.borders[lane + 1, place])
