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
    _project(
        ego.position, ego.heading, ego.speed, ego.rear_axle, np.array([ego.length, ego.width]),
        others.position, others.heading, others.speed, others.size, counts, ~is_in_lane | is_in_intersection,
        times, found,
    )  # fmt: skip
    found[[each.step for each in collisions if each.is_at_fault]] = 0.0
    return found


@kernel
def _project(
    position: Float64, heading: Float64, speed: Float64, rear_axle: Float64, size: Float64, others: Float64,
    other_heading: Float64, other_speed: Float64, other_size: Float64, counts: Bool, sees_beside: Bool, times: Float64,
    found: Float64,
) -> None:  # fmt: skip
    """Fill the first of ``times`` at which the projected boxes overlap, for each moment."""
    for t in range(len(position)):
        if speed[t] <= _STANDING:
            continue
        cos, sin = math.cos(heading[t]), math.sin(heading[t])
        limit = BEHIND if sees_beside[t] else AHEAD
        for n in range(others.shape[1]):
            if not counts[t, n]:
                continue
            x, y = others[t, n, 0] - rear_axle[t, 0], others[t, n, 1] - rear_axle[t, 1]
            along = (cos * x + sin * y) / max(math.hypot(x, y), 1e-9)
            if along <= limit:
                continue
            c, s = math.cos(other_heading[t, n]), math.sin(other_heading[t, n])
            dx, dy = others[t, n, 0] - position[t, 0], others[t, n, 1] - position[t, 1]
            vx, vy = other_speed[t, n] * c - speed[t] * cos, other_speed[t, n] * s - speed[t] * sin
            for ahead in times:
                if ahead >= found[t]:
                    break
                if is_overlapping(
                    dx + vx * ahead,
                    dy + vy * ahead,
                    cos,
                    sin,
                    size[0],
                    size[1],
                    c,
                    s,
                    other_size[n, 0],
                    other_size[n, 1],
                ):
                    found[t] = ahead
