"""Red lights that a vehicle runs."""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightColor
from scenarionet_sim.metrics.drive import DrivenEpisode

_STOP_REACH = 2.0  # [m] to either side of a stop point


def measure(episode: DrivenEpisode) -> dict[str, Any]:
    """Return the number of lights that the vehicle runs; None without lights."""
    world = episode.world
    if not episode.is_whole:
        return {}
    if not len(world.light_lane):
        return {"red_light_violations": None}
    rollout = episode.scored
    rows = np.flatnonzero((world.light_lane >= 0) & np.isfinite(world.light_stop).all(axis=1))
    rows = rows[world.roads.lanes.lengths[world.light_lane[rows]] > 1]
    if not len(rows):
        return {"red_light_violations": None}
    steps = np.minimum(rollout.start + np.arange(rollout.num_steps + 1), world.num_steps - 1)  # the last state stays
    is_red = LIGHT_COLORS[world.light_state[rows][:, steps]] == LightColor.RED
    stop = world.light_stop[rows].astype(np.float64)
    lanes = (world.roads.lanes[lane].astype(np.float64) for lane in world.light_lane[rows])
    direction = np.array([_direction(lane, point) for lane, point in zip(lanes, stop, strict=True)])
    position = np.ascontiguousarray(rollout.position[:, rollout.agent])
    return {"red_light_violations": int(runs_red_light(position, stop, direction, is_red).sum())}


def runs_red_light(position: Float64, stop: Float64, direction: Float64, is_red: Bool) -> Bool:
    """Return the lights (L,) whose stop point the vehicle's centre passes in the lane's direction while they are red.

    Args:
        position: (T, 2) [m].
        stop: (L, 2) stop points [m].
        direction: (L, 2) unit vectors of the lanes at the stop points.
        is_red: (L, T).
    """
    away = position[None] - stop[:, None]
    along = (away * direction[:, None]).sum(axis=-1)
    across = away[..., 1] * direction[:, None, 0] - away[..., 0] * direction[:, None, 1]
    passes = (along[:, :-1] < 0.0) & (along[:, 1:] >= 0.0) & (np.abs(across[:, 1:]) <= _STOP_REACH)
    ran: Bool = (passes & is_red[:, 1:]).any(axis=1)
    return ran


def _direction(line: Float64, point: Float64) -> Float64:
    """(2,) direction of a line at its point nearest to a given one."""
    along = np.diff(line, axis=0)
    square = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((point - line[:-1]) * along).sum(axis=1) / square, 0.0, 1.0)
    nearest = np.argmin(((line[:-1] + share[:, None] * along - point) ** 2).sum(axis=1))
    unit: Float64 = along[nearest] / np.sqrt(square[nearest])
    return unit
