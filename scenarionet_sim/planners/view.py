"""What a planner sees: its vehicle, the objects around it, its route, the lanes and the lights, in metres and named.

A view takes less than 100 microseconds to build, whole: its parts are built when they are read, and are views of the
simulation's arrays where they need no transformation. N objects, K past moments, P points of the route, M lanes, L
lights.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int32, IntP, Object, UInt8
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS
from scenarionet_sim.arrays.log import ARC, HEADING, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.planners.frame import ViewFrame
from scenarionet_sim.worlds.path_kernels import locate_point
from scenarionet_sim.worlds.routes import ways_beyond

if TYPE_CHECKING:
    from scenarionet_sim.roads.roads import Roads
    from scenarionet_sim.worlds.state import State
    from scenarionet_sim.worlds.world import World


@dataclass(slots=True, eq=False)
class EgoView:
    """The vehicle that the planner drives.

    Attributes:
        x, y: Centre of its box [m], in the view's frame.
        heading: [rad], in the view's frame.
        speed: Along the heading [m/s]; negative backwards.
        acceleration: Along the heading, over the last step [m/s²]; 0 in the first.
        yaw_rate: [rad/s].
        length, width, height: [m].
    """

    x: float
    y: float
    heading: float
    speed: float
    acceleration: float
    yaw_rate: float
    length: float
    width: float
    height: float


@dataclass(slots=True, eq=False)
class ObjectsView:
    """The other present objects, N of them.

    Attributes:
        rows: (N,) rows in the simulation's state; stable within an episode.
        track_ids: (N,) str.
        object_type: (N,) uint8 codes of ``ObjectType``.
        position: (N, 2) centres of their boxes [m].
        heading: (N,) [rad].
        velocity: (N, 2) [m/s].
        size: (N, 3) length, width, height [m].
        past_position, past_heading, past_present: (K, N, 2) [m], (K, N) [rad], (K, N) the moments before, latest
            first, K as the planner's ``history``; empty without one.
    """

    rows: IntP
    track_ids: Object
    object_type: UInt8
    position: Float64
    heading: Float64
    velocity: Float64
    size: Float64
    past_position: Float64
    past_heading: Float64
    past_present: Bool

    def __len__(self) -> int:
        return len(self.rows)


@dataclass(slots=True, eq=False)
class RouteView:
    """The way to take, from the recording or along the lanes.

    Attributes:
        centreline: (P, 2) [m].
        heading: (P,) [rad].
        arc: (P,) distance along the route [m].
        lanes: Rows of the lanes to take, in order; empty off the map.
        speed_limit: (P,) of the lane there [m/s]; NaN where unknown.
        beyond: (B, 2) points every 2 m along the lanes after its end, at most 200 m [m]; empty where the lanes end.
        position, lateral: Where the ego is: distance along the route and offset to its left [m]; before the start and
            beyond the end, the route goes on straight.
        stop_arc, stop_light: (S,) [m], (S,) rows of the lights that govern the route, where it meets their stop lines.
    """

    centreline: Array
    heading: Array
    arc: Float32
    lanes: IntP
    speed_limit: Float32
    beyond: Array
    position: float
    lateral: float
    stop_arc: Float32
    stop_light: Int32


@dataclass(slots=True, eq=False)
class LightsView:
    """The traffic lights.

    Attributes:
        lane: (L,) row of the lane that each governs; -1 where the map lacks it.
        stop: (L, 2) stop point [m]; NaN where unknown.
        state: (L,) uint8 codes of ``LightState``.
        color: (L,) uint8 codes of ``LightColor``: unknown, green, yellow, red.
    """

    lane: Int32
    stop: Array
    state: UInt8
    color: UInt8


@dataclass(frozen=True, eq=False)
class LanesView:
    """The M lanes of the map.

    Attributes:
        roads: The map, in the scenario's frame.
        frame: The view's frame.
    """

    roads: Roads
    frame: ViewFrame

    def __len__(self) -> int:
        return self.roads.num_lanes

    def centreline(self, lane: int) -> Array:
        """Return the points (n, 2) of a lane in driving direction [m]."""
        return self.frame.points(self.roads.lanes[lane])

    def successors(self, lane: int) -> Int32:
        """Return the rows of the lanes that follow one."""
        return self.roads.successors[lane]

    def speed_limit(self, lane: int) -> float:
        """Return the limit of a lane [m/s]; NaN if unknown."""
        return float(self.roads.speed_limit[lane])

    def is_on_road(self, points: Array) -> Bool:
        """Return whether points (..., 2) are on a lane or another drivable area."""
        return self.roads.is_on_road(self.frame.points_to_scenario(points))


class View:
    """A moment of a world as the planner of one vehicle sees it.

    Args:
        world: The scenario, as the simulation plays it.
        state: The simulation's state.
        slot, row: The world in the state, and the vehicle in the world.
        frame: ``ego`` for the vehicle's own frame (x forward, y to the left), ``scenario`` for the scenario's.
        speed_before: Speed of the vehicle a step before [m/s]; None in the first.
        arc_before: Where it was on its route then [m], if that is known.
        skip: Moments at the beginning of the state's history that are not past.

    Attributes:
        world, state, slot, row: What it shows, for planners that need more; only to read.
        scenario_id: The scenario.
        dt: Seconds until the planner is asked again.
        time: Seconds since the beginning of the recording.
        frame: Where the view is in the scenario's frame.
    """

    def __init__(
        self,
        world: World,
        state: State,
        slot: int,
        row: int,
        frame: str = "scenario",
        speed_before: float | None = None,
        arc_before: float = math.nan,
        skip: int = 0,
    ) -> None:
        self.world, self.state, self.slot, self.row = world, state, slot, row
        self._own = own = state.motion[slot, row].tolist()
        self._speed_before, self._skip, self._arc = speed_before, skip, arc_before
        self.scenario_id, self.dt = world.scenario_id, world.dt
        self.timestep = int(state.timestep[slot])
        self.time = self.timestep * world.dt
        self.frame = ViewFrame(own[X], own[Y], own[HEADING], is_scenario=False) if frame == "ego" else _SCENARIO

    @cached_property
    def ego(self) -> EgoView:
        """The vehicle that the planner drives."""
        own, is_scenario = self._own, self.frame.is_scenario
        heading = own[HEADING]
        along = math.cos(heading) * own[VX] + math.sin(heading) * own[VY]
        speed = math.copysign(math.hypot(own[VX], own[VY]), along)
        before = speed if self._speed_before is None else self._speed_before
        length, width, height = self.state.size[self.slot, self.row].tolist()
        x, y, heading = (own[X], own[Y], heading) if is_scenario else (0.0, 0.0, 0.0)
        return EgoView(x, y, heading, speed, (speed - before) / self.dt, own[YAW_RATE], length, width, height)

    @cached_property
    def objects(self) -> ObjectsView:
        """The other present objects."""
        state, slot, frame = self.state, self.slot, self.frame
        present = state.present[slot].copy()
        present[self.row] = False
        rows = np.flatnonzero(present)
        motion = state.motion[slot].take(rows, axis=0)
        return ObjectsView(
            rows,
            self.world.track_ids[rows],
            state.object_type[slot, rows],
            *frame.motion(motion),
            state.size[slot].take(rows, axis=0),
            *self._past(rows),
        )

    @cached_property
    def past_poses(self) -> Float64:
        """(K, 3) the vehicle's own x, y [m] and heading [rad] before, latest first; NaN before the episode."""
        position, heading, present = self._past(np.array([self.row]))
        if not len(present):
            return np.zeros((0, 3))
        poses = np.concatenate([position[:, 0], heading], axis=1)
        poses[~present[:, 0]] = np.nan
        return poses

    @cached_property
    def route(self) -> RouteView:
        """The way to take."""
        world, row = self.world, self.row
        first, end = world.paths.path_offsets[row : row + 2].tolist()
        lanes, limits, beyond = _lanes_of(world, row)
        stops = slice(world.stops.stop_offsets[row], world.stops.stop_offsets[row + 1])
        position = lateral = 0.0
        if first < end:  # near the last place, as a route may cross itself
            low, high = (-math.inf, math.inf) if math.isnan(self._arc) else (self._arc - _BACK, self._arc + _AHEAD)
            position, lateral = locate_point(world.paths.path, first, end, self._own[X], self._own[Y], low, high)
            self._arc = position
        return RouteView(
            *self.frame.path(world.paths.path, first, end),
            world.paths.path[first:end, ARC],
            lanes,
            limits,
            self.frame.points(beyond),
            position,
            lateral,
            world.stops.stop_arc[stops],
            world.stops.stop_light[stops],
        )

    @cached_property
    def goal(self) -> Array:
        """(2,) end of the route [m]."""
        end = self.world.paths.path_offsets[self.row + 1] - 1
        return self.frame.points(self.world.paths.path[end, :2])

    @cached_property
    def lights(self) -> LightsView:
        """The traffic lights, as at the end of the recording after it."""
        world = self.world
        state = world.light_state[:, min(self.timestep, world.num_steps - 1)]
        return LightsView(world.light_lane, self.frame.points(world.light_stop), state, LIGHT_COLORS[state])

    @cached_property
    def lanes(self) -> LanesView:
        """The lanes of the map."""
        return LanesView(self.world.roads, self.frame)

    @property
    def known_arc(self) -> float:
        """Where the vehicle is on its route, or was when that was last looked up [m]; NaN before."""
        return self._arc

    @property
    def log(self) -> Float32:
        """(T, 8) the vehicle's own recording in the scenario's frame, columns as in ``World.log``."""
        return self.world.log[:, self.row]

    def _past(self, rows: IntP) -> tuple[Float64, Float64, Bool]:
        history = self.state.history
        if history is None or len(history.present) <= self._skip:
            return _NO_PAST
        past = np.s_[self._skip :, self.slot]
        position, heading = history.position[past].take(rows, axis=1), history.heading[past].take(rows, axis=1)
        present: Bool = history.present[past].take(rows, axis=1)
        return self.frame.points(position), self.frame.angles(heading), present


_SCENARIO = ViewFrame()
_NO_PAST = np.zeros((0, 0, 2)), np.zeros((0, 0)), np.zeros((0, 0), np.bool_)

_BACK, _AHEAD = 10.0, 20.0
"""Search window on the route around the last known location [m]."""

_ON_LANE = 2.5
"""Largest distance of a route from the centreline of a lane that it takes [m]."""

_BEYOND = 200.0
"""Length of the way along the lanes after the end of a route [m]."""

_ROUTES: WeakKeyDictionary[World, dict[int, tuple[IntP, Float32, Float64]]] = WeakKeyDictionary()


def _lanes_of(world: World, row: int) -> tuple[IntP, Float32, Float64]:
    """Lanes along the path of an object, the speed limit (P,) at its points [m/s], the way beyond; looked up once."""
    known = _ROUTES.setdefault(world, {})
    if row not in known:
        roads, paths = world.roads, world.paths
        path = paths.path[paths.path_offsets[row] : paths.path_offsets[row + 1]]
        lane = roads.lanes_along(path[:, :2], path[:, HEADING], _ON_LANE)[:, 0].astype(np.intp)
        limits = np.append(roads.speed_limit, np.float32(np.nan))[lane]  # -1 is the last
        lanes = lane[np.flatnonzero(np.diff(lane, prepend=-1))]
        way, count = ways_beyond(roads, paths, np.array([row] if len(path) else [], np.intp), _BEYOND)
        known[row] = lanes[lanes >= 0], limits, way[0, : count[0]] if len(path) else np.zeros((0, 2))
    return known[row]
