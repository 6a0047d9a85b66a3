"""nuPlan's closed-loop score, and the parts of it that are a few lines.

Source: nuplan-devkit, ``config/simulation/metric_aggregator/closed_loop_*_agents_weighted_average.yaml`` (multipliers
and weights; the owner's documentation lists driving direction among the weights, the configuration that runs does not)
and ``planning/metrics/evaluation_metrics/common`` (definitions).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int64
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.errors import BadParameter

MULTIPLIERS = (
    "no_ego_at_fault_collisions",
    "drivable_area_compliance",
    "driving_direction_compliance",
    "ego_is_making_progress",
)
WEIGHTS: Mapping[str, float] = {
    "ego_progress_along_expert_route": 5.0,
    "time_to_collision_within_bound": 5.0,
    "speed_limit_compliance": 4.0,
    "ego_is_comfortable": 2.0,
}

_MIN_PROGRESS = 2.0
"""Lower bound of both distances in the ratio; reversing by more gives a ratio of 0 [m]."""

_MAX_OVERSPEED = 2.23  # [m/s]
_DIRECTION_WINDOW = 1.0  # [s]


def closed_loop_score(parts: Mapping[str, float | None]) -> float:
    """The score of a scenario: the product of the multipliers times the weighted mean of the other parts.

    Args:
        parts: Scores from 0 to 1 by the names of MULTIPLIERS and WEIGHTS; None where a part cannot be decided, for
            example without a map, which leaves it out.

    Raises:
        BadParameter: A name is unknown.

    Example:
        >>> closed_loop_score({"ego_is_making_progress": 1, "ego_is_comfortable": 0, "speed_limit_compliance": 1})
        0.6666666666666666
    """
    unknown = sorted(set(parts) - {*MULTIPLIERS, *WEIGHTS})
    if unknown:
        raise BadParameter(f"no part {unknown[0]!r}; there are {', '.join([*MULTIPLIERS, *WEIGHTS])}")
    known = {name: value for name, value in parts.items() if value is not None}
    factor = float(math.prod(known[name] for name in MULTIPLIERS if name in known))
    weights = {name: weight for name, weight in WEIGHTS.items() if name in known}
    total = sum(weight * known[name] for name, weight in weights.items())
    return factor * total / sum(weights.values()) if weights else 0.0


def speed_limit_score(overspeed: Float64, time: Float64) -> float:
    """1 without speeding, 0 when it averages 2.23 m/s (5 mph) over the drive.

    Args:
        overspeed: (T,) speed above the limit, else 0 [m/s].
        time: (T,) [s].
    """
    duration = float(time[-1] - time[0])
    if duration <= 0.0:
        return 1.0
    return max(0.0, 1.0 - float(overspeed.sum()) * float(np.diff(time).mean()) / (_MAX_OVERSPEED * duration))


def driving_direction(progress: Sequence[float] | Float64, dt: float) -> tuple[float, float]:
    """Score of driving against the traffic, and the smallest progress within one second [m].

    The score is 1 below 2 m, 0.5 below 6 m, else 0. As in the owner's code, the absolute value of the smallest
    progress counts, which also concerns a drive that makes more than 2 m in its very first moment.

    Args:
        progress: (T,) movement along the lane since the moment before [m].
        dt: [s].
    """
    offsets = np.array([0, len(progress)])
    (distance,) = wrong_way_distances(np.asarray(progress, np.float64), offsets, np.array([dt])).tolist()
    return direction_score(distance), -distance


def wrong_way_distances(progress: Float64, offsets: Int64, dt: Float64) -> Float64:
    """Return the distances (B,) [m] of :func:`driving_direction`.

    Args:
        progress: (S,) movements of all drives [m].
        offsets: (B + 1,) first moment of each.
        dt: (B,) [s].
    """
    found, total = np.empty(len(dt)), np.empty(int(np.diff(offsets).max(initial=0)) + 1)
    _find_distances(progress, offsets, dt, total, found)
    return found


@kernel(allocates=False)
def _find_distances(progress: Float64, offsets: Int64, dt: Float64, total: Float64, found: Float64) -> None:
    """Write the distances; ``total`` is memory for the sums over a drive."""
    for b in range(len(found)):
        begin, count, smallest, total[0] = offsets[b], offsets[b + 1] - offsets[b], np.inf, 0.0
        lag = int(_DIRECTION_WINDOW / dt[b] + 1e-6) + 1
        for t in range(1, count + 1):
            total[t] = total[t - 1] + progress[begin + t - 1]
            before = total[t - lag] if t > lag else 0.0
            smallest = min(smallest, total[t] - before)
        found[b] = abs(smallest)


def direction_score(distance: float, limit: float = 6.0) -> float:
    """1 below 2 m driven against the traffic within one second, 0.5 below ``limit`` [m], else 0."""
    return 1.0 if distance < 2.0 else 0.5 if distance < limit else 0.0


def progress_score(ratio: float) -> float:
    """1 from a fifth of the recorded progress on, else 0: ``ego_is_making_progress``."""
    return float(ratio >= 0.2)


def progress_ratio(driven: float, recorded: float) -> float:
    """Return the share of the recorded progress along the route, as nuPlan's ``ego_progress_along_expert_route``.

    Args:
        driven, recorded: Progress of the driver, and of the recording [m].
    """
    if driven < -_MIN_PROGRESS:
        return 0.0
    return min(1.0, max(driven, _MIN_PROGRESS) / max(recorded, _MIN_PROGRESS))
