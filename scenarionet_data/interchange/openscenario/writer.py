"""Write scenarios as OpenSCENARIO XML 1.2 or 1.3, whose objects follow their recorded paths over an OpenDRIVE map."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar
from xml.etree import ElementTree as Xml

import numpy as np

from scenarionet_data.errors import BadParameter
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.opendrive.writer import write_map
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightColor, ObjectType

PREFIX = "object-"
"""Of the names of objects other than the ego, which are their ids."""
_VERSIONS = ("1.2", "1.3")
_CATEGORIES = {
    ObjectType.VEHICLE: ("Vehicle", "car"),
    ObjectType.CYCLIST: ("Vehicle", "bicycle"),
    ObjectType.PEDESTRIAN: ("Pedestrian", "pedestrian"),
    ObjectType.TRAFFIC_BARRIER: ("MiscObject", "barrier"),
    ObjectType.BUILDING: ("MiscObject", "building"),
}
_OTHER = ("MiscObject", "obstacle")
_MASS = "80"  # [kg] of pedestrians and obstacles, which the format wants and no source has
_TURN = 1e-6  # [rad] also of slow turns, which add up
_NUDGE = 1e-4  # [m] an object that turns on the spot: players find headings by the length of a path
_PHASES = {LightColor.RED: "red", LightColor.YELLOW: "yellow", LightColor.GREEN: "green", LightColor.UNKNOWN: "off"}


@dataclass(frozen=True)
class OpenScenarioWriter:
    """Writes one .xosc file a scenario, and its map as .xodr; scenarios with the same shared map share its file.

    Attributes:
        version: Version of the format, 1.2 or 1.3.
        leave_ego: Place the ego only, at its first position and speed, for another simulator to drive it.
    """

    name: ClassVar[str] = "openscenario"
    version: str = _VERSIONS[0]
    leave_ego: bool = False

    def __post_init__(self) -> None:
        if self.version not in _VERSIONS:
            raise BadParameter(f"version: wanted {' or '.join(_VERSIONS)}, found {self.version!r}")

    def write(self, scenario: ScenarioDescription, stem: str, losses: Losses) -> Mapping[str, bytes]:
        """Return the files of a scenario; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        of_map = Losses()
        road_map = write_map(scenario, of_map)
        losses.add(loss for loss in of_map.found() if loss.what != "states of traffic lights")
        map_name = f"{stem}.xodr"
        if scenario.map_id is not None:
            map_name = f"map-{hashlib.blake2b(road_map, digest_size=8).hexdigest()}.xodr"
        root = Xml.Element("OpenSCENARIO")
        major, _, minor = self.version.partition(".")
        Xml.SubElement(
            root, "FileHeader", revMajor=major, revMinor=minor, date="1970-01-01T00:00:00", author="scenarionet-lake",
            description=scenario.id,
        )  # fmt: skip
        Xml.SubElement(root, "CatalogLocations")
        network = Xml.SubElement(root, "RoadNetwork")
        Xml.SubElement(network, "LogicFile", filepath=map_name)
        element = Xml.Element("TrafficSignals")
        times = np.append(scenario.timestamps, scenario.timestamps[-1] + scenario.dt)
        for number, states in enumerate(LIGHT_COLORS[scenario.lights.state], start=1):
            if f'<controller id="{number}"'.encode() not in road_map:
                continue
            controller = Xml.SubElement(element, "TrafficSignalController", name=str(number))
            changes = [0, *(np.flatnonzero(np.diff(states)) + 1).tolist(), len(states)]
            for first, end in pairwise(changes):
                color = _PHASES[LightColor(states[first])]
                phase = Xml.SubElement(controller, "Phase", name=color, duration=_number(times[end] - times[first]))
                Xml.SubElement(phase, "TrafficSignalState", trafficSignalId=str(number), state=color)
        network.append(element)
        entities = Xml.SubElement(root, "Entities")
        names = ["Ego" if track == scenario.ego_id else f"{PREFIX}{track}" for track in scenario.tracks.ids]
        seen = [row for row in range(len(scenario.tracks)) if scenario.tracks.valid[row].any()]
        for row in seen:
            entities.append(_entity(scenario, row, names[row], losses))
        root.append(_storyboard(scenario, seen, names, self.leave_ego))
        appears = scenario.tracks.valid[:, 1:2] != scenario.tracks.valid[:, :1]
        losses.approximate(
            "objects that appear or disappear at the second timestep, and are shown longer",
            int(appears.sum()), scenario.dt, "s",
        )  # fmt: skip
        losses.leave_out("paths of egos, which another simulator drives", int(self.leave_ego))
        losses.leave_out("recorded velocities, which a player derives from positions", int(scenario.tracks.valid.sum()))
        text: bytes = Xml.tostring(root, "utf-8", xml_declaration=True)
        return {f"{stem}.xosc": text + b"\n", map_name: road_map}


def _entity(scenario: ScenarioDescription, row: int, name: str, losses: Losses) -> Xml.Element:
    tracks = scenario.tracks
    sizes = tracks.size[row, tracks.valid[row]]
    length, width, height = map(float, sizes[0])
    change = float(np.abs(sizes - sizes[0]).max())
    losses.approximate("objects whose size changes", int(change > 0.01), change, "m")
    tag, category = _CATEGORIES.get(ObjectType(tracks.object_type[row]), _OTHER)
    holder = Xml.Element("ScenarioObject", name=name)
    element = Xml.SubElement(holder, tag, name=category)
    element.set(
        {"Vehicle": "vehicleCategory", "Pedestrian": "pedestrianCategory"}.get(tag, "miscObjectCategory"), category
    )
    if tag != "Vehicle":
        element.set("mass", _MASS)
    box = Xml.SubElement(element, "BoundingBox")
    Xml.SubElement(box, "Center", x="0", y="0", z=_number(height / 2))
    Xml.SubElement(box, "Dimensions", length=_number(length), width=_number(width), height=_number(height))
    if tag == "Vehicle":
        Xml.SubElement(element, "Performance", maxSpeed="100", maxAcceleration="20", maxDeceleration="20")
        axles = Xml.SubElement(element, "Axles")
        # The reference point of a vehicle is its rear axle. It is put in the middle of the box, whose path is exact:
        # players turn a standing vehicle by its path, which would swing the box around a rear axle elsewhere.
        losses.approximate("rear axles of vehicles, which are in their middle", 1, 0.3 * length, "m")
        for axle, share in (("FrontAxle", 0.6), ("RearAxle", 0.0)):
            Xml.SubElement(
                axles, axle, maxSteering="0.6", wheelDiameter="0.6", trackWidth=_number(0.9 * width),
                positionX=_number(share * length), positionZ="0.3",
            )  # fmt: skip
    properties = Xml.SubElement(element, "Properties")
    # esmini turns an object within 2 m of a vertex only, unless it is told to do so all along.
    Xml.SubElement(properties, "Property", name="plineInterpolation", value="segment")
    return holder


def _storyboard(scenario: ScenarioDescription, rows: list[int], names: list[str], leave_ego: bool) -> Xml.Element:
    board, tracks = Xml.Element("Storyboard"), scenario.tracks
    actions = Xml.SubElement(Xml.SubElement(board, "Init"), "Actions")
    for row in rows:
        if not tracks.valid[row, 0]:
            action = Xml.SubElement(Xml.SubElement(actions, "GlobalAction"), "EntityAction", entityRef=names[row])
            Xml.SubElement(action, "DeleteEntityAction")
    for row in rows:
        first = int(np.argmax(tracks.valid[row]))
        private = Xml.SubElement(actions, "Private", entityRef=names[row])
        action = Xml.SubElement(private, "PrivateAction")
        _position(Xml.SubElement(action, "TeleportAction"), scenario, row, first)
        action = Xml.SubElement(Xml.SubElement(private, "PrivateAction"), "LongitudinalAction")
        action = Xml.SubElement(action, "SpeedAction")
        Xml.SubElement(action, "SpeedActionDynamics", dynamicsShape="step", dynamicsDimension="time", value="0")
        speed = _number(float(np.hypot(*tracks.velocity[row, first])))
        Xml.SubElement(Xml.SubElement(action, "SpeedActionTarget"), "AbsoluteTargetSpeed", value=speed)
    act = Xml.SubElement(Xml.SubElement(board, "Story", name="recording"), "Act", name="recording")
    for row in rows:
        if not (leave_ego and tracks.ids[row] == scenario.ego_id):
            act.append(_maneuvers(scenario, row, names[row]))
    _trigger(act, "StartTrigger", 0.0)
    _trigger(board, "StopTrigger", scenario.timestamps[-1])
    return board


def _maneuvers(scenario: ScenarioDescription, row: int, name: str) -> Xml.Element:
    """For each stretch of timesteps in which an object is seen: it appears, follows its path, and disappears."""
    group = Xml.Element("ManeuverGroup", name=name, maximumExecutionCount="1")
    Xml.SubElement(Xml.SubElement(group, "Actors", selectTriggeringEntities="false"), "EntityRef", entityRef=name)
    maneuver = Xml.SubElement(group, "Maneuver", name=name)
    changes = np.flatnonzero(np.diff(scenario.tracks.valid[row].astype(np.int8), prepend=0, append=0)).tolist()
    # Players act on the time of the step before. A quarter of a step early, whatever their sums of steps round to.
    before, last = np.maximum(scenario.timestamps - 0.25 * scenario.dt, 0.0), scenario.num_timesteps
    for first, end in zip(changes[::2], changes[1::2], strict=True):
        event = Xml.SubElement(maneuver, "Event", name=f"{name} from {first}", priority="parallel")
        event.set("maximumExecutionCount", "1")
        if first > 0:
            action = _entity_action(event, name, "AddEntityAction")
            _position(action, scenario, row, first)
        _follow(event, scenario, row, range(first, end))
        _trigger(event, "StartTrigger", before[max(first - 1, 0)])
        if end < last:  # not before the second step, as players act at once in the first
            event = Xml.SubElement(maneuver, "Event", name=f"{name} until {end}", priority="parallel")
            event.set("maximumExecutionCount", "1")
            _entity_action(event, name, "DeleteEntityAction")
            _trigger(event, "StartTrigger", before[max(end - 1, 1)])
    return group


def _entity_action(event: Xml.Element, name: str, tag: str) -> Xml.Element:
    action = Xml.SubElement(Xml.SubElement(event, "Action", name=tag), "GlobalAction")
    return Xml.SubElement(Xml.SubElement(action, "EntityAction", entityRef=name), tag)


def _follow(event: Xml.Element, scenario: ScenarioDescription, row: int, steps: range) -> None:
    action = Xml.SubElement(Xml.SubElement(event, "Action", name="follow"), "PrivateAction")
    follow = Xml.SubElement(Xml.SubElement(action, "RoutingAction"), "FollowTrajectoryAction")
    trajectory = Xml.SubElement(Xml.SubElement(follow, "TrajectoryRef"), "Trajectory", name="recorded", closed="false")
    line = Xml.SubElement(Xml.SubElement(trajectory, "Shape"), "Polyline")
    tracks = scenario.tracks
    turns = np.abs(np.diff(tracks.heading[row, steps.start : steps.stop])) > _TURN
    moves = np.diff(tracks.position[row, steps.start : steps.stop, :2], axis=0)
    on_the_spot = np.append(False, turns & (np.hypot(*moves.T) < _NUDGE))
    for step, is_nudged in zip(steps, np.cumsum(on_the_spot) % 2, strict=True):
        vertex = Xml.SubElement(line, "Vertex", time=_number(scenario.timestamps[step]))
        _position(vertex, scenario, row, step, _NUDGE * is_nudged)
    if len(steps) == 1:  # a line has two points; without one, a player moves the object on
        end = scenario.timestamps[steps[0]] + scenario.dt
        _position(Xml.SubElement(line, "Vertex", time=_number(end)), scenario, row, steps[0])
    timing = Xml.SubElement(follow, "TimeReference")
    Xml.SubElement(timing, "Timing", domainAbsoluteRelative="absolute", scale="1", offset="0")
    Xml.SubElement(follow, "TrajectoryFollowingMode", followingMode="position")


def _position(parent: Xml.Element, scenario: ScenarioDescription, row: int, step: int, nudge: float = 0.0) -> None:
    """Where an object stands on the ground, moved by ``nudge``; without recorded heights, the road says its height."""
    tracks = scenario.tracks
    x, y, z = tracks.position[row, step].tolist()
    world = Xml.SubElement(Xml.SubElement(parent, "Position"), "WorldPosition", x=_number(x + nudge), y=_number(y))
    if scenario.has_z:
        world.set("z", _number(z - 0.5 * float(tracks.size[row, step, 2])))
    world.set("h", _number(float(tracks.heading[row, step])))


def _trigger(parent: Xml.Element, tag: str, time: float) -> None:
    trigger = Xml.SubElement(Xml.SubElement(parent, tag), "ConditionGroup")
    condition = Xml.SubElement(trigger, "Condition", name="time", delay="0", conditionEdge="none")
    value = Xml.SubElement(condition, "ByValueCondition")
    Xml.SubElement(value, "SimulationTimeCondition", value=_number(time), rule="greaterOrEqual")


def _number(value: float) -> str:
    """A number to a micrometre."""
    return repr(round(float(value), 6) + 0.0)
