"""The layout of this project: agents and map in the frame of a target, or of the ego."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.samples.choices import Choices, Polylines
from scenarionet_data.samples.kernels import AgentArrays, fill_agents
from scenarionet_data.samples.polyline_kernels import (
    Centres,
    MapPieces,
    PolylineArrays,
    cut,
    fill_polylines,
    measure,
)
from scenarionet_data.samples.scenes import Scenes, rules


def forecasting(scenes: Scenes, choices: Choices) -> dict[str, Array]:
    """Arrays of B samples with A agents, H timesteps of history (the last is the current one), F of future.

    The frame has the target (or, by ``perspective="scene"``, the ego) at the current timestep in its origin, heading
    along +x: x forward, y left, metres, radians, seconds. Augmentation turns and mirrors it. Where a mask is False,
    arrays hold 0; a sample whose target is not seen at the current timestep is masked throughout.

    Returns:
        * ``history`` (B, A, H, 5), ``future`` (B, A, F, 5) float32: x, y [m], heading [rad], velocity along x, y [m/s];
        * ``history_valid`` (B, A, H), ``future_valid`` (B, A, F) bool;
        * ``history_interpolated``, ``future_interpolated`` bool: valid states at no recorded time;
        * ``agent_type`` (B, A) int32 codes of ``ObjectType``, ``agent_size`` (B, A, 3) float32 length, width,
          height [m] at the current timestep, ``is_target`` (B, A) bool, ``agent_row`` (B, A) int32 row of the object
          in its scenario, -1 for none;
        * ``polylines`` (B, L, N, 4) float32: x, y [m], unit direction along x, y; ``polylines_valid`` (B, L, N) bool;
          ``polyline_type`` (B, L) int32 codes of ``MapFeatureType``; only with a map;
        * ``has_centre`` (B,) bool: whether the target, or the ego, is seen at the current timestep;
        * ``pose`` (B, 4) float32: x, y [m], heading [rad] of the frame in the scenario's, and -1 if mirrored, else 1:
          a point ``p`` of the sample is at ``R(heading) (p_x, mirror * p_y) + (x, y)``.
    """
    wanted = scenes.wanted(choices)
    frames = scenes.frames(choices, wanted)
    out = _agent_arrays(scenes, choices)
    fill_agents(scenes.tracks, frames, wanted, rules(choices), out)
    found = {
        "history": out.history,
        "history_valid": out.history_valid,
        "history_interpolated": out.history_interpolated,
        "future": out.future,
        "future_valid": out.future_valid,
        "future_interpolated": out.future_interpolated,
        "agent_type": out.kind,
        "agent_size": out.size,
        "agent_row": out.row,
        "is_target": out.is_target,
        "has_centre": ~np.isnan(out.pose[:, 0]),
        "pose": np.nan_to_num(out.pose).astype(np.float32),
    }
    if choices.polylines.count:
        lines = _polylines(scenes, choices.polylines, out)
        found |= {"polylines": lines.points, "polylines_valid": lines.valid, "polyline_type": lines.kind}
    return found


def _agent_arrays(scenes: Scenes, choices: Choices) -> AgentArrays:
    memory, agents = scenes.memory, (len(scenes.requests.scene), choices.agents.count)
    past, future = (*agents, choices.window.num_history), (*agents, choices.window.num_future)
    return AgentArrays(
        memory.zeros((*past, 5), np.float32),
        memory.zeros(past, np.bool_),
        memory.zeros(past, np.bool_),
        memory.zeros((*future, 5), np.float32),
        memory.zeros(future, np.bool_),
        memory.zeros(future, np.bool_),
        memory.zeros((*agents, 3), np.float32),
        memory.zeros(agents, np.int32),
        memory.zeros(agents, np.bool_),
        np.full(agents, -1, np.int32),
        np.zeros((agents[0], 4)),
    )


def _polylines(scenes: Scenes, polylines: Polylines, agents: AgentArrays) -> PolylineArrays:
    count, longest, points = len(agents.pose), polylines.count, polylines.points
    features, scene, spacing, radius = scenes.map, scenes.requests.scene, polylines.spacing, polylines.radius
    order, num_scenes = np.argsort(scene, kind="stable"), len(scenes.metadata)
    bounds = np.searchsorted(scene[order], np.arange(num_scenes + 1))
    centres = Centres(bounds, agents.pose[order, 0], agents.pose[order, 1])
    memory = scenes.memory
    steps = memory.empty(len(features.x) + len(features.outline_x), np.float64)
    counts = np.empty(len(features.kind), np.int32)
    num_pieces = measure(features, spacing, points, centres, radius, steps, counts)
    pieces = MapPieces(
        np.empty(num_scenes + 1, np.int64),
        memory.empty((num_pieces + 1, points), np.float32),  # one more, to begin a piece that is not kept
        memory.empty((num_pieces + 1, points), np.float32),
        memory.empty(num_pieces, np.int32),
        memory.empty(num_pieces, np.uint8),
    )
    cut(features, steps, counts, spacing, centres, radius, pieces)
    out = PolylineArrays(
        memory.zeros((count, longest, points, 4), np.float32),
        memory.zeros((count, longest, points), np.bool_),
        memory.zeros((count, longest), np.int32),
    )
    fill_polylines(pieces, spacing, scene, agents.pose, radius, out)
    return out
