"""What lies ahead of an agent on its own path, and who is around it, in its frame (x forward, y left)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenarionet_data.procedural.jit import entry
from scenarionet_sim.kernels.paths import segment_at

Bool = npt.NDArray[np.bool_]
Codes = npt.NDArray[np.uint8]
Int32 = npt.NDArray[np.int32]
Float32 = npt.NDArray[np.float32]
Float64 = npt.NDArray[np.float64]


@entry
def points_ahead(
    agents: Int32,
    position: Float64,
    heading: Float64,
    arc: Float64,
    path_points: Float32,
    path_arc: Float32,
    path_offsets: Int32,
    spacing: float,
    out: Float64,
) -> None:
    """Points of each agent's path, ``spacing`` apart from where it is now; those beyond the end are its end.

    Args:
        agents: (A, 2) world and row.
        position, heading, arc: The state of W worlds, see ``State``.
        path_points, path_arc, path_offsets: Paths of W worlds, see ``Stage``.
        spacing: [m] along the path; the first point is one spacing ahead.
        out: (A, K, 2) [m], written; 0 for an agent without a path.
    """
    for a in range(agents.shape[0]):
        w, me = agents[a, 0], agents[a, 1]
        cos, sin = np.cos(heading[w, me]), np.sin(heading[w, me])
        first, end = path_offsets[w, me], path_offsets[w, me + 1]
        for k in range(out.shape[1]):
            if end == first:
                out[a, k, 0], out[a, k, 1] = 0.0, 0.0
                continue
            at, share = first, 0.0
            if end - first > 1:
                along = max(arc[w, me] + (k + 1) * spacing, 0.0)
                at = segment_at(path_arc[w], first, end, along)
                share = min((along - path_arc[w, at]) / (path_arc[w, at + 1] - path_arc[w, at]), 1.0)
            after = min(at + 1, end - 1)
            x0, y0 = np.float64(path_points[w, at, 0]), np.float64(path_points[w, at, 1])
            dx = x0 + share * (path_points[w, after, 0] - x0) - position[w, me, 0]
            dy = y0 + share * (path_points[w, after, 1] - y0) - position[w, me, 1]
            out[a, k, 0], out[a, k, 1] = cos * dx + sin * dy, cos * dy - sin * dx


@entry
def heading_of_path(
    agents: Int32, arc: Float64, path_points: Float32, path_arc: Float32, path_offsets: Int32, out: Float64
) -> None:
    """Direction [rad] of each agent's path where the agent is; NaN where the path is a point or none.

    Args:
        agents, arc, path_points, path_arc, path_offsets: As in :func:`points_ahead`.
        out: (A,), written.
    """
    for a in range(agents.shape[0]):
        w, me = agents[a, 0], agents[a, 1]
        first, end = path_offsets[w, me], path_offsets[w, me + 1]
        out[a] = np.nan
        if end - first > 1:
            k = segment_at(path_arc[w], first, end, arc[w, me])
            dx = np.float64(path_points[w, k + 1, 0]) - path_points[w, k, 0]
            dy = np.float64(path_points[w, k + 1, 1]) - path_points[w, k, 1]
            out[a] = np.arctan2(dy, dx)


@entry
def nearest_objects(
    agents: Int32, position: Float64, object_type: Codes, present: Bool, is_seen: Bool, reach: float, out: Int32
) -> None:
    """The objects nearest to each agent, nearest first, the lower row first where two are as near.

    Args:
        agents: (A, 2) world and row.
        position, object_type, present: The state of W worlds, see ``State``.
        is_seen: (256,) by ``ObjectType``.
        reach: Between centres [m].
        out: (A, K) int32, written: rows, -1 where there are no more.
    """
    apart = np.empty(out.shape[1])
    for a in range(agents.shape[0]):
        w, me = agents[a, 0], agents[a, 1]
        found = 0
        for n in range(position.shape[1]):
            if n == me or not present[w, n] or not is_seen[object_type[w, n]]:
                continue
            dx, dy = position[w, n, 0] - position[w, me, 0], position[w, n, 1] - position[w, me, 1]
            distance = dx * dx + dy * dy
            if distance > reach * reach or (found == out.shape[1] and distance >= apart[found - 1]):
                continue
            found = min(found + 1, out.shape[1])
            place = found - 1
            while place > 0 and apart[place - 1] > distance:
                apart[place], out[a, place] = apart[place - 1], out[a, place - 1]
                place -= 1
            apart[place], out[a, place] = distance, n
        for place in range(found, out.shape[1]):
            out[a, place] = -1


@entry
def light_ahead(
    agents: Int32,
    arc: Float64,
    timestep: Int32,
    stop_arc: Float32,
    stop_light: Int32,
    stop_offsets: Int32,
    light_state: Codes,
    num_steps: Int32,
    apart: Float64,
    shown: Codes,
) -> None:
    """The next light that governs each agent's path.

    Args:
        agents: (A, 2) world and row.
        arc, timestep: The state of W worlds, see ``State``.
        stop_arc, stop_light, stop_offsets, light_state, num_steps: Stops and lights of W worlds, see ``Stage``.
        apart: (A,), written: distance along the path to the stop point [m], infinite without a light.
        shown: (A,), written: its ``LightState`` now, at the last timestep after the end, 0 without a light.
    """
    for a in range(agents.shape[0]):
        w, me = agents[a, 0], agents[a, 1]
        apart[a], shown[a] = np.inf, 0
        now = min(timestep[w], num_steps[w] - 1)
        for stop in range(stop_offsets[w, me], stop_offsets[w, me + 1]):
            if stop_arc[w, stop] >= arc[w, me]:
                apart[a] = stop_arc[w, stop] - arc[w, me]
                shown[a] = light_state[w, stop_light[w, stop], now]
                break
