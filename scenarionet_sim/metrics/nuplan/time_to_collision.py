"""Time to collision at constant speed and heading: nuPlan's ``time_to_collision_within_bound``.

Source: nuplan-devkit, ``planning/metrics/evaluation_metrics/common/time_to_collision_within_bound.py`` (definitions).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.overlap import is_overlapping
from scenarionet_sim.metrics.drive import Drives, EgoDrive, MovingBoxes, SurroundingBoxes
from scenarionet_sim.metrics.nuplan.collisions import AHEAD, BEHIND, EgoCollision

STEP, HORIZON, BOUND = 0.1, 3.0, 0.95
"""Step and horizon of the projection, and the smallest time that scores [s]."""

_STANDING = 5e-3


def time_to_collision(
    ego: EgoDrive,
    others: SurroundingBoxes,
    collisions: Sequence[EgoCollision],
    is_in_lane: Bool,
    is_in_intersection: Bool,
    step: float = STEP,
    horizon: float = HORIZON,
) -> Float64:
    """Return the time to the next collision at every moment.

    Objects ahead count; those beside count, too, while the ego is not within one lane, or in an intersection. Objects
    that it has collided with no longer count. It is 0 at a collision at fault.

    Args:
        ego: The drive.
        others: The objects around it.
        collisions: See :func:`find_collisions`.
        is_in_lane: (T,) see :func:`find_collisions`.
        is_in_intersection: (T,) whether the rear axle is in an intersection.
        step, horizon: Of the projection [s].

    Returns:
        (T,) [s]; infinite without a collision within the horizon.
    """
    times = np.arange(step, horizon, step)
    counts = others.present.copy()
    for each in collisions:
        counts[each.step :, each.track] = False
    found = np.full(len(ego.time), np.inf)
    limit = np.where(~is_in_lane | is_in_intersection, BEHIND, AHEAD)
    motions = [(moving.position, moving.heading, moving.speed) for moving in (ego, others)]
    size = np.vstack(([ego.length, ego.width], others.size))
    _project(motions[0], ego.rear_axle, motions[1], size, counts, limit, times, found)
    found[[each.step for each in collisions if each.is_at_fault]] = 0.0
    return found


_Motion = tuple[Float64, Float64, Float64]
"""Position (..., 2), heading (...) and speed (...)."""


@kernel
def _project(
    ego: _Motion,
    axle: Float64,
    others: _Motion,
    size: Float64,
    counts: Bool,
    limit: Float64,
    times: Float64,
    found: Float64,
) -> None:
    """Fill the first of ``times`` at which the projected boxes overlap, for each moment.

    Args:
        ego, others: Over T moments, (T, N) of the others.
        axle: (T, 2) rear axle of the ego.
        size: (1 + N, 2) of the ego and of the others.
        counts: (T, N) others that count.
        limit: (T,) least cosine of the direction from the axle to another one.
        times: Increasing.
        found: (T,) output.
    """
    (position, heading, speed), (other_position, other_heading, other_speed) = ego, others
    for t in range(len(position)):
        if speed[t] <= _STANDING:
            continue
        own = position[t, 0], position[t, 1], math.cos(heading[t]), math.sin(heading[t]), speed[t]
        for n in range(counts.shape[1]):
            if counts[t, n]:
                other = other_position[t, n, 0], other_position[t, n, 1], other_heading[t, n], other_speed[t, n]
                found[t] = _soonest(own, axle[t], size[0], other, size[1 + n], limit[t], times, found[t])


@device_function
def _soonest(
    own: tuple[float, float, float, float, float], axle: Float64, size: Float64,
    other: tuple[float, float, float, float], other_size: Float64, limit: float, times: Float64, before: float,
) -> float:  # fmt: skip
    """Return the first of some times, and before another one, at which two projected boxes overlap; else that one.

    Args:
        own: Position, cosine and sine of the heading, and speed.
        axle, size: Rear axle (2,), length and width of the same.
        other, other_size: Position, heading and speed; length and width.
        limit, times: See :func:`_project`.
        before: The time.
    """
    px, py, cos, sin, speed = own
    other_x, other_y, heading, other_speed = other
    x, y = other_x - axle[0], other_y - axle[1]
    along = (cos * x + sin * y) / max(math.hypot(x, y), 1e-9)
    if along <= limit:
        return before
    c, s = math.cos(heading), math.sin(heading)
    dx, dy, vx, vy = other_x - px, other_y - py, other_speed * c - speed * cos, other_speed * s - speed * sin
    for ahead in times:
        if ahead >= before:
            break
        x, y = dx + vx * ahead, dy + vy * ahead
        if is_overlapping(x, y, (cos, sin, size[0], size[1]), (c, s, other_size[0], other_size[1])):
            return float(ahead)
    return before


def least_times(drives: Drives, boxes: MovingBoxes, sees_beside: Bool) -> Float64:
    """Return the least :func:`time_to_collision` (B,) [s] of drives that do not collide.

    Args:
        drives, boxes: The drives, and the objects around them.
        sees_beside: (S,) whether the box is not within one lane, or the rear axle in an intersection.
    """
    least = np.full(len(drives.dt), np.inf)
    times, limit = np.arange(STEP, HORIZON, STEP), np.where(sees_beside, BEHIND, AHEAD)
    find_least_times(drives, boxes, limit, times, least)
    return least


@kernel(allocates=False)
def find_least_times(drives: Drives, boxes: MovingBoxes, limit: Float64, times: Float64, least: Float64) -> None:
    """Write the least times (B,), infinite before."""
    for b in range(len(least)):
        for t in range(drives.offsets[b], drives.offsets[b + 1]):
            if drives.speed[t] <= _STANDING:
                continue
            x, y, heading = drives.centre[t, 0, 0], drives.centre[t, 0, 1], drives.heading[t]
            own = x, y, math.cos(heading), math.sin(heading), drives.speed[t]
            row = boxes.first[b] + (t - drives.offsets[b]) * boxes.counts[b]
            for n in range(boxes.counts[b]):
                if n == boxes.agents[b] or not boxes.present[row + n]:
                    continue
                place, velocity = boxes.position[row + n], boxes.velocity[row + n]
                other = place[0], place[1], boxes.heading[row + n], math.hypot(velocity[0], velocity[1])
                size = boxes.size[boxes.first_size[b] + n]
                least[b] = _soonest(own, drives.axle[t], drives.box[b], other, size, limit[t], times, least[b])
