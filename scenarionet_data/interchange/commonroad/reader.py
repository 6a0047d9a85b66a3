"""Read CommonRoad's scenarios (2018b and 2020a): lanelets, obstacles, traffic lights and a planning problem.

The ego is that of the first planning problem. It drives as in the solution beside the file (``NAME.solution.xml``, as
the writer leaves it); without one it is seen where the problem begins, and its goal stands in its ``extras``.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar
from xml.etree.ElementTree import Element

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int64, UInt8
from scenarionet_data.converters.formats.xml_files import read_xml, to_number
from scenarionet_data.errors import BadParameter, CorruptSource
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.options import Options, option
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.interchange.commonroad.layout import OBJECT_OF_WORD, SOLUTION, STATE_OF_COLOR, WAITING
from scenarionet_data.interchange.commonroad.map_reader import points_of, read_map
from scenarionet_data.interchange.scene_files import FileScene, SceneFiles, SceneLight, SceneObject
from scenarionet_data.scenario.vocabulary import LightState, ObjectType

_EGO_SIZE = (4.508, 1.610, 1.6)
"""Length, width and height [m] of a BMW 320i, CommonRoad's usual vehicle."""
_HEIGHT = 1.6
"""Height of obstacles [m], which have none."""
_LONGEST = 100_000
"""Timesteps of a scenario; later ones are no mistake of a recording but of the file."""
_VERSIONS = ("2018b", "2020a")


@dataclass(frozen=True)
class CommonRoadOptions(Options):
    """Which vehicle is the ego."""

    ego: str = option(
        "problem",
        "problem: that of the planning problem, which has one state unless a solution lies beside the file; "
        "longest: the vehicle seen longest.",
    )

    def __post_init__(self) -> None:
        if self.ego not in ("problem", "longest"):
            raise BadParameter(f"ego: expected problem or longest, found {self.ego!r}")


class CommonRoad(SceneFiles):
    """CommonRoad's scenarios."""

    name: ClassVar[str] = "commonroad"
    licence: ClassVar[str] = "that of the recordings; of CommonRoad's benchmarks: see each scenario"
    raw: ClassVar[str] = "a folder of CommonRoad scenarios (*.xml)"
    pattern: ClassVar[str] = "*.xml"
    sidecars: ClassVar[tuple[str, ...]] = (SOLUTION,)
    Options = CommonRoadOptions

    def inputs(self, path: Path) -> list[Path]:
        """Return a scenario with the solution beside it."""
        beside = path.with_suffix(SOLUTION)
        return [path, beside] if beside.is_file() else [path]

    def files(self, shard: Shard) -> Iterator[list[str]]:
        """The scenarios, and solutions where there are any."""
        yield [name for item in shard.items for name in (item.name, item.name.removesuffix(".xml") + SOLUTION)]

    def scene(self, path: Path, shard: Shard, defects: Defects) -> FileScene:
        """Read a file."""
        root, file = read_xml(path, "commonRoad"), path.relative_to(shard.root).as_posix()
        version, dt = root.get("commonRoadVersion", ""), to_number(root.get("timeStepSize"))
        if version not in _VERSIONS:
            raise CorruptSource(f"{path}: expected CommonRoad {' or '.join(_VERSIONS)}, found {version[:64] or 'none'}")
        if not 1e-3 <= dt <= 60.0:
            found = root.get("timeStepSize", "")[:64]
            raise CorruptSource(f"{path}: expected timesteps of 0.001 to 60 s, found {found or 'none'}")
        reader = _ObstacleReader(root, file, defects)
        objects = reader.obstacles()
        ego = None
        if shard.options_as(CommonRoadOptions).ego == "problem":
            ego = reader.ego(path.with_suffix(SOLUTION))
        tracks = [*objects, *([ego] if ego is not None else [])]
        num_steps = reader.count_steps(tracks)
        return FileScene(
            [each.over(num_steps, dt, reader.shift) for each in tracks],
            (),
            reader.lights(num_steps),
            ego=len(objects) if ego is not None else None,
            dt=dt,
            current=0,
            features=read_map(root, reader.shift, file, defects),
        )


@dataclass(frozen=True, eq=False)
class _Track:
    """States of an object at some timesteps; of an obstacle that stands, one state that holds at all.

    Attributes:
        steps: (S,) timesteps.
        states: (S, 5) x, y [m], heading [rad], and velocity ahead and to the left [m/s], NaN if it is not known.
        goal: (3,) where it shall go [m], source frame.
    """

    id: str
    kind: ObjectType
    size: tuple[float, float, float]
    steps: Int64
    states: Float64
    stands: bool = False
    goal: Float64 | None = None

    def over(self, num_steps: int, dt: float, shift: Float64) -> SceneObject:
        """Return the object over all timesteps of a scenario."""
        grid, valid = np.zeros((num_steps, 5)), np.zeros(num_steps, np.bool_)
        steps = slice(None) if self.stands else self.steps
        grid[steps], valid[steps] = self.states, True
        heading = grid[:, 2]
        cos, sin = np.cos(heading), np.sin(heading)
        velocity = np.column_stack([grid[:, 3] * cos - grid[:, 4] * sin, grid[:, 3] * sin + grid[:, 4] * cos])
        is_estimated = bool(np.isnan(velocity[valid]).any())
        if is_estimated:
            velocity[valid] = 0.0
            if len(self.steps) > 1:
                velocity[self.steps] = np.gradient(self.states[:, :2], self.steps * dt, axis=0)
        position = np.column_stack([grid[:, :2], np.zeros(num_steps)]) + shift
        extras = {} if self.goal is None else {"goal_position": self.goal.tolist()}
        is_size_assumed = self.size == _EGO_SIZE
        return SceneObject(
            self.id, self.kind, position, velocity, heading, valid, self.size, extras, is_size_assumed, is_estimated
        )


class _ObstacleReader:
    """Reads the obstacles, the ego and the lights of a file."""

    def __init__(self, root: Element, file: str, defects: Defects) -> None:
        self.root, self.file, self.defects = root, file, defects
        moved = root.find("location/geoTransformation/additionalTransformation")
        shift = [0.0, 0.0] if moved is None else [to_number(moved.findtext(f"{axis}Translation")) for axis in "xy"]
        self.shift = np.nan_to_num(np.array([*shift, 0.0]), posinf=0.0, neginf=0.0)

    def obstacles(self) -> list[_Track]:
        found = []
        for element in self.root:
            if element.tag in ("environmentObstacle", "phantomObstacle"):
                reason = f"expected obstacles with states, found a {element.tag}"
                self.defects.drop("tracks", self.file, [element.get("id", "")[:64]], "obstacle", reason)
            if element.tag not in ("dynamicObstacle", "staticObstacle", "obstacle"):
                continue
            name, shape = element.get("id", ""), element.find("shape")
            initial = element.find("initialState")
            given = [] if initial is None else [_state(initial)]
            given += [_state(each) for each in element.findall("trajectory/state")]
            given += [_state(each) for each in element.findall("occupancySet/occupancy")]
            stands = element.tag == "staticObstacle" or (element.findtext("role") or "").strip() == "static"
            steps, states = self._usable(name, given[:1] if stands else given)
            word = (element.findtext("type") or "").strip()
            if not len(steps) or not name:
                self.defects.drop(
                    "tracks", self.file, [f"obstacle {name[:64]}"], "state", "expected states, found none"
                )
                continue
            kind = OBJECT_OF_WORD.get(word, ObjectType.OTHER)
            found.append(_Track(name, kind, _size(shape), steps, states, stands))
        return found

    def ego(self, solution: Path) -> _Track | None:
        """The vehicle of the first planning problem, as in the solution if there is one."""
        problems = self.root.findall("planningProblem")
        initial = problems[0].find("initialState") if problems else None
        if initial is None:
            return None
        if len(problems) > 1:
            reason = f"expected one planning problem, found {len(problems)}: the first is the ego's"
            self.defects.assume("tracks", self.file, ["the whole file"], "ego", reason)
        name, given = problems[0].get("id", "") or "ego", [_state(initial)]
        goal = _place(problems[0].find("goalState/position"))
        if solution.is_file():
            root = read_xml(solution, "CommonRoadSolution")
            paths = [path for path in root if path.get("planningProblem") == problems[0].get("id")]
            given = [_solved(each) for path in paths for each in path] or given
        steps, states = self._usable(name, given)
        if not len(steps):
            return None
        target = np.array([*goal, 0.0]) + self.shift if np.isfinite(goal).all() else None
        return _Track(name, ObjectType.VEHICLE, _EGO_SIZE, steps, states, goal=None if len(steps) > 1 else target)

    def count_steps(self, tracks: list[_Track]) -> int:
        """Timesteps up to the last state; of a problem alone, up to its end."""
        last = max((int(track.steps[-1]) for track in tracks), default=0)
        end = to_number(self.root.findtext("planningProblem/goalState/time/intervalEnd"))
        return 1 + (int(end) if last == 0 and 0 <= end <= _LONGEST else last)

    def lights(self, num_steps: int) -> list[SceneLight]:
        """The lights of each lane that refers to some, with the state of their cycle at each timestep."""
        lights = {light.get("id", ""): light for light in self.root.findall("trafficLight")}
        found, missing = [], []
        for lanelet in self.root.findall("lanelet"):
            lane = lanelet.get("id", "")
            for ref in (each.get("ref", "") for each in lanelet.findall("trafficLightRef")):
                if ref not in lights:
                    missing.append(f"{ref[:64]} of lanelet {lane[:64]}")
                    continue
                state = _cycle(lights[ref], num_steps)
                place = _place(lights[ref].find("position"))
                stop = np.array([*place, 0.0]) + self.shift if np.isfinite(place).all() else np.full(3, np.nan)
                if state is None:
                    missing.append(f"{ref[:64]} of lanelet {lane[:64]}")
                else:
                    found.append(SceneLight(lane, state, stop, ref))
        reason = f"expected traffic lights of the file with a cycle, found {', '.join(missing[:1])}"
        self.defects.drop("lights", self.file, missing, "trafficLightRef", reason)
        return found

    def _usable(self, name: str, given: list[tuple[float, ...]]) -> tuple[Int64, Float64]:
        """Timesteps and states in order, without those that have no timestep of their own, or in which it waits."""
        found: dict[int, tuple[float, ...]] = {}
        bad = []
        for time, *state in given:
            if not 0 <= time <= _LONGEST or time != int(time) or int(time) in found:
                bad.append(f"{time:g} of {name[:64]}")
            else:
                found[int(time)] = tuple(state)
        reason = f"expected a timestep of its own, up to {_LONGEST:,}, found {', '.join(bad[:1])}"
        self.defects.drop("tracks", self.file, bad, "time", reason)
        kept = sorted(step for step, state in found.items() if state[:2] != WAITING)
        return np.array(kept, np.int64), np.array([found[step] for step in kept]).reshape(-1, 5)


def _state(element: Element) -> tuple[float, ...]:
    """Timestep, x, y, heading, and velocity ahead and to the left of a state, or of the area that is occupied."""
    speed, slip, lateral = (_value(element.find(tag)) for tag in ("velocity", "slipAngle", "velocityY"))
    if np.isnan(lateral):
        lateral = 0.0 if np.isnan(slip) else speed * np.sin(slip)
        speed = speed if np.isnan(slip) else speed * np.cos(slip)
    heading, place, area = _value(element.find("orientation")), element.find("position"), element.find("shape")
    if area is not None:
        place, heading = area, to_number(area.findtext("rectangle/orientation", "0"))
    return _value(element.find("time")), *_place(place), heading, speed, lateral


def _solved(element: Element) -> tuple[float, ...]:
    """The same of a state of a solution, by any of its models of a vehicle."""
    values = {each.tag: to_number(each.text) for each in element}
    along_x, along_y, slip = (values.get(tag, np.nan) for tag in ("xVelocity", "yVelocity", "slipAngle"))
    heading, speed = values.get("orientation", np.nan), values.get("velocity", np.nan)
    if element.tag == "pmState":  # a point that moves
        heading, speed = float(np.arctan2(along_y, along_x)), float(np.hypot(along_x, along_y))
    slip = 0.0 if np.isnan(slip) else slip
    place = values.get("x", np.nan), values.get("y", np.nan)
    return values.get("time", np.nan), *place, heading, speed * np.cos(slip), speed * np.sin(slip)


def _value(element: Element | None) -> float:
    """A number, or the middle of an interval; NaN for anything else."""
    if element is None:
        return np.nan
    if (exact := element.findtext("exact")) is not None:
        return to_number(exact)
    return 0.5 * (to_number(element.findtext("intervalStart")) + to_number(element.findtext("intervalEnd")))


def _place(element: Element | None) -> tuple[float, float]:
    """The point, or the middle of the first shape, below an element [m]; NaN if it has none."""
    for shape in () if element is None else element:
        if shape.tag == "polygon":
            x, y, _ = points_of(shape).mean(axis=0).tolist()
            return x, y
        point = shape if shape.tag == "point" else shape.find("center")
        if point is not None:
            return to_number(point.findtext("x")), to_number(point.findtext("y"))
    return np.nan, np.nan


def _size(shape: Element | None) -> tuple[float, float, float]:
    """Length, width and height of the first shape of an obstacle [m]; zeros, which are refused, if it has none."""
    for each in () if shape is None else shape:
        if each.tag == "rectangle":
            return to_number(each.findtext("length")), to_number(each.findtext("width")), _HEIGHT
        if each.tag == "circle":
            diameter = 2.0 * to_number(each.findtext("radius"))
            return diameter, diameter, _HEIGHT
        if len(points := points_of(each)):
            length, width, _ = np.ptp(points, axis=0).tolist()
            return length, width, _HEIGHT
    return 0.0, 0.0, _HEIGHT


def _cycle(light: Element, num_steps: int) -> UInt8 | None:
    """State of a light at each timestep; None if its cycle cannot be used."""
    parts = light.findall("cycle/cycleElement")
    lengths = np.array([to_number(each.findtext("duration")) for each in parts])
    colors = [
        STATE_OF_COLOR.get((each.findtext("color") or "").strip(), LightState.LANE_STATE_UNKNOWN) for each in parts
    ]
    offset = to_number(light.findtext("cycle/timeOffset", "0"))
    if not len(parts) or not (lengths > 0).all() or not np.isfinite([*lengths, offset]).all():
        return None
    ends = np.cumsum(lengths)
    place = np.searchsorted(ends, (np.arange(num_steps) - offset) % ends[-1], side="right")
    states: UInt8 = np.array(colors, np.uint8)[place.clip(max=len(parts) - 1)]
    return states
