"""Write a map as a SUMO net, from the roads that formats with roads share."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from xml.sax.saxutils import quoteattr

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.roads import LaneRoad, RoadNetwork, make_roads
from scenarionet_data.interchange.sumo.junctions import NetLink, NetNode, make_nodes, turns_of, write_programs
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane

_DEFAULT_SPEED = 13.89  # [m/s] of lanes without a limit: SUMO's own default
_SHORTEST = 0.1  # [m] SUMO's resolution of positions
_TOLERANCE = 0.005  # [m] by which a shape may leave its lane


@dataclass(frozen=True)
class Net:
    """A net.

    Attributes:
        text: The file.
        network: The roads behind it.
        after: Numbers of the roads that follow each road.
        lines: Centres (P, 3) [m] by road and place of the lane.
    """

    text: bytes
    network: RoadNetwork
    after: dict[int, list[int]]
    lines: dict[tuple[int, int], Float64]


def write_net(scenario: ScenarioDescription, features: MapFeatures, losses: Losses) -> Net:
    """Write the map of a scenario, in the scenario frame.

    Args:
        scenario: The scenario.
        features: Its map.
        losses: Collects what the net does not hold.

    Raises:
        InvalidScenario: It has no lanes.
    """
    network = make_roads(features, losses)
    if not network.roads:
        raise InvalidScenario(scenario.id, "map", "expected lanes, which SUMO demands, found none")
    for kind, count in zip(*np.unique(features.feature_type, return_counts=True), strict=True):
        if not is_lane(np.array([kind]))[0]:
            losses.leave_out(f"map features of type {MapFeatureType(kind).name}", int(count))
    kept = np.isin(features.feature_type, (MapFeatureType.LANE_SURFACE_STREET, MapFeatureType.LANE_BIKE_LANE))
    losses.leave_out("kinds of lanes but for bicycle lanes", int((~kept & is_lane(features.feature_type)).sum()))
    losses.leave_out("ids of lanes, which are those of roads", len(network.place_of))
    nodes = make_nodes(network)
    lines = {(road.number, place): lane_line(road, place) for road in network.roads for place in range(len(road.lanes))}
    signals, programs = write_programs(scenario, network, nodes, losses)
    points = np.concatenate([line[:, :2] for line in lines.values()])
    bounds = ",".join(f"{value:.2f}" for value in (*points.min(axis=0), *points.max(axis=0)))
    x, y, _ = scenario.origin.tolist()
    text = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<net version="1.20" junctionCornerDetail="5" limitTurnSpeed="-1.00">',
        f'<location netOffset="{-x:.2f},{-y:.2f}" convBoundary="{bounds}" origBoundary="{bounds}" projParameter="!"/>',
    ]
    roads = sorted(network.roads, key=lambda road: road.junction is None)
    ends = {number: node.name for node in nodes for number in node.incoming}
    starts = {number: node.name for node in nodes for number in node.outgoing}
    for road in roads:
        of_edge = 'function="internal"' if road.junction is not None else (
            f'from="{starts[road.number]}" to="{ends[road.number]}" priority="1"'
        )  # fmt: skip
        text.append(f'<edge id="{edge_id(road)}" {of_edge}>')
        text += [_lane(road, place, features, lines[road.number, place]) for place in reversed(range(len(road.lanes)))]
        text.append("</edge>")
    text += programs
    text += [_junction(node, network, signals) for node in nodes]
    text += [line for node in nodes for line in _connections(node, network, signals)]
    text.append("</net>\n")
    after: dict[int, list[int]] = defaultdict(list)
    for node in nodes:
        for link in node.links:
            after[link.road].append(link.other)
    return Net("\n".join(text).encode(), network, after, lines)


def edge_id(road: LaneRoad) -> str:
    """Return the id of a road's edge; those of junctions begin with a colon."""
    return f"e{road.number}" if road.junction is None else f":j{road.junction}_{road.number}"


def lane_id(road: LaneRoad, place: int) -> str:
    """Return the id of a lane, which SUMO counts from the right."""
    return f"{edge_id(road)}_{len(road.lanes) - 1 - place}"


def lane_line(road: LaneRoad, place: int) -> Float64:
    """Return the centre of a lane (P, 3) [m]."""
    samples, stations, tangents = road.curve.sample(1.0)
    offset = np.interp(stations, road.stations, road.centres[place])
    plane = samples + offset[:, None] * np.column_stack([-tangents[:, 1], tangents[:, 0]])
    points = np.column_stack([plane, np.interp(stations, road.curve.stations, road.curve.points[:, 2])])
    return np.asarray(shapely.get_coordinates(shapely.simplify(shapely.LineString(points), _TOLERANCE), include_z=True))


def lane_limit(road: LaneRoad, place: int, features: MapFeatures) -> float:
    """Return the speed limit of a lane [m/s], 50 km/h where none is known."""
    row = road.lanes[place]
    known = row >= 0 and np.isfinite(features.speed_limit[row]) and features.speed_limit[row] > 0
    return float(features.speed_limit[row]) if known else _DEFAULT_SPEED


def is_bike_lane(road: LaneRoad, place: int, features: MapFeatures) -> bool:
    """Return whether only bicycles and pedestrians may use a lane."""
    row = road.lanes[place]
    return bool(row >= 0 and features.feature_type[row] == MapFeatureType.LANE_BIKE_LANE)


def _lane(road: LaneRoad, place: int, features: MapFeatures, line: Float64) -> str:
    speed = lane_limit(road, place, features)
    allowed = ' allow="bicycle pedestrian"' if is_bike_lane(road, place, features) else ""
    width = float((road.borders[place] - road.borders[place + 1]).mean())
    length = max(float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum()), _SHORTEST)
    shape = " ".join([f"{x:.3f},{y:.3f},{z:.3f}" if z else f"{x:.3f},{y:.3f}" for x, y, z in line.tolist()])
    return (
        f'<lane id="{lane_id(road, place)}" index="{len(road.lanes) - 1 - place}" speed="{speed:.2f}" '
        f'length="{length:.2f}" width="{width:.2f}" shape="{shape}"{allowed}/>'
    )


def _junction(node: NetNode, network: RoadNetwork, signals: dict[NetLink, tuple[str, int]]) -> str:
    """A junction, in which of the links that lead to one lane the one that turns less has the right of way."""
    corners = []
    for numbers, place in ((node.incoming, -1), (node.outgoing, 0)):
        for number in numbers:
            road = network.roads[number]
            along = road.curve.tangent[place]
            across = np.array([-along[1], along[0]])
            corners += [road.curve.points[place, :2] + road.borders[side, place] * across for side in (0, -1)]
    hull = shapely.MultiPoint(np.array(corners)).convex_hull
    shape = " ".join(f"{x:.2f},{y:.2f}" for x, y in shapely.get_coordinates(hull).tolist())
    lanes = [lane_id(network.roads[number], place)
             for number in node.incoming for place in reversed(range(len(network.roads[number].lanes)))]  # fmt: skip
    inner = [lane_id(network.roads[link.via], 0) for link in node.links if link.via is not None]
    kind = (
        "dead_end" if not node.links else "traffic_light" if any(link in signals for link in node.links) else "priority"
    )
    x, y = np.mean(corners, axis=0).tolist()
    turns = np.abs(turns_of(node, network)).round(3).tolist()
    requests = []
    for index, link in enumerate(node.links):
        foes, response = "", ""
        for other_index, other in enumerate(node.links):
            is_foe = other_index != index and (link.other, link.other_lane) == (other.other, other.other_lane)
            foes += "01"[is_foe]
            response += "01"[is_foe and (turns[other_index], other_index) < (turns[index], index)]
        requests.append(f'<request index="{index}" response="{response[::-1]}" foes="{foes[::-1]}" cont="0"/>')
    return (
        f'<junction id="{node.name}" type="{kind}" x="{x:.2f}" y="{y:.2f}" incLanes="{" ".join(lanes)}" '
        f'intLanes="{" ".join(inner)}" shape="{shape}">{"".join(requests)}</junction>'
    )


def _connections(node: NetNode, network: RoadNetwork, signals: dict[NetLink, tuple[str, int]]) -> Iterator[str]:
    for link, turn in zip(node.links, turns_of(node, network), strict=True):
        road, other = network.roads[link.road], network.roads[link.other]
        direction = "s" if abs(turn) < 0.5 else "t" if abs(turn) > 2.8 else "l" if turn > 0 else "r"
        into = f'toLane="{len(other.lanes) - 1 - link.other_lane}" dir="{direction}"'
        via = "" if link.via is None else f' via="{lane_id(network.roads[link.via], 0)}"'
        light = f' tl={quoteattr(signals[link][0])} linkIndex="{signals[link][1]}"' if link in signals else ""
        yield (
            f'<connection from="{edge_id(road)}" to="{edge_id(other)}" fromLane="{len(road.lanes) - 1 - link.lane}" '
            f'{into}{via}{light} state="{"o" if light else "M"}"/>'
        )
        if link.via is not None:
            inner = edge_id(network.roads[link.via])
            yield f'<connection from="{inner}" to="{edge_id(other)}" fromLane="0" {into} state="M"/>'
