"""The layout of this project: agents and map in the frame of a target, or of the ego."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.samples.choices import Choices, Polylines
from scenarionet_data.samples.kernels import AgentArrays, fill_agents
from scenarionet_data.samples.polyline_kernels import (
    MapPieces,
    PolylineArrays,
    count_pieces,
    count_points,
    cut,
    fill_polylines,
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
    out = _agent_arrays(len(wanted.scene), choices)
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


def _agent_arrays(count: int, choices: Choices) -> AgentArrays:
    agents, past, future = choices.agents.count, choices.window.num_history, choices.window.num_future
    return AgentArrays(
        np.zeros((count, agents, past, 5), np.float32),
        np.zeros((count, agents, past), np.bool_),
        np.zeros((count, agents, past), np.bool_),
        np.zeros((count, agents, future, 5), np.float32),
        np.zeros((count, agents, future), np.bool_),
        np.zeros((count, agents, future), np.bool_),
        np.zeros((count, agents, 3), np.float32),
        np.zeros((count, agents), np.int32),
        np.zeros((count, agents), np.bool_),
        np.full((count, agents), -1, np.int32),
        np.zeros((count, 4)),
    )


def _polylines(scenes: Scenes, polylines: Polylines, agents: AgentArrays) -> PolylineArrays:
    count, longest, points = len(agents.pose), polylines.count, polylines.points
    features, scene = scenes.map, scenes.requests.scene
    counts, bounds = np.empty(len(features.kind), np.int32), np.empty(len(scenes.metadata) + 1, np.int64)
    count_points(features, polylines.spacing, scene, agents.pose, polylines.radius, counts)
    count_pieces(features, counts, points, bounds)
    shape = (int(bounds[-1]), points)
    pieces = MapPieces(
        bounds,
        np.zeros(shape, np.float32),
        np.zeros(shape, np.float32),
        np.zeros(shape[0], np.int32),
        np.zeros(shape[0], np.uint8),
    )
    cut(features, counts, polylines.spacing, pieces)
    out = PolylineArrays(
        np.zeros((count, longest, points, 4), np.float32),
        np.zeros((count, longest, points), np.bool_),
        np.zeros((count, longest), np.int32),
    )
    fill_polylines(pieces, polylines.spacing, scene, agents.pose, polylines.radius, out)
    return out
