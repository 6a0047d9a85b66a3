"""Observation of the agent's own path, in its frame (x forward, y left)."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.log import ARC, HEADING, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.arrays.structures import LIGHTS, NUM_STEPS, OBJECTS, Recorded
from scenarionet_sim.worlds.path_kernels import PathRows, direction, pose_on, segment_at, segment_from

_STANDING = 0.1
"""Speed [m/s] below which a vehicle's motion does not reveal its steering."""


@device_function
def way_ahead(me: Float64, route: Float64, way: PathRows, spacing: float, out: Float64) -> None:
    """Sample points of an agent's path ahead; points beyond the end are the end.

    Args:
        me, route: (7,) and (2,) rows of motion and route, see ``State``.
        way: Its path.
        spacing: Distance between points along the path [m]; the first is one spacing ahead.
        out: (K, 2) output [m]; 0 for an agent without a path.
    """
    cos, sin = np.cos(me[HEADING]), np.sin(me[HEADING])
    x, y, segment = 0.0, 0.0, segment_at(way, larger(route[0], 0.0))
    for k in range(out.shape[0]):
        out[k, 0], out[k, 1] = 0.0, 0.0
        if way.end == way.first:
            continue
        x, y = float(way.points[way.first, X]), float(way.points[way.first, Y])
        if way.end - way.first > 1:
            s = smaller(larger(route[0] + (k + 1) * spacing, 0.0), np.float64(way.points[way.end - 1, ARC]))
            segment = segment_from(way, segment, s)
            x, y, _, _ = pose_on(way, segment, s)
        dx, dy = x - me[X], y - me[Y]
        out[k, 0], out[k, 1] = cos * dx + sin * dy, cos * dy - sin * dx


@device_function
def own_motion(me: Float64, route: Float64, length: float, way: PathRows, wheelbase: float, out: Float64) -> None:
    """Observe an agent's own motion and its location on its path.

    Args:
        me, route: (7,) and (2,) rows of motion and route, see ``State``.
        length: Of its box [m].
        way: Its path.
        wheelbase: Distance between the axles, as a share of the length.
        out: (7,) output: speed forward and to the left [m/s], yaw rate [rad/s], steering angle [rad], heading relative
            to the path [rad] in [-pi, pi], offset to its left [m], completed share of its length.
    """
    cos, sin = np.cos(me[HEADING]), np.sin(me[HEADING])
    forward = cos * me[VX] + sin * me[VY]
    out[0] = forward
    out[1] = cos * me[VY] - sin * me[VX]
    out[2] = me[YAW_RATE]
    out[3] = 0.0  # yaw rate of a bicycle = speed * tan(steering) / wheelbase
    if abs(forward) >= _STANDING:
        out[3] = np.arctan(wheelbase * length * me[YAW_RATE] / forward)
    out[4], out[5], out[6] = 0.0, route[1], 1.0
    if way.end - way.first > 1:
        tx, ty, _ = direction(way, segment_at(way, route[0]))
        out[4] = np.arctan2(sin * tx - cos * ty, cos * tx + sin * ty)
        out[6] = smaller(larger(route[0] / way.points[way.end - 1, ARC], 0.0), 1.0)


@kernel
def observe_light(
    agents: Int32,
    route: Float64,
    timestep: Int32,
    recorded: Recorded,
    colors: UInt8,
    reach: float,
    out: Float32,
) -> int:
    """Observe the next traffic light on each agent's path.

    Args:
        agents: (A, 2) world and row.
        route, timestep: See ``State``.
        recorded: Stops and lights of W worlds.
        colors: (K,) ``LightColor`` by ``LightState``.
        reach: Range along the path [m].
        out: (A, 4) output: distance along the path to the stop point divided by ``reach``, 1 without a light in
            reach; then 1 at the light's current colour (the last recorded one after the end): green, yellow, red.

    Returns:
        Index of the first agent whose arc length is NaN (not located on its path), or -1.
    """
    lost = -1
    for a in range(agents.shape[0]):
        w, own = agents[a, 0], agents[a, 1]
        if lost < 0 and np.isnan(route[w, own, 0]):
            lost = a
        out[a, 0], out[a, 1], out[a, 2], out[a, 3] = 1.0, 0.0, 0.0, 0.0
        row, num_steps = recorded.place[w, OBJECTS] + own, recorded.place[w, NUM_STEPS]
        lights = recorded.place[w, LIGHTS] + smaller(timestep[w], num_steps - 1)
        for stop in range(recorded.stop_offsets[row], recorded.stop_offsets[row + 1]):
            apart = recorded.stop_arc[stop] - route[w, own, 0]
            if apart >= 0.0:
                if apart <= reach:
                    out[a, 0] = apart / reach
                    color = colors[recorded.light_state[lights + recorded.stop_light[stop] * num_steps]]
                    if color > 0:
                        out[a, color] = 1.0
                break
    return lost
