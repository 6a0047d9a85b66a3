"""Time to collision at constant speed and heading: nuPlan's ``time_to_collision_within_bound``.

Source: nuplan-devkit, ``planning/metrics/evaluation_metrics/common/time_to_collision_within_bound.py`` (definitions).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.arrays.overlap import is_overlapping
from scenarionet_sim.metrics.drive import EgoDrive, SurroundingBoxes
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
        cos, sin = math.cos(heading[t]), math.sin(heading[t])
        for n in range(counts.shape[1]):
            if not counts[t, n]:
                continue
            x, y = other_position[t, n, 0] - axle[t, 0], other_position[t, n, 1] - axle[t, 1]
            along = (cos * x + sin * y) / max(math.hypot(x, y), 1e-9)
            if along <= limit[t]:
                continue
            c, s = math.cos(other_heading[t, n]), math.sin(other_heading[t, n])
            dx, dy = other_position[t, n, 0] - position[t, 0], other_position[t, n, 1] - position[t, 1]
            vx, vy = other_speed[t, n] * c - speed[t] * cos, other_speed[t, n] * s - speed[t] * sin
            for ahead in times:
                if ahead >= found[t]:
                    break
                x, y = dx + vx * ahead, dy + vy * ahead
                if is_overlapping(x, y, (cos, sin, size[0, 0], size[0, 1]), (c, s, size[1 + n, 0], size[1 + n, 1])):
                    found[t] = ahead
