"""Comfort: acceleration, jerk and yaw, with the bounds of nuPlan's metric ``ego_is_comfortable``.

Bounds, window lengths and orders are those of nuplan-devkit's closed-loop metrics: accelerations are smoothed
(window 8, order 2), jerks are derivatives of the smoothed accelerations (window 15, order 2), yaw rate and yaw
acceleration are derivatives of the unwrapped heading (window 5; order 2 and 3).
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import astuple, dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_sim.metrics.smoothing import savitzky_golay

_DECIMALS = 8
_HIGHEST = 2.40, 4.89, 8.37, 4.13, 0.95, 1.93
"""Upper bounds of all but the first of ``Comfort``."""


@dataclass(frozen=True)
class Comfort:
    """Extremes over an episode; NaN if it is too short for the filter.

    Attributes:
        min_lon_acceleration, max_lon_acceleration: Longitudinal acceleration [m/s²].
        max_lat_acceleration: Absolute lateral acceleration [m/s²].
        max_jerk: Absolute derivative of the acceleration's magnitude [m/s³].
        max_lon_jerk: Absolute longitudinal jerk [m/s³].
        max_yaw_rate, max_yaw_acceleration: Absolute values [rad/s, rad/s²].
    """

    min_lon_acceleration: float
    max_lon_acceleration: float
    max_lat_acceleration: float
    max_jerk: float
    max_lon_jerk: float
    max_yaw_rate: float
    max_yaw_acceleration: float

    @property
    def is_comfortable(self) -> bool:
        """True if every extreme is within its bound."""
        return self.compare_with_bounds(operator.le)

    def compare_with_bounds(self, is_within: Callable[[float, float], bool]) -> bool:
        """Return whether every extreme is within its bound by a comparison: with the bound itself, or without."""
        lowest, *highest = astuple(self)
        return is_within(-4.05, lowest) and all(map(is_within, highest, _HIGHEST))


def measure_comfort(acceleration: Float64, heading: Float64, dt: float) -> Comfort:
    """Return the extremes of an episode.

    Args:
        acceleration: (T, 2) longitudinal and lateral [m/s²], see :func:`body_acceleration`.
        heading: (T,) [rad], wrapped or not.
        dt: [s].
    """
    series = np.array([*acceleration.T, np.hypot(*acceleration.T)])
    smooth = np.round(savitzky_golay(series, 8, 2, dt), _DECIMALS)
    lon, lat, _ = smooth
    lon_jerk, _, jerk = np.round(savitzky_golay(smooth, 15, 2, dt, derivative=1), _DECIMALS)
    turn = np.unwrap(heading)
    yaw_rate = np.round(savitzky_golay(turn, 5, 2, dt, derivative=1), _DECIMALS)
    yaw_acceleration = np.round(savitzky_golay(turn, 5, 3, dt, derivative=2), _DECIMALS)
    largest = np.abs([lat, jerk, lon_jerk, yaw_rate, yaw_acceleration]).max(axis=1).tolist()
    return Comfort(float(lon.min()), float(lon.max()), *largest)


def body_acceleration(velocity: Float64, heading: Float64, dt: float) -> Float64:
    """Return longitudinal and lateral acceleration (T, 2), by central differences.

    Args:
        velocity: (T, 2) along the scenario's axes [m/s].
        heading: (T,) [rad].
        dt: [s].
    """
    if len(velocity) < 2:
        return np.zeros((len(velocity), 2))
    change = np.gradient(velocity.astype(np.float64), dt, axis=0)
    cos, sin = np.cos(heading), np.sin(heading)
    return np.column_stack((cos * change[:, 0] + sin * change[:, 1], cos * change[:, 1] - sin * change[:, 0]))
