"""Write maps as Lanelet2 OSM for Autoware: shared points and lines, traffic lights and stop signs as rules."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import ClassVar
from xml.sax.saxutils import quoteattr

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building.projection import to_utm, utm_zone
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.lane_graph import boundary_type
from scenarionet_data.interchange.lanelet2.sides import Corner, share_sides
from scenarionet_data.interchange.lanelets import make_lanelets
from scenarionet_data.interchange.numbering import light_number, number_ids
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane

ANCHOR = (49.0, 8.4)
"""Latitude and longitude [degrees] of the scenario frame's origin: that of Lanelet2's own examples."""
_LANES = {
    MapFeatureType.LANE_FREEWAY: ("highway", ("vehicle",)),
    MapFeatureType.LANE_BIKE_LANE: ("bicycle_lane", ("bicycle",)),
}
_LINES = {
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE: ("line_thin", "dashed", "white"),
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE: ("line_thin", "solid", "white"),
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE: ("line_thin", "solid_solid", "white"),
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_YELLOW: ("line_thin", "dashed", "yellow"),
    MapFeatureType.ROAD_LINE_BROKEN_DOUBLE_YELLOW: ("line_thin", "dashed", "yellow"),
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_YELLOW: ("line_thin", "solid", "yellow"),
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW: ("line_thin", "solid_solid", "yellow"),
    MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW: ("line_thin", "solid_dashed", "yellow"),
    MapFeatureType.GUARDRAIL: ("guard_rail", "", ""),
    **dict.fromkeys((MapFeatureType.ROAD_EDGE_MEDIAN, MapFeatureType.ROAD_EDGE_SIDEWALK), ("curbstone", "high", "")),
    **dict.fromkeys((MapFeatureType.ROAD_EDGE_BOUNDARY, MapFeatureType.UNKNOWN), ("road_border", "", "")),
}
_LIGHT_HEIGHT = 5.0  # [m] above the road
_HALF = np.array([0.3, 0.0, 0.0])  # [m] of the line that stands for a light or sign


@dataclass(frozen=True)
class Lanelet2Writer:
    """Writes the map of each scenario, one file a scenario; ``local_x`` and ``local_y`` are in the scenario frame."""

    name: ClassVar[str] = "lanelet2"

    def write(self, scenario: ScenarioDescription, stem: str, losses: Losses) -> Mapping[str, bytes]:
        """Return the file of a scenario's map; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        losses.leave_out("tracks", len(scenario.tracks))
        if scenario.map is None:
            raise InvalidScenario(scenario.id, "map", "expected a map, found none")
        return {f"{stem}.osm": _OsmWriter(scenario, scenario.map, losses).text()}


@dataclass(eq=False)
class _OsmWriter:
    """Collects the nodes, ways and relations of a map."""

    scenario: ScenarioDescription
    features: MapFeatures
    losses: Losses
    points: list[tuple[int, Float64]] = field(default_factory=list)
    ways: list[str] = field(default_factory=list)
    relations: list[str] = field(default_factory=list)

    def text(self) -> bytes:
        """Return the file."""
        features, losses = self.features, self.losses
        lanelets = make_lanelets(features, losses)
        if not lanelets:
            raise InvalidScenario(self.scenario.id, "map", "expected lanes, found none")
        corners, left_of = share_sides(lanelets, losses)
        named = {"map features": [features.ids[lanelet.row] for lanelet in lanelets]}
        numbers, self.free = number_ids(named, losses, first=1)
        number_of = {lanelet.row: number for lanelet, number in zip(lanelets, numbers["map features"], strict=True)}
        nodes: dict[Corner, int] = {}
        node_of: dict[Corner, int] = {}
        for corner, (first, place) in corners.points(losses).items():
            if first not in nodes:
                nodes[first] = self.node(place)
            node_of[corner] = nodes[first]
        sides: dict[tuple[int, bool], int] = {}
        for lanelet in lanelets:
            for is_left, line in ((True, lanelet.left), (False, lanelet.right)):
                if is_left and lanelet.row in left_of:
                    continue
                ends = [node_of[Corner(lanelet.row, is_left, is_end)] for is_end in (False, True)]
                kind = boundary_type(features, lanelet.row, is_left=is_left)
                tags = dict(zip(("type", "subtype", "color"), _LINES.get(kind, ("virtual", "", "")), strict=True))  # type: ignore[arg-type]
                inner = [self.node(point) for point in line[1:-1]]
                sides[lanelet.row, is_left] = self.way([ends[0], *inner, ends[1]], tags)
        for row, other in left_of.items():
            sides[row, True] = sides[other, False]
        stop_nodes = {
            (row, is_end): [node_of[Corner(row, side, is_end)] for side in (True, False)]
            for row in number_of
            for is_end in (False, True)
        }
        rules = self.rules(stop_nodes)
        for row, number in number_of.items():
            kind = MapFeatureType(features.feature_type[row])
            subtype, participants = _LANES.get(kind, ("road", ("vehicle", "bicycle")))
            tags = {"type": "lanelet", "subtype": subtype, "location": "urban", "one_way": "yes"}
            tags |= {f"participant:{each}": "yes" for each in participants}
            if np.isfinite(features.speed_limit[row]) and features.speed_limit[row] > 0:
                tags["speed_limit"] = f"{3.6 * float(features.speed_limit[row]):.3f}"
            members = [("way", sides[row, True], "left"), ("way", sides[row, False], "right")]
            members += [("relation", rule, "regulatory_element") for rule in rules.get(row, ())]
            self.relation(number, members, tags)
            held = kind in (*_LANES, MapFeatureType.LANE_SURFACE_STREET)
            losses.leave_out("kinds of lanes that Lanelet2 does not have", int(not held))
        self.crosswalks()
        head = ['<?xml version="1.0" encoding="UTF-8"?>', '<osm version="0.6" generator="scenarionet-lake">']
        return "\n".join([*head, *self.node_lines(), *self.ways, *self.relations, "</osm>\n"]).encode()

    def node(self, place: Float64) -> int:
        self.points.append((next(self.free), np.asarray(place, np.float64)))
        return self.points[-1][0]

    def way(self, nodes: list[int], tags: Mapping[str, str]) -> int:
        number = next(self.free)
        refs = "".join([f'<nd ref="{node}"/>' for node in nodes])
        self.ways.append(f'<way id="{number}">{refs}{_tags(tags)}</way>')
        return number

    def relation(self, number: int, members: list[tuple[str, int, str]], tags: Mapping[str, str]) -> None:
        listed = "".join([f'<member type="{kind}" ref="{ref}" role="{role}"/>' for kind, ref, role in members])
        self.relations.append(f'<relation id="{number}">{listed}{_tags(tags)}</relation>')

    def rules(self, stop_nodes: Mapping[tuple[int, bool], list[int]]) -> dict[int, list[int]]:
        """Write traffic lights and stop signs, and return them by lane.

        Stop lines are the ends of lanes; of a light the end that is nearer to its stop point.
        """
        row_of = {self.features.ids[row]: row for row, _ in stop_nodes}
        places = dict(self.points)
        middles = {each: np.mean([places[node] for node in nodes], axis=0) for each, nodes in stop_nodes.items()}
        lines: dict[tuple[int, bool], int] = {}
        found: dict[int, list[int]] = defaultdict(list)

        def add(
            ends: list[tuple[int, bool]], place: Float64, subtype: str, tags: Mapping[str, str], number: int
        ) -> None:
            for end in ends:
                if end not in lines:
                    lines[end] = self.way(stop_nodes[end], {"type": "stop_line"})
            sign = self.way([self.node(place - _HALF), self.node(place + _HALF)], tags)
            members = [("way", sign, "refers"), *(("way", lines[end], "ref_line") for end in ends)]
            self.relation(number, members, {"type": "regulatory_element", "subtype": subtype})
            for row, _ in ends:
                found[row].append(number)

        lights = self.scenario.lights
        for lane, stop in zip(lights.lane_ids, lights.stop_point, strict=True):
            row = row_of.get(lane)
            if row is None:
                self.losses.leave_out("traffic lights of lanes outside of the map")
                continue
            stop = np.where(np.isfinite(stop), stop, middles[row, True])
            is_end = bool(np.hypot(*(middles[row, True] - stop)[:2]) <= np.hypot(*(middles[row, False] - stop)[:2]))
            place = stop + np.array([0.0, 0.0, _LIGHT_HEIGHT])
            tags = {"type": "traffic_light", "subtype": "red_yellow_green", "height": "1"}
            add([(row, is_end)], place, "traffic_light", tags, light_number(lane))
        self.losses.leave_out("states and ids of traffic lights", len(lights))
        for row, kind in enumerate(self.features.feature_type):
            lanes = [(row_of[each], True) for each in self.features.controlled_lanes[row] if each in row_of]
            if kind == MapFeatureType.STOP_SIGN and len(self.features.polyline[row]) and lanes:
                place = self.features.polyline[row][0].astype(np.float64)
                add(lanes, place, "traffic_sign", {"type": "traffic_sign", "subtype": "usR1-1"}, next(self.free))
                self.losses.leave_out("ids of stop signs")
            elif not is_lane(np.array([kind]))[0] and kind != MapFeatureType.CROSSWALK:
                self.losses.leave_out(f"map features of type {MapFeatureType(kind).name}")
        return found

    def crosswalks(self) -> None:
        for row in np.flatnonzero(self.features.feature_type == MapFeatureType.CROSSWALK).tolist():
            outline = self.features.polygon[row]
            if len(outline) < 4:
                self.losses.leave_out("crosswalks without four points")
                continue
            half = len(outline) // 2
            parts = outline[:half], outline[half:][::-1]
            left, right = (self.way([self.node(each) for each in part], {"type": "virtual"}) for part in parts)
            tags = {"type": "lanelet", "subtype": "crosswalk", "participant:pedestrian": "yes"}
            self.relation(next(self.free), [("way", left, "left"), ("way", right, "right")], tags)
            self.losses.leave_out("ids of crosswalks")

    def node_lines(self) -> Iterator[str]:
        """The nodes, with degrees around the anchor and metres."""
        plane = np.array([place for _, place in self.points])
        degrees = degrees_of(plane[:, :2])
        for (number, (x, y, z)), (lat, lon) in zip(self.points, degrees.tolist(), strict=True):
            yield (
                f'<node id="{number}" lat="{lat:.11f}" lon="{lon:.11f}"><tag k="local_x" v="{x:.4f}"/>'
                f'<tag k="local_y" v="{y:.4f}"/><tag k="ele" v="{z:.4f}"/></node>'
            )


def degrees_of(plane: Float64) -> Float64:
    """Return latitudes and longitudes (N, 2) [degrees] of points (N, 2) [m] in UTM around the anchor.

    The inverse of :func:`to_utm` to a hundredth of a millimetre, by stepping towards it.
    """
    zone = utm_zone(ANCHOR[1])
    scale = np.array([111_200.0, 111_300.0 * np.cos(np.radians(ANCHOR[0]))])
    start = to_utm(np.array([ANCHOR[0]]), np.array([ANCHOR[1]]), zone)
    degrees = np.tile(np.array(ANCHOR), (len(plane), 1))
    for _ in range(12):
        missing = plane - (to_utm(degrees[:, 0], degrees[:, 1], zone) - start)
        degrees += missing[:, ::-1] / scale
    return degrees


def _tags(tags: Mapping[str, str]) -> str:
    return "".join([f'<tag k="{key}" v={quoteattr(word)}/>' for key, word in tags.items() if word])
