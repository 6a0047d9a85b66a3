"""Comfort of plans: alone, after the motion that preceded it, and beside the plan of the frame before.

Source: navsim, ``planner/pdm_planner/scoring/pdm_comfort_metrics.py`` (definitions): the bounds and filters of
nuPlan's ``ego_is_comfortable``, here without their ends.
"""

from __future__ import annotations

import operator

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.metrics.comfort import measure_comfort
from scenarionet_sim.metrics.drive import EgoDrive
from scenarionet_sim.metrics.smoothing import savitzky_golay

TWO_FRAME_BOUNDS = (0.7, 0.5, 0.1, 0.1)
"""Largest root mean square differences of acceleration [m/s²], jerk, yaw rate [rad/s] and yaw acceleration."""

_DECIMALS = 8


def is_plan_comfortable(plan: EgoDrive) -> bool:
    """Whether a plan is comfortable by itself, as in PDMS."""
    return _is_comfortable(plan.acceleration, plan.heading, plan.dt)


def is_history_comfortable(history: EgoDrive, plan: EgoDrive) -> bool:
    """Whether a plan is comfortable after the motion before it, as in EPDMS.

    Args:
        history: The recorded motion up to the moment before the plan.
        plan: The plan, at the same interval.
    """
    acceleration = np.concatenate([history.acceleration, plan.acceleration])
    return _is_comfortable(acceleration, np.concatenate([history.heading, plan.heading]), plan.dt)


def is_two_frame_comfortable(plan: EgoDrive, before: EgoDrive, elapsed: float) -> bool:
    """Whether a plan moves like the plan of the frame before, where they overlap: extended comfort.

    Args:
        plan: The plan.
        before: The plan of the frame before, as long.
        elapsed: Time between both frames [s].
    """
    shift = round(elapsed / plan.dt)
    now = _features(plan.acceleration[:-shift], plan.heading[:-shift], plan.dt)
    then = _features(before.acceleration[shift:], before.heading[shift:], plan.dt)
    differences = np.sqrt(np.mean((now - then) ** 2, axis=1))
    return bool((differences <= TWO_FRAME_BOUNDS).all())


def _is_comfortable(acceleration: Float64, heading: Float64, dt: float) -> bool:
    return measure_comfort(acceleration, heading, dt).compare_with_bounds(operator.lt)


def _features(acceleration: Float64, heading: Float64, dt: float) -> Float64:
    """(4, T) acceleration, jerk, yaw rate and yaw acceleration, the last with polynomials of order 2 as the owner's."""
    size = np.round(savitzky_golay(np.hypot(*acceleration.T), 8, 2, dt), _DECIMALS)
    turn = np.unwrap(heading)
    series = (
        size,
        savitzky_golay(size, 15, 2, dt, derivative=1),
        savitzky_golay(turn, 5, 2, dt, derivative=1),
        savitzky_golay(turn, 5, 2, dt, derivative=2),
    )
    found: Float64 = np.array(series, np.float64)
    return found.round(_DECIMALS)
