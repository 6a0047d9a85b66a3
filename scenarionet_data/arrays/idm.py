"""Car-following (IDM) and lane-changing (MOBIL) laws, as scalar functions that compile into traffic kernels."""

from __future__ import annotations

import numpy as np

from scenarionet_data.compiled.decorators import device_function

EXPONENT = 4.0
_SMALLEST_GAP = 0.1  # [m]


@device_function
def free_acceleration(speed: float, desired: float, accel: float, decel: float) -> float:
    """Acceleration on an empty road, at least ``-decel`` [m/s2]."""
    return float(max(accel * (1.0 - (speed / desired) ** EXPONENT), -decel))


@device_function
def interaction(
    speed: float, gap: float, closing: float, headway: float, accel: float, decel: float, standstill: float
) -> float:
    """The braking term of the Intelligent Driver Model (Treiber, Hennecke, Helbing 2000), >= 0 [m/s2].

    Args:
        speed: Own speed [m/s].
        gap: Bumper to bumper [m].
        closing: Own speed minus the leader's [m/s].
        headway: Desired time gap [s].
        accel, decel: Comfortable acceleration and deceleration [m/s2].
        standstill: Desired gap at rest [m].
    """
    dynamic = speed * headway + speed * closing / (2.0 * np.sqrt(accel * decel))
    desired_gap = standstill + max(0.0, dynamic)
    return float(accel * (desired_gap / max(gap, _SMALLEST_GAP)) ** 2)


@device_function
def is_worth_changing(own_gain: float, follower_loss: float, politeness: float, threshold: float) -> bool:
    """MOBIL's incentive (Kesting, Treiber, Helbing 2007): own gain against the new follower's loss [m/s2]."""
    return own_gain - politeness * follower_loss > threshold
