"""Vehicles in the traffic kernels: what they are, how they move at a moment, and which lanes they occupy."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.compiled import device_function
from scenarionet_data.arrays.dtypes import Bool, Float64, Int32
from scenarionet_data.procedural.graph import NONE, LaneGraph

STRADDLE = 0.3  # [m] from the new lane's centre until which a vehicle still blocks the lane it leaves
PLACES = 3  # a vehicle is on its lane, on the lane it leaves, and with its tail on the lane before


class Fleet(NamedTuple):
    """(N,) what each vehicle and its driver are: metres, seconds, m/s2; ``eagerness`` scales the desired speed."""

    length: Float64
    width: Float64
    eagerness: Float64
    headway: Float64
    accel: Float64
    decel: Float64
    standstill: Float64
    politeness: Float64


class State(NamedTuple):
    """(N,) how the vehicles move; the kernels change it in place.

    Attributes:
        active: False before and after a vehicle is on the map.
        destination: Row of ``LaneGraph.cost``.
        lane, s: Lane and distance along it [m] of the vehicle's centre.
        speed: Along its path [m/s].
        previous: The lane before.
        granted: The lane ahead it was granted to enter.
        origin: During a lane change, the lane it leaves.
        lateral: Offset to the left of the lane's centre at which the lane change began [m]; 0 without one.
        progress: Of the lane change, 0 to 1.
        span: Distance over which it is done [m].
        patience: Time until it may change lanes for advantage again [s].
    """

    active: Bool
    destination: Int32
    lane: Int32
    s: Float64
    speed: Float64
    previous: Int32
    granted: Int32
    origin: Int32
    lateral: Float64
    progress: Float64
    span: Float64
    patience: Float64


class Places(NamedTuple):
    """(N, 3) lanes that vehicles occupy, -1 where less than three, and the distance of their centre along them."""

    lane: Int32
    s: Float64


@device_function
def lateral_offset(state: State, i: int) -> tuple[float, float]:
    """Offset from the lane's centre [m] and its slope along the lane, of a smooth (quintic) lane change."""
    if state.lateral[i] == 0.0:
        return 0.0, 0.0
    u = state.progress[i]
    blend = u * u * u * (10.0 + u * (6.0 * u - 15.0))
    slope = 30.0 * u * u * (1.0 - u) ** 2 / state.span[i]
    return state.lateral[i] * (1.0 - blend), -state.lateral[i] * slope


@device_function
def occupy(graph: LaneGraph, fleet: Fleet, state: State, places: Places, i: int) -> None:
    """Write where vehicle ``i`` is."""
    places.lane[i] = NONE
    if not state.active[i]:
        return
    lane, s = state.lane[i], state.s[i]
    places.lane[i, 0], places.s[i, 0] = lane, s
    origin = state.origin[i]
    if origin != NONE and abs(lateral_offset(state, i)[0]) > STRADDLE:
        places.lane[i, 1], places.s[i, 1] = origin, s * graph.length[origin] / graph.length[lane]
    previous = state.previous[i]
    if previous != NONE and s - fleet.length[i] / 2.0 < 0.0:
        places.lane[i, 2], places.s[i, 2] = previous, graph.length[previous] + s


@device_function
def curvature_at(graph: LaneGraph, lane: int, s: float) -> float:
    """Curvature of a lane's centreline [1/m]."""
    row = graph.first[lane] + _segment(graph, lane, s)
    return float((graph.heading[row + 1] - graph.heading[row]) / graph.step[lane])


@device_function
def pose_at(graph: LaneGraph, lane: int, s: float) -> tuple[float, float, float]:
    """x, y, heading on a lane's centreline: cubic Hermite between its points, true to arcs within 0.1 mm."""
    segment = _segment(graph, lane, s)
    row, step = graph.first[lane] + segment, graph.step[lane]
    u = s / step - segment
    h0, h1 = graph.heading[row], graph.heading[row + 1]
    a, b = (1.0 + 2.0 * u) * (1.0 - u) ** 2, u * u * (3.0 - 2.0 * u)
    c, d = step * u * (1.0 - u) ** 2, step * u * u * (u - 1.0)
    x = a * graph.x[row] + b * graph.x[row + 1] + c * np.cos(h0) + d * np.cos(h1)
    y = a * graph.y[row] + b * graph.y[row + 1] + c * np.sin(h0) + d * np.sin(h1)
    return x, y, h0 + u * (h1 - h0)


@device_function
def _segment(graph: LaneGraph, lane: int, s: float) -> int:
    last = graph.first[lane + 1] - graph.first[lane] - 2
    return int(min(max(int(s / graph.step[lane]), 0), last))


@device_function
def record(graph: LaneGraph, state: State, i: int, motion: Float64) -> None:
    """Write x, y, heading, speed of vehicle ``i`` into ``motion`` (4,)."""
    x, y, heading = pose_at(graph, state.lane[i], state.s[i])
    left, slope = lateral_offset(state, i)
    curvature = curvature_at(graph, state.lane[i], state.s[i])
    motion[0] = x - left * np.sin(heading)
    motion[1] = y + left * np.cos(heading)
    motion[2] = heading + np.arctan2(slope, 1.0 - curvature * left)
    motion[3] = state.speed[i]
