"""How traffic moves: gaps, headways, speeds, accelerations and lane changes of all vehicles of a scenario."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, hypot, inf, sin

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float64
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import ObjectType

_MOVED = 5.0
"""Distance [m] from which a vehicle belongs to the traffic; others are parked."""
_AHEAD, _PARALLEL = 60.0, 0.5
"""Distance [m] up to which a vehicle ahead is looked for, and difference of headings [rad]."""
_MOVING = 1.0
"""Speed [m/s] from which followers and accelerations count."""
_AVERAGED = 1.0
"""Time [s] over which accelerations are averaged, against the noise of recordings."""
_CHANGE = 5.0
"""Time [s] in which a lane change is completed."""
_SIDEWAYS = 2.5, 4.5
"""Least and largest displacement sideways [m] in a lane change."""
_STRAIGHT = 0.09
"""Largest turn [rad] between the headings before and after it."""


@dataclass(frozen=True, eq=False)
class TrafficFigures:
    """Samples of the traffic of a scenario.

    Attributes:
        gap: Bumper to bumper behind the vehicle ahead [m].
        headway: Time to its rear at the own speed [s].
        speed: Of every vehicle that is not parked, every timestep [m/s].
        acceleration: Along the path, of those that move [m/s2].
        lane_changes: Number per kilometre, one value [1/km]; empty where nobody moves.
    """

    gap: Float64
    headway: Float64
    speed: Float64
    acceleration: Float64
    lane_changes: Float64


def measure_traffic(scenario: ScenarioDescription) -> TrafficFigures:
    """Measure the traffic of a scenario, with the same geometry for every dataset, without its map."""
    tracks, dt = scenario.tracks, scenario.dt
    position = np.where(tracks.valid[..., None], tracks.position[..., :2].astype(np.float64), np.nan)
    step = np.hypot(*np.moveaxis(np.diff(position, axis=1), -1, 0))
    way = np.nansum(step, axis=1)
    chosen = (tracks.object_type == ObjectType.VEHICLE) & (way > _MOVED)
    position, valid = position[chosen], tracks.valid[chosen]
    heading = tracks.heading[chosen].astype(np.float64)
    speed = np.hypot(*np.moveaxis(tracks.velocity[chosen].astype(np.float64), -1, 0))
    boxes = np.concatenate([position, heading[..., None], tracks.size[chosen][..., :2]], axis=-1).astype(np.float64)
    gap = np.full(valid.shape, inf)
    gaps_ahead(boxes, valid, gap)
    follows = (gap < inf) & (speed > _MOVING)
    half = max(round(_AVERAGED / dt / 2.0), 1)
    is_known = valid[:, 2 * half :] & valid[:, : -2 * half] & (speed[:, half:-half] > _MOVING)
    acceleration = ((speed[:, 2 * half :] - speed[:, : -2 * half]) / (2 * half * dt))[is_known]
    driven = way[chosen].sum() / 1000.0
    changes = sum(count_lane_changes(*track, dt) for track in zip(position, heading, valid, strict=True))
    return TrafficFigures(
        gap[follows], (gap / np.maximum(speed, _MOVING))[follows], speed[valid], acceleration,
        np.array([changes / driven] if driven else []),
    )  # fmt: skip


@kernel
def gaps_ahead(boxes: Array, valid: Array, gap: Array) -> None:
    """Write the gap [m] to the nearest parallel vehicle straight ahead, if there is one.

    Args:
        boxes: (N, T, 5) x, y, heading, length, width.
        valid: (N, T).
        gap: (N, T), written where there is one.
    """
    for t in range(valid.shape[1]):
        for i in range(len(boxes)):
            if not valid[i, t]:
                continue
            x, y, heading, length, width = boxes[i, t]
            for j in range(len(boxes)):
                turn = boxes[j, t, 2] - heading
                if j == i or not valid[j, t] or hypot(sin(turn), 1.0 - cos(turn)) > _PARALLEL:
                    continue
                dx, dy = boxes[j, t, 0] - x, boxes[j, t, 1] - y
                ahead, left = cos(heading) * dx + sin(heading) * dy, cos(heading) * dy - sin(heading) * dx
                clear = ahead - 0.5 * (length + boxes[j, t, 3])
                if 0.0 < ahead < _AHEAD and abs(left) < 0.5 * (width + boxes[j, t, 4]) and clear > 0.0:
                    gap[i, t] = min(gap[i, t], clear)


def count_lane_changes(position: Float64, heading: Float64, valid: Array, dt: float) -> int:
    """Lane changes of a track: it is displaced sideways by about a lane, with equal headings before and after."""
    window = round(_CHANGE / dt)
    position, heading = position[valid], heading[valid]
    if len(position) <= window:
        return 0
    (dx, dy), turn = (position[window:] - position[:-window]).T, heading[window:] - heading[:-window]
    is_change = np.ones(len(dx), np.bool_)
    for part in (heading[:-window], heading[window:]):  # a lane is as far aside in the frame before and after
        ahead, left = np.cos(part) * dx + np.sin(part) * dy, np.cos(part) * dy - np.sin(part) * dx
        is_change &= (_SIDEWAYS[0] < np.abs(left)) & (np.abs(left) < _SIDEWAYS[1]) & (ahead > 2.0 * np.abs(left))
    is_change &= np.abs(np.angle(np.exp(1j * turn))) < _STRAIGHT
    count, free = 0, 0
    for row in np.flatnonzero(is_change).tolist():
        if row >= free:
            count, free = count + 1, row + window
    return count
