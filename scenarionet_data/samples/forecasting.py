"""The layout of this project: agents and map in the frame of a target, or of the ego."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.samples.choices import Choices
from scenarionet_data.samples.kernels import AgentArrays, fill_agents
from scenarionet_data.samples.polyline_kernels import PolylineArrays, fill_polylines
from scenarionet_data.samples.scenes import Scenes
from scenarionet_data.samples.window_kernels import Rules


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
    memory, window, polylines = scenes.memory, choices.window, choices.polylines
    count, agents, num_lines = len(scenes.requests.scene), choices.agents.count, polylines.count
    shapes: dict[str, tuple[tuple[int, ...], type[np.generic]]] = {}
    for name, steps in (("history", window.num_history), ("future", window.num_future)):
        shapes[name] = (agents, steps, 5), np.float32
        shapes[f"{name}_valid"] = shapes[f"{name}_interpolated"] = (agents, steps), np.bool_
    shapes["agent_size"], shapes["agent_type"] = ((agents, 3), np.float32), ((agents,), np.int32)
    shapes["is_target"], shapes["agent_row"] = ((agents,), np.bool_), ((agents,), np.int32)
    if num_lines:
        points = num_lines, polylines.points
        shapes["polylines"], shapes["polylines_valid"] = ((*points, 4), np.float32), (points, np.bool_)
        shapes["polyline_type"] = (num_lines,), np.int32
    found = {name: memory.empty((count, *shape), dtype) for name, (shape, dtype) in shapes.items()}
    flat = {name: values.reshape(count, -1) for name, values in found.items()}
    pose = np.empty((count, 4))
    out = AgentArrays._make([*(flat[name] for name in shapes if not name.startswith("polyline")), pose])
    augmentation, types = choices.augmentation, np.array(choices.agents.types, np.uint8)
    numbers = window.num_history, window.dt, window.longest_gap, choices.agents.radius
    rules = Rules(*numbers, types, augmentation.noise, augmentation.drop)
    for wanted in scenes.wanted(choices):
        fill_agents(scenes.cache.memory, wanted, rules, out)
        if num_lines:
            lines = PolylineArrays(*(flat[name] for name in ("polylines", "polylines_valid", "polyline_type")))
            fill_polylines(scenes.cache.memory, wanted.block, pose, polylines.spacing, polylines.radius, lines)
    return found | {"has_centre": ~np.isnan(pose[:, 0]), "pose": np.nan_to_num(pose).astype(np.float32)}
