"""What lies ahead of an agent on its own path, and who is around it, in its frame (x forward, y left)."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, UInt8
from scenarionet_sim.kernels.minmax import larger, smaller
from scenarionet_sim.kernels.paths import Path, direction, pose_at, segment_at

_STANDING = 0.1
"""Speed [m/s] below which a vehicle's motion does not tell how it steers."""


@kernel
def find_lost(agents: Int32, arc: Float64) -> int:
    """The first of the agents (A, 2) whose arc length (W, N) is not known, -1 when all are."""
    for a in range(agents.shape[0]):
        if np.isnan(arc[agents[a, 0], agents[a, 1]]):
            return a
    return -1


@kernel
def points_ahead(
    agents: Int32,
    position: Float64,
    heading: Float64,
    arc: Float64,
    path_points: Float32,
    path_arc: Float32,
    path_heading: Float32,
    path_z: Float32,
    path_offsets: Int32,
    spacing: float,
    out: Float64,
) -> None:
    """Points of each agent's path, ``spacing`` apart from where it is now; those beyond the end are its end.

    Args:
        agents: (A, 2) world and row.
        position, heading, arc: The state of W worlds, see ``State``.
        path_points, path_arc, path_heading, path_z, path_offsets: Paths of W worlds, see ``WorldBatch``.
        spacing: [m] along the path; the first point is one spacing ahead.
        out: (A, K, 2) [m], written; 0 for an agent without a path.
    """
    for a in range(agents.shape[0]):
        w, me = agents[a, 0], agents[a, 1]
        cos, sin = np.cos(heading[w, me]), np.sin(heading[w, me])
        first, end = path_offsets[w, me], path_offsets[w, me + 1]
        path = Path(path_points[w], path_arc[w], path_heading[w], path_z[w], first, end)
        for k in range(out.shape[1]):
            out[a, k, 0], out[a, k, 1] = 0.0, 0.0
            if end == first:
                continue
            x, y = float(path.points[first, 0]), float(path.points[first, 1])
            if end - first > 1:
                along = smaller(larger(arc[w, me] + (k + 1) * spacing, 0.0), np.float64(path.arc[end - 1]))
                x, y, _, _ = pose_at(path, along)
            dx, dy = x - position[w, me, 0], y - position[w, me, 1]
            out[a, k, 0], out[a, k, 1] = cos * dx + sin * dy, cos * dy - sin * dx


@kernel
def observe_self(
    agents: Int32,
    heading: Float64,
    velocity: Float64,
    yaw_rate: Float64,
    size: Float64,
    arc: Float64,
    lateral: Float64,
    path_points: Float32,
    path_arc: Float32,
    path_heading: Float32,
    path_z: Float32,
    path_offsets: Int32,
    wheelbase: float,
    out: Float64,
) -> None:
    """How each agent moves, and where it is on its path.

    Args:
        agents: (A, 2) world and row.
        heading, velocity, yaw_rate, size, arc, lateral: The state of W worlds, see ``State``.
        path_points, path_arc, path_heading, path_z, path_offsets: As in :func:`points_ahead`.
        wheelbase: Between the axles, as a share of the length.
        out: (A, 7), written: speed forward and to the left [m/s], yaw rate [rad/s], steering angle [rad], heading
            relative to the path [rad] from -pi to pi, distance to the left of it [m], share of it that is done.
    """
    for a in range(agents.shape[0]):
        w, me = agents[a, 0], agents[a, 1]
        cos, sin = np.cos(heading[w, me]), np.sin(heading[w, me])
        forward = cos * velocity[w, me, 0] + sin * velocity[w, me, 1]
        out[a, 0] = forward
        out[a, 1] = cos * velocity[w, me, 1] - sin * velocity[w, me, 0]
        out[a, 2] = yaw_rate[w, me]
        out[a, 3] = 0.0  # a bicycle's yaw rate is speed * tan(steering) / wheelbase
        if abs(forward) >= _STANDING:
            out[a, 3] = np.arctan(wheelbase * size[w, me, 0] * yaw_rate[w, me] / forward)
        out[a, 4], out[a, 5], out[a, 6] = 0.0, lateral[w, me], 1.0
        first, end = path_offsets[w, me], path_offsets[w, me + 1]
        if end - first > 1:
            path = Path(path_points[w], path_arc[w], path_heading[w], path_z[w], first, end)
            tx, ty, _ = direction(path, segment_at(path, arc[w, me]))
            out[a, 4] = np.arctan2(sin * tx - cos * ty, cos * tx + sin * ty)
            out[a, 6] = smaller(larger(arc[w, me] / path_arc[w, end - 1], 0.0), 1.0)


@kernel
def observe_others(
    agents: Int32,
    position: Float64,
    heading: Float64,
    velocity: Float64,
    size: Float64,
    object_type: UInt8,
    present: Bool,
    is_seen: Bool,
    reach: float,
    out: Float64,
) -> None:
    """The objects nearest to each agent, nearest first, the lower row first where two are as near.

    Args:
        agents: (A, 2) world and row.
        position, heading, velocity, size, object_type, present: The state of W worlds, see ``State``.
        is_seen: (256,) by ``ObjectType``.
        reach: Between centres [m].
        out: (A, K, 13), written, zeros where there are no more: 1; centre x, y [m]; cosine and sine of the turn
            from the agent's heading to the object's; velocity minus the agent's, x, y [m/s]; length, width, height
            [m]; 1 for types 1, 2 and 3 (vehicle, pedestrian, cyclist).
    """
    most = out.shape[1]
    apart, rows = np.empty(most), np.empty(most, np.int32)
    for a in range(agents.shape[0]):
        w, me = agents[a, 0], agents[a, 1]
        found = 0
        for n in range(position.shape[1]):
            if n == me or not present[w, n] or not is_seen[object_type[w, n]]:
                continue
            dx, dy = position[w, n, 0] - position[w, me, 0], position[w, n, 1] - position[w, me, 1]
            distance = dx * dx + dy * dy
            if distance > reach * reach or (found == most and distance >= apart[found - 1]):
                continue
            found = smaller(found + 1, most)
            place = found - 1
            while place > 0 and apart[place - 1] > distance:
                apart[place], rows[place] = apart[place - 1], rows[place - 1]
                place -= 1
            apart[place], rows[place] = distance, n
        cos, sin = np.cos(heading[w, me]), np.sin(heading[w, me])
        for place in range(most):
            for column in range(out.shape[2]):
                out[a, place, column] = 0.0
            if place >= found:
                continue
            n = rows[place]
            dx, dy = position[w, n, 0] - position[w, me, 0], position[w, n, 1] - position[w, me, 1]
            vx, vy = velocity[w, n, 0] - velocity[w, me, 0], velocity[w, n, 1] - velocity[w, me, 1]
            turn = heading[w, n] - heading[w, me]
            out[a, place, 0] = 1.0
            out[a, place, 1], out[a, place, 2] = cos * dx + sin * dy, cos * dy - sin * dx
            out[a, place, 3], out[a, place, 4] = np.cos(turn), np.sin(turn)
            out[a, place, 5], out[a, place, 6] = cos * vx + sin * vy, cos * vy - sin * vx
            for axis in range(3):
                out[a, place, 7 + axis] = size[w, n, axis]
            if 1 <= object_type[w, n] <= 3:
                out[a, place, 9 + object_type[w, n]] = 1.0


@kernel
def observe_light(
    agents: Int32,
    arc: Float64,
    timestep: Int32,
    stop_arc: Float32,
    stop_light: Int32,
    stop_offsets: Int32,
    light_state: UInt8,
    num_steps: Int32,
    colors: UInt8,
    reach: float,
    out: Float32,
) -> None:
    """The next light that governs each agent's path.

    Args:
        agents: (A, 2) world and row.
        arc, timestep: The state of W worlds, see ``State``.
        stop_arc, stop_light, stop_offsets, light_state, num_steps: Stops and lights of W worlds, see ``WorldBatch``.
        colors: ``LightColor`` by ``LightState``.
        reach: [m] along the path.
        out: (A, 4), written: distance along the path to the stop point as a share of ``reach``, 1 without a light
            in reach; then 1 at the light's colour now (at the last timestep, after the end): green, yellow, red.
    """
    for a in range(agents.shape[0]):
        w, me = agents[a, 0], agents[a, 1]
        out[a, 0], out[a, 1], out[a, 2], out[a, 3] = 1.0, 0.0, 0.0, 0.0
        now = smaller(timestep[w], num_steps[w] - 1)
        for stop in range(stop_offsets[w, me], stop_offsets[w, me + 1]):
            apart = stop_arc[w, stop] - arc[w, me]
            if apart >= 0.0:
                if apart <= reach:
                    out[a, 0] = apart / reach
                    color = colors[light_state[w, stop_light[w, stop], now]]
                    if color > 0:
                        out[a, color] = 1.0
                break
