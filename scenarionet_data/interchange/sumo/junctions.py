"""The junctions of a SUMO net: where roads meet, continue and end, and their traffic lights."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.roads import RoadNetwork
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightColor

_COLORS = {LightColor.RED: "r", LightColor.YELLOW: "y", LightColor.GREEN: "G", LightColor.UNKNOWN: "O"}


@dataclass(frozen=True)
class NetLink:
    """A link between lanes: places count from the left, numbers of roads are those of the network."""

    road: int
    lane: int
    other: int
    other_lane: int
    via: int | None


@dataclass(eq=False)
class NetNode:
    """A junction of a net.

    Attributes:
        name: Its id.
        incoming, outgoing: Numbers of roads.
        links: From the lanes of incoming roads, in SUMO's order: lane by lane, from the right.
    """

    name: str
    incoming: list[int] = field(default_factory=list)
    outgoing: list[int] = field(default_factory=list)
    links: list[NetLink] = field(default_factory=list)


def make_nodes(network: RoadNetwork) -> list[NetNode]:
    """Return the junctions: those of the network, where one road continues another, and ends."""
    nodes: dict[str, NetNode] = {}
    for road in network.roads:
        if road.junction is not None:
            continue
        begin = f"j{road.start.junction}" if road.start.junction is not None else f"c{road.start.road}"
        begin = f"s{road.number}" if road.start.junction is None and road.start.road is None else begin
        end = f"j{road.end.junction}" if road.end.junction is not None else f"c{road.number}"
        nodes.setdefault(begin, NetNode(begin)).outgoing.append(road.number)
        nodes.setdefault(end, NetNode(end)).incoming.append(road.number)
        if road.end.road is not None:
            nodes[end].links += [
                NetLink(road.number, lane, road.end.road, other, None) for lane, other in enumerate(road.end.lanes)
            ]
    for each in network.connections:
        nodes[f"j{each.junction}"].links.append(NetLink(*each.joint, each.road))
    for node in nodes.values():
        node.links.sort(key=lambda link: (node.incoming.index(link.road), -link.lane, link.other, -link.other_lane))
    return list(nodes.values())


def turns_of(node: NetNode, network: RoadNetwork) -> list[float]:
    """Return the angle by which each link turns to the left [rad]."""
    turns = []
    for link in node.links:
        before, after = network.roads[link.road].curve.tangent[-1], network.roads[link.other].curve.tangent[0]
        turns.append(float(np.arctan2(before[0] * after[1] - before[1] * after[0], before @ after)))
    return turns


def write_programs(
    scenario: ScenarioDescription, network: RoadNetwork, nodes: list[NetNode], losses: Losses
) -> tuple[dict[NetLink, tuple[str, int]], list[str]]:
    """Return junction and index of each link with a traffic light, and the programs: one a junction with lights."""
    row_of = {} if scenario.map is None else {feature: row for row, feature in enumerate(scenario.map.ids)}
    states: dict[tuple[int, int], int] = {}
    for light, lane in enumerate(scenario.lights.lane_ids):
        place = network.place_of.get(row_of.get(lane, -1))
        if place is None:
            losses.leave_out("traffic lights of lanes outside of the map")
        else:
            states[place] = light
    found: dict[NetLink, tuple[str, int]] = {}
    programs, used = [], set[int]()
    for node in nodes:
        lit = [link for link in node.links if (link.road, link.lane) in states]
        if not lit:
            continue
        lights = [states[link.road, link.lane] for link in lit]
        used.update(lights)
        found |= {link: (node.name, index) for index, link in enumerate(lit)}
        colors = LIGHT_COLORS[scenario.lights.state[lights]]
        changes = [0, *(np.flatnonzero(np.diff(colors, axis=1).any(axis=0)) + 1).tolist(), colors.shape[1]]
        programs.append(f'<tlLogic id="{node.name}" type="static" programID="recorded" offset="0">')
        for first, end in pairwise(changes):
            state = "".join(_COLORS[LightColor(color)] for color in colors[:, first].tolist())
            programs.append(f'<phase duration="{(end - first) * scenario.dt:.3f}" state="{state}"/>')
        programs.append("</tlLogic>")
    losses.leave_out("traffic lights of lanes that end", len(states) - len(used))
    losses.leave_out("ids of traffic lights, which are those of junctions", len(used))
    losses.leave_out("kinds of states of traffic lights beyond their color", len(used))
    return found, programs
