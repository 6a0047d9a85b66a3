"""Read OpenDRIVE as a map: lanes with links, neighbours and marks, lights, stop signs, stop lines, crosswalks."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import MapBuilder
from scenarionet_data.building.plausible import find_bad_geometry
from scenarionet_data.converters.formats.opendrive.curves import number
from scenarionet_data.converters.formats.opendrive.roads import LaneSection, MapRoad, RoadLane, read_road
from scenarionet_data.converters.formats.xml_files import read_xml
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.scenario.vocabulary import MapFeatureType as Type

LANES = {
    **dict.fromkeys(
        ("driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "bidirectional", "bus", "taxi", "HOV",
         "slipLane", "mwyEntry", "mwyExit", "shared"),
        Type.LANE_SURFACE_STREET,
    ),
    "biking": Type.LANE_BIKE_LANE,
}  # fmt: skip
"""Types of lanes that are driven on; others (sidewalks, shoulders, borders, ...) are left out."""
_WHITE = {
    "solid": Type.ROAD_LINE_SOLID_SINGLE_WHITE,
    "broken": Type.ROAD_LINE_BROKEN_SINGLE_WHITE,
    "solid solid": Type.ROAD_LINE_SOLID_DOUBLE_WHITE,
    "botts dots": Type.ROAD_LINE_BROKEN_SINGLE_WHITE,
}
_YELLOW = {
    "solid": Type.ROAD_LINE_SOLID_SINGLE_YELLOW,
    "broken": Type.ROAD_LINE_BROKEN_SINGLE_YELLOW,
    "solid solid": Type.ROAD_LINE_SOLID_DOUBLE_YELLOW,
    "broken broken": Type.ROAD_LINE_BROKEN_DOUBLE_YELLOW,
    "solid broken": Type.ROAD_LINE_PASSING_DOUBLE_YELLOW,
    "broken solid": Type.ROAD_LINE_PASSING_DOUBLE_YELLOW,
}
_EDGES = {"curb": Type.ROAD_EDGE_BOUNDARY, "edge": Type.ROAD_EDGE_BOUNDARY}
_SPEEDS = {"mph": 0.44704, "km/h": 1.0 / 3.6, "m/s": 1.0}
_SIGNALS = {"206": Type.STOP_SIGN, "R1-1": Type.STOP_SIGN, "294": Type.STOP_LINE}
"""Types of signals that are read, beside those that are dynamic: traffic lights."""
_STOP_LINE = 3.0
"""Length of a stop line whose lanes are not known [m]."""

LaneEnd = tuple[tuple[str, int, int], bool]
"""A lane and whether its end along the road is meant, or else its start."""


def read_opendrive(path: Path) -> MapBuilder:
    """Read a map, in the coordinates of the file; what cannot be used is left out and listed in its ``defects``.

    Maps of :mod:`scenarionet_data.interchange.opendrive` are read in the frame of their scenario's source.

    Raises:
        CorruptSource: No OpenDRIVE, or no lane in it that can be used.
    """
    root, defects, roads = read_xml(path, "OpenDRIVE"), Defects(), dict[str, MapRoad]()
    for element in root.findall("road"):
        name = element.get("id", "")
        try:
            if name in roads or not name:
                raise ValueError("expected an id of its own, found none or a second one")
            roads[name] = read_road(element)
        except ValueError as error:
            defects.drop("maps", path.name, [f"road {name[:64]}"], "road", str(error))
    shift = next(
        (each.get("value", "").split() for each in root.findall("header/userData") if each.get("code") == "origin"), []
    )
    try:
        origin = np.array([float(text) for text in shift] or [0.0, 0.0, 0.0], np.float64).reshape(3)
    except ValueError:
        origin = np.full(3, np.nan)
    if not np.isfinite(origin).all():
        raise CorruptSource(f"{path}: <userData code=origin>: expected three numbers, found {' '.join(shift)[:64]}")
    lanes = {lane.key: lane for road in roads.values() for part in road.sections for lane in part.lanes.values()}
    driven = {key for key, lane in lanes.items() if lane.element.get("type") in LANES}
    links = _LaneLinks(path.name, roads, defects)
    links.join_roads()
    links.join_junctions(root.findall("junction"))
    builder = _RoadFeatures(roads, driven, links.directed(lanes, driven), origin, defects, path.name).build()
    if not driven or not len(builder):
        raise CorruptSource(f"{path}: expected lanes, found none that can be used; download it again")
    builder.defects = defects.found()
    return builder


class _LaneLinks:
    """Collects which ends of lanes meet."""

    def __init__(self, file: str, roads: dict[str, MapRoad], defects: Defects) -> None:
        self.file, self.roads, self.defects = file, roads, defects
        self.pairs = dict[tuple[LaneEnd, LaneEnd], None]()

    def join_roads(self) -> None:
        """Join lanes of sections, and of roads that follow each other."""
        for road in self.roads.values():
            for place, section in enumerate(road.sections):
                for lane in section.lanes.values():
                    for tag, step in (("predecessor", -1), ("successor", 1)):
                        for link in lane.element.findall(f"link/{tag}"):
                            self.join(road, place, lane, step, link.get("id", ""))

    def join(self, road: MapRoad, place: int, lane: RoadLane, step: int, name: str) -> None:
        """Join a lane with the lane ``name`` of the next (``step=1``) or previous (-1) section, or road."""
        is_end = step > 0
        if 0 <= place + step < len(road.sections):
            self.add((lane.key, is_end), road.id, place + step, name, not is_end)
            return
        tag = "successor" if is_end else "predecessor"
        link = road.element.find(f"link/{tag}")
        if link is not None and link.get("elementType") == "road":
            self.add_at((lane.key, is_end), link.get("elementId", ""), link.get("contactPoint", ""), name)

    def join_junctions(self, junctions: list[Element]) -> None:
        """Join incoming lanes with those of the roads that cross junctions."""
        for junction in junctions:
            for connection in junction.findall("connection"):
                incoming = self.roads.get(connection.get("incomingRoad", ""))
                crossing = connection.get("connectingRoad", connection.get("linkedRoad", ""))
                if incoming is None or crossing not in self.roads:
                    self.drop(f"connection of junction {junction.get('id', '')[:32]}")
                    continue
                for tag, place in (("predecessor", 0), ("successor", -1)):
                    link = incoming.element.find(f"link/{tag}")
                    if link is None or link.get("elementId") != junction.get("id") or link.get("elementType") == "road":
                        continue
                    for pair in connection.findall("laneLink"):
                        lane = incoming.sections[place].lanes.get(_whole(pair.get("from")))
                        if lane is not None:
                            end, contact = (lane.key, place == -1), connection.get("contactPoint", "")
                            self.add_at(end, crossing, contact, pair.get("to", ""))

    def add_at(self, end: LaneEnd, road: str, contact: str, name: str) -> None:
        """Join an end with a lane at the ``contact`` of a road."""
        last = len(self.roads[road].sections) - 1 if road in self.roads else 0
        self.add(end, road, last if contact == "end" else 0, name, contact == "end")

    def add(self, end: LaneEnd, road: str, place: int, name: str, is_end: bool) -> None:
        """Join two ends."""
        sections = self.roads[road].sections if road in self.roads else []
        lane = sections[place].lanes.get(_whole(name)) if sections else None
        if lane is None:
            self.drop(f"link of {'_'.join(map(str, end[0]))[:64]}")
        else:
            self.pairs[end, (lane.key, is_end)] = None

    def drop(self, where: str) -> None:
        self.defects.drop("maps", self.file, [where], "link", "expected a road and lane of the map, found none")

    def directed(
        self, lanes: dict[tuple[str, int, int], RoadLane], driven: set[tuple[str, int, int]]
    ) -> set[tuple[tuple[str, int, int], tuple[str, int, int]]]:
        """Pairs of a lane and one that follows it in driving direction."""
        found = set()
        for (first, first_end), (second, second_end) in self.pairs:
            is_exit, is_entry = first_end == lanes[first].is_along, second_end != lanes[second].is_along
            if first in driven and second in driven and is_exit == is_entry and first != second:
                found.add((first, second) if is_exit else (second, first))
        return found


class _RoadFeatures:
    """Adds the features of all roads to a map."""

    def __init__(
        self,
        roads: dict[str, MapRoad],
        driven: set[tuple[str, int, int]],
        links: set[tuple[tuple[str, int, int], tuple[str, int, int]]],
        origin: Float64,
        defects: Defects,
        file: str,
    ) -> None:
        self.roads, self.driven, self.origin, self.defects, self.file = roads, driven, origin, defects, file
        self.builder = MapBuilder()
        self.exits, self.entries = (
            defaultdict[tuple[str, int, int], list[str]](list),
            defaultdict[tuple[str, int, int], list[str]](list),
        )
        for first, second in sorted(links):
            self.exits[first].append("_".join(map(str, second)))
            self.entries[second].append("_".join(map(str, first)))

    def build(self) -> MapBuilder:
        """Return the map."""
        for road in self.roads.values():
            limit = _speed(road.element.findall("type/speed"))
            for section in road.sections:
                marks = {name: list(self.marks(road, section, name)) for name in (0, *section.lanes)}
                for lane in section.lanes.values():
                    if lane.key in self.driven:
                        self.add_lane(road, section, lane, marks, limit)
            for place, signal in enumerate(road.element.findall("signals/signal")):
                self.add_signal(road, signal, f"signal-{road.id}-{place}")
            for place, item in enumerate(road.element.findall("objects/object[@type='crosswalk']")):
                self.add_crosswalk(road, item, f"crosswalk-{road.id}-{place}")
        return self.builder

    def add(self, name: str, kind: Type, points: Float64, **more: object) -> bool:
        """Add a feature whose points can be."""
        reason = find_bad_geometry(points, points[0, :2])
        if reason:
            self.defects.drop("maps", self.file, [name[:64]], "geometry", reason)
        else:
            self.builder.add(name, kind, **more)  # type: ignore[arg-type]
        return not reason

    def add_lane(
        self, road: MapRoad, section: LaneSection, lane: RoadLane, marks: dict[int, list[str]], limit: float
    ) -> None:
        inner, outer = (section.line(border) + self.origin for border in lane.borders)
        center = (inner + outer) / 2.0
        half = np.hypot(*(outer - inner)[:, :2].T) / 2.0
        step = 1 if lane.is_along else -1
        number_in, beside = lane.key[2] - np.sign(lane.key[2]), {}
        # The inner side is on the left of lanes that drive as their side of the reference line says.
        is_inner_left = (lane.key[2] < 0) == lane.is_along
        for side, name in (("inner", int(number_in)), ("outer", lane.key[2] + int(np.sign(lane.key[2])))):
            other = section.lanes.get(name)
            same = other is not None and other.key in self.driven and other.is_along == lane.is_along
            beside[side] = [other.id] if other is not None and same else []
        left, right = ("inner", "outer") if is_inner_left else ("outer", "inner")
        lines = {"inner": marks.get(int(number_in), []), "outer": marks.get(lane.key[2], [])}
        sides = (inner, outer) if is_inner_left else (outer, inner)
        outline = np.concatenate([sides[0][::step], sides[1][::step][::-1]])
        self.add(
            lane.id,
            LANES[lane.element.get("type", "")],
            center,
            polyline=center[::step],
            polygon=outline,
            width=np.column_stack([half, half])[::step],
            speed_limit=_speed(lane.element.findall("speed"), limit),
            entry_lanes=self.entries[lane.key],
            exit_lanes=self.exits[lane.key],
            left_neighbors=beside[left],
            right_neighbors=beside[right],
            left_boundaries=lines[left],
            right_boundaries=lines[right],
            is_intersection=road.junction is not None,
            extras={"junction": road.junction} if road.junction is not None else None,
        )

    def marks(self, road: MapRoad, section: LaneSection, name: int) -> Iterator[str]:
        """Add the lines that are painted along the outer border of a lane; yield their ids."""
        lane = section.lanes.get(name)
        element, aside = (section.center, section.offset) if lane is None else (lane.element, lane.borders[1])
        found = [] if element is None else element.findall("roadMark")
        starts = [section.start + number(each, "sOffset", 0.0) for each in found]
        for place, (mark, start) in enumerate(zip(found, starts, strict=True)):
            end = starts[place + 1] if place + 1 < len(starts) else np.inf
            at = section.stations[section.kept]
            rows = section.kept[(at >= start - 1e-6) & (at <= end + 1e-6)]
            words = _YELLOW if mark.get("color") == "yellow" else _WHITE
            word = mark.get("type", "none")
            kind = {**words, **_EDGES}.get(word, Type.UNKNOWN_LINE)
            if word != "none" and len(rows) > 1:
                key = f"line-{road.id}_{road.sections.index(section)}_{name}_{place}"
                line = section.line(aside, rows) + self.origin
                if self.add(key, kind, line, polyline=line):
                    yield key

    def add_signal(self, road: MapRoad, signal: Element, name: str) -> None:
        """Add a traffic light, stop sign or stop line with the lanes that it controls."""
        is_light = signal.get("dynamic") == "yes"
        kind = Type.TRAFFIC_LIGHT if is_light else _SIGNALS.get(signal.get("type", ""))
        if kind is None:
            return
        try:
            station, aside = number(signal, "s"), number(signal, "t")
        except ValueError as error:
            self.defects.drop("maps", self.file, [name[:64]], "signal", str(error))
            return
        section = road.section_at(station)
        allowed = {"+": (True,), "-": (False,)}.get(signal.get("orientation", ""), (True, False))
        ranges = [(_whole(each.get("fromLane")), _whole(each.get("toLane"))) for each in signal.findall("validity")]
        ranges = [pair for pair in ranges if pair != (0, 0)]
        lanes = [
            lane
            for lane in section.lanes.values()
            if lane.key in self.driven
            and lane.is_along in allowed
            and (not ranges or any(min(pair) <= lane.key[2] <= max(pair) for pair in ranges))
        ]
        height = float(np.interp(station, section.stations, section.height))
        ends = [aside - _STOP_LINE / 2.0, aside + _STOP_LINE / 2.0] if kind == Type.STOP_LINE else [aside]
        if kind == Type.STOP_LINE and lanes:
            borders = [float(np.interp(station, section.stations, side)) for lane in lanes for side in lane.borders]
            ends = [min(borders), max(borders)]
        points = np.array([[*road.reference.locate(station, end), height] for end in ends]) + self.origin
        self.add(name, kind, points, polyline=points, controlled_lanes=[lane.id for lane in lanes])

    def add_crosswalk(self, road: MapRoad, item: Element, name: str) -> None:
        """Add the outline of a crosswalk."""
        try:
            station, heading = number(item, "s"), number(item, "hdg", 0.0)
            middle, ahead = road.reference.locate(station, number(item, "t")), road.reference.locate(station + 0.5, 0.0)
            along = ahead - road.reference.locate(station - 0.5, 0.0)
            angle = heading + float(np.arctan2(along[1], along[0]))
            turned = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            local = [[number(each, "u"), number(each, "v")] for each in item.iter("cornerLocal")]
            corners = [road.reference.locate(number(each, "s"), number(each, "t")) for each in item.iter("cornerRoad")]
            if not local and not corners:
                half = number(item, "length") / 2.0, number(item, "width") / 2.0
                local = [[sx * half[0], sy * half[1]] for sx, sy in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        except ValueError as error:
            self.defects.drop("maps", self.file, [name[:64]], "object", str(error))
            return
        outline = np.array(corners) if corners else middle + np.array(local) @ turned
        if len(outline) > 2:
            section = road.section_at(station)
            height = float(np.interp(station, section.stations, section.height))
            points = np.column_stack([outline, np.full(len(outline), height)]) + self.origin
            self.add(name, Type.CROSSWALK, points, polygon=points)


def _speed(found: list[Element], default: float = np.nan) -> float:
    """The first limit [m/s]."""
    for each in found:
        try:
            limit = number(each, "max") * _SPEEDS.get(each.get("unit", "m/s"), np.nan)
        except ValueError:  # "no limit"
            continue
        if limit > 0:
            return limit
    return default


def _whole(text: str | None) -> int:
    """A number of a lane; 0, which no lane has, for anything else."""
    return int(text) if text is not None and text.lstrip("+-").isdecimal() and len(text) < 8 else 0
