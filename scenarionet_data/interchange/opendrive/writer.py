"""Write maps as OpenDRIVE 1.7."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar
from xml.etree import ElementTree as Xml

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.lane_graph import boundary_type
from scenarionet_data.interchange.roads import LaneRoad, RoadNetwork, make_roads
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType

_MARKS = {
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE: ("broken", "white"),
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE: ("solid", "white"),
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_WHITE: ("solid solid", "white"),
    MapFeatureType.ROAD_LINE_BROKEN_SINGLE_YELLOW: ("broken", "yellow"),
    MapFeatureType.ROAD_LINE_BROKEN_DOUBLE_YELLOW: ("broken broken", "yellow"),
    MapFeatureType.ROAD_LINE_SOLID_SINGLE_YELLOW: ("solid", "yellow"),
    MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW: ("solid solid", "yellow"),
    MapFeatureType.ROAD_LINE_PASSING_DOUBLE_YELLOW: ("solid broken", "yellow"),
    MapFeatureType.ROAD_EDGE_BOUNDARY: ("curb", "standard"),
    MapFeatureType.ROAD_EDGE_MEDIAN: ("curb", "standard"),
    MapFeatureType.ROAD_EDGE_SIDEWALK: ("curb", "standard"),
}
_LANE_TYPES = {MapFeatureType.LANE_BIKE_LANE: "biking"}
_STRAIGHT = 1e-6  # [m] coefficients below which a piece is a line
_FINEST_WIDTH = 0.002  # [m]
_TRAFFIC_LIGHT = "1000001"
_ORIGIN = np.zeros(3)


@dataclass(frozen=True)
class OpenDriveWriter:
    """Writes the map of each scenario, one file a scenario."""

    name: ClassVar[str] = "opendrive"

    def write(self, scenario: ScenarioDescription, stem: str, losses: Losses) -> Mapping[str, bytes]:
        """Return the file of a scenario's map; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        losses.leave_out("tracks", len(scenario.tracks))
        return {f"{stem}.xodr": write_map(scenario, losses)}


def write_map(scenario: ScenarioDescription, losses: Losses) -> bytes:
    """Return the OpenDRIVE file of a scenario's map, in the scenario frame.

    Raises:
        InvalidScenario: It has no map, or a map without lanes.
    """
    if scenario.map is None:
        raise InvalidScenario(scenario.id, "map", "expected a map, found none")
    held = {*_MARKS, *_LANE_TYPES}
    for kind, count in zip(*np.unique(scenario.map.feature_type, return_counts=True), strict=True):
        if kind > MapFeatureType.LANE_BIKE_LANE and MapFeatureType(kind) not in held:
            losses.leave_out(f"map features of type {MapFeatureType(kind).name}", int(count))
    name = scenario.map_id or scenario.id

    def signals(network: RoadNetwork) -> dict[int, list[LightSignal]]:
        return _signals(scenario, network, losses)

    return write_features(scenario.map, name, losses, scenario.origin, signals)


def write_features(
    features: MapFeatures,
    name: str,
    losses: Losses,
    origin: Float64 = _ORIGIN,
    signals_of: Callable[[RoadNetwork], dict[int, list[LightSignal]]] = lambda _: {},
) -> bytes:
    """Return the OpenDRIVE file of a map.

    Args:
        features: The map.
        name: Its name, for errors that of the scenario.
        losses: Collects what the file does not have.
        origin: (3,) of its frame in the source's [m].
        signals_of: Returns traffic lights by number of their road.

    Raises:
        InvalidScenario: It has no lanes.
    """
    network = make_roads(features, losses)
    if not network.roads:
        raise InvalidScenario(name, "map", "expected lanes, found none")
    root = Xml.Element("OpenDRIVE")
    points = np.concatenate([road.curve.points for road in network.roads])
    (west, south, _), (east, north, _) = points.min(axis=0), points.max(axis=0)
    header = Xml.Element(
        "header", revMajor="1", revMinor="7", name=name, version="1.00",
        north=_number(north), south=_number(south), east=_number(east), west=_number(west), vendor="scenarionet-lake",
    )  # fmt: skip
    # Not as <offset>: readers that know it move the map away from the positions of an OpenSCENARIO file.
    Xml.SubElement(header, "userData", code="origin", value=" ".join(map(_number, origin.tolist())))
    root.append(header)
    signals = signals_of(network)
    for road in network.roads:
        root.append(_road(road, network, features, signals.get(road.number, [])))
    for element in _controllers(signals):
        root.append(element)
    for element in _junctions(network):
        root.append(element)
    Xml.indent(root, " ")
    text: bytes = Xml.tostring(root, "utf-8", xml_declaration=True)
    return text + b"\n"


def _road(road: LaneRoad, network: RoadNetwork, features: MapFeatures, signals: list[LightSignal]) -> Xml.Element:
    element = Xml.Element(
        "road", name="", length=_number(road.curve.length), id=str(road.number + 1),
        junction="-1" if road.junction is None else str(_junction_id(network, road.junction)), rule="RHT",
    )  # fmt: skip
    link = Xml.SubElement(element, "link")
    for tag, end, contact in (("predecessor", road.start, "end"), ("successor", road.end, "start")):
        if end.road is not None:
            Xml.SubElement(link, tag, elementType="road", elementId=str(end.road + 1), contactPoint=contact)
        elif end.junction is not None:
            junction = str(_junction_id(network, end.junction))
            Xml.SubElement(link, tag, elementType="junction", elementId=junction)
    limits = [float(features.speed_limit[row]) for row in road.lanes if row >= 0]
    kind = Xml.SubElement(element, "type", s="0", type="town")
    if limits and np.isfinite(limits).all():
        Xml.SubElement(kind, "speed", max=_number(max(limits)), unit="m/s")
    element.append(_plan_view(road))
    profile = Xml.Element("elevationProfile")
    for start, height, slope in _lines(road.curve.stations, road.curve.points[:, 2], _FINEST_WIDTH):
        Xml.SubElement(profile, "elevation", s=start, a=height, b=slope, c="0", d="0")
    element.append(profile)
    element.append(_lanes(road, features))
    if signals:
        holder = Xml.SubElement(element, "signals")
        for signal in signals:
            holder.append(signal.element(road))
    return element


def _plan_view(road: LaneRoad) -> Xml.Element:
    view, curve = Xml.Element("planView"), road.curve
    for piece, coefficients in enumerate(curve.coefficients):
        cos, sin = curve.tangent[piece]
        local = coefficients[1:] @ np.array([[cos, -sin], [sin, cos]])
        geometry = Xml.SubElement(
            view, "geometry", s=_number(curve.stations[piece]), x=_number(curve.points[piece, 0]),
            y=_number(curve.points[piece, 1]), hdg=_number(float(np.arctan2(sin, cos))),
            length=_number(curve.stations[piece + 1] - curve.stations[piece]),
        )  # fmt: skip
        if np.abs(local[:, 1]).max() < _STRAIGHT:
            Xml.SubElement(geometry, "line")
            continue
        (b_u, b_v), (c_u, c_v), (d_u, d_v) = local.tolist()
        Xml.SubElement(
            geometry, "paramPoly3", pRange="normalized", aU="0", bU=_number(b_u), cU=_number(c_u), dU=_number(d_u),
            aV="0", bV=_number(b_v), cV=_number(c_v), dV=_number(d_v),
        )  # fmt: skip
    return view


def _lanes(road: LaneRoad, features: MapFeatures) -> Xml.Element:
    lanes = Xml.Element("lanes")
    for start, offset, slope in _lines(road.stations, road.borders[0], _FINEST_WIDTH):
        Xml.SubElement(lanes, "laneOffset", s=start, a=offset, b=slope, c="0", d="0")
    section = Xml.SubElement(lanes, "laneSection", s="0")
    center = Xml.SubElement(Xml.SubElement(section, "center"), "lane", id="0", type="none", level="false")
    first = road.lanes[0]
    _mark(center, boundary_type(features, first, is_left=True) if first >= 0 else None)
    right = Xml.SubElement(section, "right")
    for place, row in enumerate(road.lanes):
        kind = "driving" if row < 0 else _LANE_TYPES.get(MapFeatureType(features.feature_type[row]), "driving")
        lane = Xml.SubElement(right, "lane", id=str(-place - 1), type=kind, level="false")
        links = [
            (tag, end.lanes[place]) for tag, end in (("predecessor", road.start), ("successor", road.end)) if end.lanes
        ]
        if links:
            link = Xml.SubElement(lane, "link")
            for tag, other in links:
                Xml.SubElement(link, tag, id=str(-other - 1))
        width = road.borders[place] - road.borders[place + 1]
        for start, wide, slope in _lines(road.stations, width, _FINEST_WIDTH):
            Xml.SubElement(lane, "width", sOffset=start, a=wide, b=slope, c="0", d="0")
        _mark(lane, boundary_type(features, row, is_left=False) if row >= 0 else None)
        if row >= 0 and np.isfinite(features.speed_limit[row]):
            Xml.SubElement(lane, "speed", sOffset="0", max=_number(float(features.speed_limit[row])), unit="m/s")
    return lanes


def _mark(lane: Xml.Element, boundary: MapFeatureType | None) -> None:
    kind, color = _MARKS.get(boundary, ("none", "standard")) if boundary is not None else ("none", "standard")
    Xml.SubElement(lane, "roadMark", sOffset="0", type=kind, color=color, width="0.12")


def _junction_id(network: RoadNetwork, junction: int) -> int:
    """Ids of junctions follow those of roads, as some readers keep both in one table."""
    return len(network.roads) + 1 + junction


def _junctions(network: RoadNetwork) -> Iterator[Xml.Element]:
    elements: dict[int, Xml.Element] = {}
    for connection in network.connections:
        number = _junction_id(network, connection.junction)
        element = elements.setdefault(number, Xml.Element("junction", id=str(number), name=""))
        entry = Xml.SubElement(
            element, "connection", id=str(len(element)), incomingRoad=str(connection.joint.road + 1),
            connectingRoad=str(connection.road + 1), contactPoint="start",
        )  # fmt: skip
        Xml.SubElement(entry, "laneLink", {"from": str(-connection.joint.lane - 1), "to": "-1"})
    yield from elements.values()


@dataclass(frozen=True)
class LightSignal:
    """A traffic light at the end of a lane.

    Attributes:
        number: Its id.
        place: Place of the lane in its road.
        station: Where it stands along the road [m].
        name: Id of the light in the scenario.
    """

    number: int
    place: int
    station: float
    name: str

    def element(self, road: LaneRoad) -> Xml.Element:
        """Return the signal, right of its lane."""
        beside = float(np.interp(self.station, road.stations, road.borders[self.place + 1]))
        signal = Xml.Element(
            "signal", s=_number(self.station), t=_number(beside - 0.5), id=str(self.number), name=self.name,
            dynamic="yes", orientation="+", zOffset="4", country="OpenDRIVE", type=_TRAFFIC_LIGHT, subtype="-1",
            value="-1", height="1", width="0.3",
        )  # fmt: skip
        Xml.SubElement(signal, "validity", fromLane=str(-self.place - 1), toLane=str(-self.place - 1))
        return signal


def _signals(scenario: ScenarioDescription, network: RoadNetwork, losses: Losses) -> dict[int, list[LightSignal]]:
    """The traffic lights of each road, at its end: SUMO would divide a road that has one before."""
    if scenario.map is None:
        return {}
    row_of = {feature: row for row, feature in enumerate(scenario.map.ids)}
    found: dict[int, list[LightSignal]] = {}
    for number, (lane, light, stop) in enumerate(
        zip(scenario.lights.lane_ids, scenario.lights.ids, scenario.lights.stop_point, strict=True), start=1
    ):
        place = network.place_of.get(row_of.get(lane, -1))
        if place is None:
            losses.leave_out("traffic lights of lanes outside of the map")
            continue
        road = network.roads[place[0]]
        if not np.isnan(stop[:2]).any():
            samples, stations, _ = road.curve.sample(0.25)
            before = road.curve.length - float(stations[np.argmin(np.hypot(*(samples - stop[:2]).T))])
            losses.approximate(
                "stop points of traffic lights, which stand at the end of their lane", int(before > 0.5), before, "m"
            )
        found.setdefault(road.number, []).append(LightSignal(number, place[1], road.curve.length, str(light)))
    losses.leave_out("states of traffic lights", int((scenario.lights.state != 0).sum()))
    return found


def _controllers(signals: Mapping[int, list[LightSignal]]) -> Iterator[Xml.Element]:
    """One controller for each light, which OpenSCENARIO's traffic signals refer to."""
    for signal in (signal for found in signals.values() for signal in found):
        controller = Xml.Element("controller", id=str(signal.number), name=f"light-{signal.number}", sequence="0")
        Xml.SubElement(controller, "control", signalId=str(signal.number), type="0")
        yield controller


def _lines(stations: Float64, values: Float64, tolerance: float) -> Iterator[tuple[str, str, str]]:
    """Pieces of a function of the station that is linear between points: start, value there and slope.

    Args:
        stations, values: (S,).
        tolerance: Largest deviation.
    """
    kept = [0]
    while kept[-1] < len(stations) - 1:
        kept.append(_farthest(stations, values, kept[-1], tolerance))
    for first, last in pairwise(kept):
        slope = (values[last] - values[first]) / (stations[last] - stations[first])
        yield _number(stations[first]), _number(values[first]), _number(slope)


def _farthest(stations: Float64, values: Float64, first: int, tolerance: float) -> int:
    """The last point up to which a line from ``first`` stays within the tolerance of all points between."""
    low, high = -np.inf, np.inf
    for last in range(first + 1, len(stations)):
        span = stations[last] - stations[first]
        slope = (values[last] - values[first]) / span
        if not low <= slope <= high:
            return last - 1
        low = max(low, slope - tolerance / span)
        high = min(high, slope + tolerance / span)
    return len(stations) - 1


def _number(value: float) -> str:
    """A number to a tenth of a micrometre, the same on every machine."""
    return repr(round(float(value), 9) + 0.0)


__all__ = ["OpenDriveWriter", "write_features", "write_map"]
