"""Read Lanelet2 maps: OpenStreetMap XML in which relations of two ways are lanes.

A node has degrees, or metres in the tags ``local_x`` and ``local_y`` (Autoware). A way is a line of nodes; its tags say
what is painted or built there. A lanelet is a relation with the members ``left`` and ``right``; one follows another if
it begins at the two nodes where that ends, and they are neighbours if they share a way.
"""

from __future__ import annotations

import re
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import MapBuilder, flat_points
from scenarionet_data.building.plausible import find_bad_geometry
from scenarionet_data.building.polylines import between, midlines
from scenarionet_data.building.projection import to_utm, utm_zone
from scenarionet_data.converters.formats.xml_files import read_xml, to_number
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.scenario.vocabulary import MapFeatureType as Type

LANES = {
    "road": Type.LANE_SURFACE_STREET,
    "play_street": Type.LANE_SURFACE_STREET,
    "bus_lane": Type.LANE_SURFACE_STREET,
    "emergency_lane": Type.LANE_SURFACE_STREET,
    "highway": Type.LANE_FREEWAY,
    "bicycle_lane": Type.LANE_BIKE_LANE,
}
CROSSWALK = "crosswalk"
EDGES = {
    "curbstone": Type.ROAD_EDGE_BOUNDARY,
    "road_border": Type.ROAD_EDGE_BOUNDARY,
    "wall": Type.ROAD_EDGE_BOUNDARY,
    "fence": Type.ROAD_EDGE_BOUNDARY,
    "guard_rail": Type.GUARDRAIL,
}
PAINT = ("line_thin", "line_thick", "pedestrian_marking", "zebra_marking", "bike_marking")
_MARKS = {
    ("dashed", False): Type.ROAD_LINE_BROKEN_SINGLE_WHITE,
    ("dashed", True): Type.ROAD_LINE_BROKEN_SINGLE_YELLOW,
    ("solid", False): Type.ROAD_LINE_SOLID_SINGLE_WHITE,
    ("solid", True): Type.ROAD_LINE_SOLID_SINGLE_YELLOW,
    ("solid_solid", False): Type.ROAD_LINE_SOLID_DOUBLE_WHITE,
    ("solid_solid", True): Type.ROAD_LINE_SOLID_DOUBLE_YELLOW,
    ("dashed_solid", True): Type.ROAD_LINE_PASSING_DOUBLE_YELLOW,
    ("solid_dashed", True): Type.ROAD_LINE_PASSING_DOUBLE_YELLOW,
}
STOP_SIGNS = ("usR1-1", "de206")
_SPEED = re.compile(r"(\d+(?:\.\d+)?)\s*(mph|km/?h|kmh|m/s|mps)?", re.IGNORECASE)
_UNITS = {"mph": 0.44704, "m/s": 1.0, "mps": 1.0}


@dataclass(eq=False)
class _Lanelet:
    """A lanelet; ways run in its driving direction: a leading ``~`` says that one is stored the other way round."""

    id: str
    tags: dict[str, str]
    ways: tuple[str, str]
    ends: tuple[tuple[str, str], tuple[str, str]]  # its first two nodes, and its last two, left and right
    rules: list[str] = field(default_factory=list)


def read_lanelet2(path: Path, anchor: tuple[float, float] | None = None) -> MapBuilder:
    """Read a map; what cannot be used is left out and listed in its ``defects``.

    Args:
        path: The ``.osm`` file.
        anchor: Latitude and longitude [degrees] of the frame's origin, in whose UTM zone the map is laid out; by
            default the frame is the UTM zone of the first node, or the local one of ``local_x`` and ``local_y``.

    Raises:
        CorruptSource: No such XML, or no lanelet in it.
    """
    return _MapFile(path, anchor).features()


class _MapFile:
    def __init__(self, path: Path, anchor: tuple[float, float] | None) -> None:
        self.path, self.defects = path, Defects()
        root = read_xml(path, "osm")
        self.points = self._nodes(root, anchor)
        self.tags = {way.get("id", ""): _tags(way) for way in root.iter("way")}
        found = {}
        for way in root.iter("way"):
            name, nodes = way.get("id", ""), [nd.get("ref", "") for nd in way.iter("nd")]
            missing = [node for node in nodes if node not in self.points]
            if missing:
                self._drop([f"node of way {name}"] * len(missing), "nd", "nodes of the map", missing[0])
            nodes = [node for node in nodes if node in self.points]
            if len(nodes) > 1:
                found[name] = nodes
            else:
                self._drop([f"way {name}"], "nd", "two nodes or more", str(len(nodes)))
        self.nodes = found
        relations = list(root.iter("relation"))
        self.rules = {each.get("id", ""): each for each in relations if _tags(each).get("type") == "regulatory_element"}
        self.lanelets = self._lanelets(relations)
        if not self.lanelets:
            raise CorruptSource(f"{path}: expected a Lanelet2 map, found no lanelet that can be used in it")

    def features(self) -> MapBuilder:
        builder, speeds = MapBuilder(), self._speeds()
        lanes = [lanelet for lanelet in self.lanelets if lanelet.tags.get("subtype", "road") in LANES]
        left, right = (flat_points([self._line(lane.ways[side]) for lane in lanes]) for side in (0, 1))
        centers, widths = between(midlines(left, right), left, right) if lanes else (left, right)
        begins, ends, at = defaultdict(list), defaultdict(list), defaultdict(list)
        for lane in lanes:
            begins[lane.ends[0]].append(lane.id)
            ends[lane.ends[1]].append(lane.id)
            for side in (0, 1):
                at[side, lane.ways[side]].append(lane.id)
        for lane, a, b, center, width in zip(lanes, left, right, centers, widths, strict=True):
            # The lane on the left has this one's left way on its right, and in the same direction.
            builder.add(
                lane.id,
                LANES[lane.tags.get("subtype", "road")],
                polyline=center,
                polygon=np.concatenate([a, b[::-1]]),
                width=width,
                speed_limit=speeds.get(lane.id, np.nan),
                entry_lanes=ends[lane.ends[0]],
                exit_lanes=begins[lane.ends[1]],
                left_neighbors=at[1, lane.ways[0]],
                right_neighbors=at[0, lane.ways[1]],
                left_boundaries=self._painted(lane.ways[0]),
                right_boundaries=self._painted(lane.ways[1]),
                extras={key: lane.tags[key] for key in ("turn_direction", "one_way") if key in lane.tags} or None,
            )
        for lanelet in self.lanelets:
            if lanelet.tags.get("subtype") == CROSSWALK:
                outline = np.concatenate([self._line(lanelet.ways[0]), self._line(lanelet.ways[1])[::-1]])
                builder.add(lanelet.id, Type.CROSSWALK, polygon=outline)
            elif lanelet.tags.get("subtype", "road") not in LANES:
                self._drop([lanelet.id], "subtype", f"lanes of {', '.join(LANES)}", lanelet.tags["subtype"])
        for way in self.nodes:
            if (kind := self._mark(way)) is not None:
                tags = self.tags[way]
                extras = {key: word for key, word in tags.items() if key in ("type", "subtype")}
                is_exact = kind not in (Type.UNKNOWN_LINE, Type.ROAD_EDGE_BOUNDARY)
                builder.add(f"line-{way}", kind, polyline=self._line(way), extras=None if is_exact else extras)
        self._add_stops(builder, {lane.id: center for lane, center in zip(lanes, centers, strict=True)})
        builder.defects = self.defects.found()
        return builder

    # --- elements ------------------------------------------------------------------------------------

    def _nodes(self, root: Element, anchor: tuple[float, float] | None) -> dict[str, Float64]:
        """Position (3,) [m] of each node."""
        nodes = [(node.get("id", ""), node, _tags(node)) for node in root.iter("node")]
        is_local = anchor is None and any("local_x" in tags for _, _, tags in nodes)
        degrees = np.array([(to_number(node.get("lat")), to_number(node.get("lon"))) for _, node, _ in nodes])
        degrees = degrees.reshape(-1, 2)
        heights = np.array([to_number(tags.get("ele", "0")) for _, _, tags in nodes])
        if is_local:
            plane = np.array([(to_number(tags.get("local_x")), to_number(tags.get("local_y"))) for _, _, tags in nodes])
        else:
            is_on_earth = (np.abs(degrees) <= (90.0, 180.0)).all(axis=1)
            degrees[~is_on_earth] = np.nan
            first = anchor or (degrees[is_on_earth][0] if is_on_earth.any() else (0.0, 0.0))
            zone = utm_zone(float(first[1]))
            plane = to_utm(degrees[:, 0], degrees[:, 1], zone)
            if anchor:
                plane -= to_utm(np.array([anchor[0]]), np.array([anchor[1]]), zone)
        points = np.column_stack([plane, heights])
        centre = np.nanmedian(points[:, :2], axis=0) if np.isfinite(points[:, :2]).any() else np.zeros(2)
        found = {}
        for (name, _, _), point in zip(nodes, points, strict=True):
            reason = find_bad_geometry(point[None], centre)
            if reason:
                self.defects.drop("maps", self.path.name, [f"node {name}"], "position", reason)
            else:
                found[name] = point
        return found

    def _lanelets(self, relations: list[Element]) -> list[_Lanelet]:
        found: dict[str, _Lanelet] = {}
        for relation in relations:
            name, tags, members = relation.get("id", ""), _tags(relation), _members(relation)
            if tags.get("type") == "multipolygon":
                self._drop([f"area {name}"], "type", "lanelets and rules", f"an area ({tags.get('subtype')})")
            if tags.get("type") != "lanelet":
                continue
            sides = members["left"], members["right"]
            if not all(len(ways) == 1 and ways[0] in self.nodes for ways in sides) or not name or name in found:
                self._drop([f"lanelet {name}"], "member", "an id of its own and one known way on each side", str(sides))
                continue
            ways = self._aligned(sides[0][0], sides[1][0])
            left, right = map(self._refs, ways)
            ends = (left[0], right[0]), (left[-1], right[-1])
            found[name] = _Lanelet(name, tags, ways, ends, members["regulatory_element"])
        return list(found.values())

    def _aligned(self, left: str, right: str) -> tuple[str, str]:
        """Turn ways so that the left one lies on the left: as Lanelet2 does, which ignores their stored direction."""
        middle_left, middle_right = (line[len(line) // 2] for line in (self._line(left), self._line(right)))
        is_turned_left = _side(self._line(left), middle_right) > 0
        is_turned_right = _side(self._line(right), middle_left) < 0
        return "~" * is_turned_left + left, "~" * is_turned_right + right

    def _refs(self, way: str) -> list[str]:
        return self.nodes[way[1:]][::-1] if way.startswith("~") else self.nodes[way]

    def _line(self, way: str) -> Float64:
        return np.array([self.points[node] for node in self._refs(way)])

    # --- paint, rules --------------------------------------------------------------------------------

    def _mark(self, way: str) -> Type | None:
        """Type of the line painted or built along a way."""
        tags = self.tags[way]
        kind = tags.get("type", "")
        if kind in PAINT:
            return _MARKS.get((tags.get("subtype", ""), tags.get("color") == "yellow"), Type.UNKNOWN_LINE)
        return EDGES.get(kind)

    def _painted(self, way: str) -> tuple[str, ...]:
        name = way.removeprefix("~")
        return () if self._mark(name) is None else (f"line-{name}",)

    def _speeds(self) -> dict[str, float]:
        """Speed limit [m/s] of lanelets that have one: in a tag, or by a rule."""
        speeds = {}
        for lanelet in self.lanelets:
            words = [lanelet.tags.get("speed_limit", "")]
            for rule in lanelet.rules:
                tags = _tags(self.rules[rule]) if rule in self.rules else {}
                words += [tags.get("sign_type", "")] if tags.get("subtype") == "speed_limit" else []
            for match in filter(None, map(_SPEED.fullmatch, map(str.strip, words))):
                speeds[lanelet.id] = float(match[1]) * _UNITS.get((match[2] or "").lower(), 1.0 / 3.6)
                break
        return speeds

    def _add_stops(self, builder: MapBuilder, lanes: dict[str, Float64]) -> None:
        """Stop lines and signs, with the lanes that they stop: of its rule, those that end or begin nearest to them."""
        ruled = defaultdict(list)
        for lanelet in self.lanelets:
            for rule in lanelet.rules:
                ruled[rule].append(lanelet.id)
        stopped: dict[str, list[str]] = defaultdict(list)
        for name, relation in self.rules.items():
            members = _members(relation)
            yielding = [lane for lane in members["yield"] or ruled[name] if lane in lanes]
            for role in ("ref_line", "refers"):
                ways = [way for way in members[role] if way in self.nodes]
                middles = np.array([self._line(way).mean(axis=0)[:2] for way in ways]).reshape(-1, 2)
                for lane in yielding if ways else ():
                    ends = lanes[lane][[0, -1], :2]
                    away = np.hypot(*(middles[:, None] - ends).T).min(axis=0)
                    way = ways[int(away.argmin())]
                    stopped[way] += [] if lane in stopped[way] else [lane]
        for way in self.nodes:
            tags = self.tags[way]
            if tags.get("type") == "stop_line":
                builder.add(
                    f"stop-{way}", Type.STOP_LINE, polyline=self._line(way), controlled_lanes=stopped.get(way, ())
                )
            elif tags.get("type") == "traffic_sign" and tags.get("subtype") in STOP_SIGNS:
                place = self._line(way).mean(axis=0, keepdims=True)
                builder.add(f"sign-{way}", Type.STOP_SIGN, polyline=place, controlled_lanes=stopped.get(way, ()))

    def _drop(self, places: list[str], name: str, expected: str, found: str) -> None:
        self.defects.drop("maps", self.path.name, places, name, f"expected {expected}, found {found[:64]}")


def _tags(element: Element) -> dict[str, str]:
    return {tag.get("k", ""): tag.get("v", "") for tag in element.iter("tag")}


def _members(relation: Element) -> defaultdict[str, list[str]]:
    members = defaultdict(list)
    for member in relation.iter("member"):
        members[member.get("role", "")].append(member.get("ref", ""))
    return members


def _side(line: Float64, point: Float64) -> float:
    """Positive if a point lies on the left of a line, by the segment that is nearest to it."""
    start, step = line[:-1, :2], np.diff(line[:, :2], axis=0)
    along = ((point[:2] - start) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-12)
    away = point[:2] - (start + step * along.clip(0.0, 1.0)[:, None])
    row = int((away**2).sum(axis=1).argmin())
    offset = point[:2] - start[row]
    return float(step[row, 0] * offset[1] - step[row, 1] * offset[0])
