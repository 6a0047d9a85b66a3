"""Vehicles in the traffic kernels: their parameters and state, where they are, and which lanes they occupy."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import ArrayRecord, Float64, RecordArray
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.procedural.graph import NONE, LaneGraph

STRADDLE = 0.3  # [m] from the new lane's centre until which a vehicle still blocks the lane it leaves
STANDING = 0.3  # [m/s] below which a vehicle waits
_PROJECTIONS = 4
PLACES = 3  # a vehicle is on its lane, on the lane it leaves, and with its tail on the previous lane

VEHICLE = np.dtype(
    [
        ("length", "f8"),  # [m]
        ("width", "f8"),  # [m]
        ("eagerness", "f8"),  # scales the desired speed
        ("top_speed", "f8"),  # [m/s], for example of cyclists; infinite for most
        ("aside", "f8"),  # distance to the left of the lane's centre at which it keeps [m]
        ("headway", "f8"),  # desired time gap [s]
        ("accel", "f8"),  # comfortable acceleration [m/s2]
        ("decel", "f8"),  # comfortable deceleration [m/s2]
        ("standstill", "f8"),  # desired gap at rest [m]
        ("politeness", "f8"),  # weight of the follower's loss in a lane change
        ("lane", "i8"),
        ("s", "f8"),  # distance of the vehicle's centre along its lane [m]
        ("speed", "f8"),  # along its path [m/s]
        ("destination", "i8"),  # row of `LaneGraph.routes`
        ("previous", "i8"),  # the lane before
        ("granted", "i8"),  # the lane ahead that it may enter
        ("origin", "i8"),  # the lane it leaves during a lane change
        ("lateral", "f8"),  # offset to the left at which the lane change began [m]; 0 without one
        ("progress", "f8"),  # of the lane change, 0 to 1
        ("span", "f8"),  # distance over which the lane change is completed [m]
        ("patience", "f8"),  # time until it may change lanes for advantage again [s]
        ("waited", "f8"),  # time since it stopped [s]
        ("wish", "i8"),  # lane beside that it has to enter and cannot yet
        ("active", "?"),  # False after it has left the map
    ],
    align=True,
)
"""Parameters of a vehicle and its driver, and the state that the kernels change in place; lanes are -1 where unset."""

PLACE = np.dtype([("lane", "i8"), ("s", "f8")])
"""A lane that a vehicle occupies, -1 for none, and the distance of its centre along that lane [m]."""


@device_function
def lateral_offset(vehicle: ArrayRecord) -> tuple[float, float]:
    """Offset from the lane's centre [m] and its slope along the lane, of a smooth (quintic) lane change."""
    if vehicle.lateral == 0.0:
        return 0.0, 0.0
    u = vehicle.progress
    blend = u * u * u * (10.0 + u * (6.0 * u - 15.0))
    slope = 30.0 * u * u * (1.0 - u) ** 2 / vehicle.span
    return vehicle.lateral * (1.0 - blend), -vehicle.lateral * slope


@device_function
def desired_speed(graph: LaneGraph, vehicle: ArrayRecord, lane: int) -> float:
    """Speed on an empty lane [m/s]."""
    return float(min(graph.lanes[lane].speed * vehicle.eagerness, vehicle.top_speed))


@device_function
def occupy(graph: LaneGraph, vehicles: RecordArray, places: RecordArray, i: int) -> None:
    """Write the places (3,) of vehicle ``i``."""
    vehicle = vehicles[i]
    for place in range(PLACES):
        places[i, place].lane = NONE
    if not vehicle.active:
        return
    lane, s = vehicle.lane, vehicle.s
    places[i, 0].lane, places[i, 0].s = lane, s
    origin = vehicle.origin
    if origin != NONE and abs(lateral_offset(vehicle)[0]) > STRADDLE:
        places[i, 1].lane, places[i, 1].s = origin, abreast(graph, lane, s, origin)
    previous = vehicle.previous
    if previous != NONE and s - vehicle.length / 2.0 < 0.0:
        places[i, 2].lane, places[i, 2].s = previous, graph.lanes[previous].length + s


@device_function
def curvature_at(graph: LaneGraph, lane: int, s: float) -> float:
    """Curvature of a lane's centreline [1/m]."""
    row = _point_before(graph, lane, s)
    return float((graph.points[row + 1].heading - graph.points[row].heading) / graph.lanes[lane].step)


@device_function
def pose_on(graph: LaneGraph, lane: int, s: float) -> tuple[float, float, float]:
    """Position [m] and heading [rad] on a lane's centreline.

    It is a cubic Hermite spline between its points, which deviates from arcs by less than 0.1 mm.
    """
    row, step = _point_before(graph, lane, s), graph.lanes[lane].step
    start, end = graph.points[row], graph.points[row + 1]
    u = s / step - (row - graph.lanes[lane].points_begin)
    h0, h1 = start.heading, end.heading
    a, b = (1.0 + 2.0 * u) * (1.0 - u) ** 2, u * u * (3.0 - 2.0 * u)
    c, d = step * u * (1.0 - u) ** 2, step * u * u * (u - 1.0)
    x = a * start.x + b * end.x + c * np.cos(h0) + d * np.cos(h1)
    y = a * start.y + b * end.y + c * np.sin(h0) + d * np.sin(h1)
    return x, y, h0 + u * (h1 - h0)


@device_function
def abreast(graph: LaneGraph, lane: int, s: float, target: int) -> float:
    """Distance along ``target`` [m] that is beside ``s`` on the lane next to it.

    In proportion to their lengths, which is right where their curvature is constant; else, from version 2 on, by
    projection: each step reduces the error by a factor of about offset times curvature, at most 1/8.
    """
    beside = float(s * graph.lanes[target].length / graph.lanes[lane].length)
    if graph.flows:
        x, y, _ = pose_on(graph, lane, s)
        for _ in range(_PROJECTIONS):
            px, py, heading = pose_on(graph, target, beside)
            beside += (x - px) * np.cos(heading) + (y - py) * np.sin(heading)
        beside = min(max(beside, 0.0), graph.lanes[target].length)
    return beside


@device_function
def record(graph: LaneGraph, vehicle: ArrayRecord, motion: Float64) -> None:
    """Write x, y, heading, speed of a vehicle into ``motion`` (4,)."""
    lane, s = vehicle.lane, vehicle.s
    x, y, heading = pose_on(graph, lane, s)
    left, slope = lateral_offset(vehicle)
    left += vehicle.aside
    curvature = curvature_at(graph, lane, s)
    motion[0] = x - left * np.sin(heading)
    motion[1] = y + left * np.cos(heading)
    motion[2] = heading + np.arctan2(slope, 1.0 - curvature * left)
    motion[3] = vehicle.speed


@device_function
def _point_before(graph: LaneGraph, lane: int, s: float) -> int:
    """Row of the last centreline point before ``s``."""
    begin, last = graph.lanes[lane].points_begin, graph.lanes[lane].points_end - graph.lanes[lane].points_begin - 2
    return int(begin + min(max(int(s / graph.lanes[lane].step), 0), last))
