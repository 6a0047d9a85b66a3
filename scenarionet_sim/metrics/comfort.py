"""Comfort: acceleration, jerk and yaw, with the bounds of nuPlan's metric ``ego_is_comfortable``.

Bounds, window lengths and orders are those of nuplan-devkit's closed-loop metrics: accelerations are smoothed
(window 8, order 2), jerks are derivatives of the smoothed accelerations (window 15, order 2), yaw rate and yaw
acceleration are derivatives of the unwrapped heading (window 5; order 2 and 3).
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64, IntP
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.metrics.smoothing import fit, smooth_series

_DECIMALS = 8
_LOWEST, _HIGHEST = -4.05, np.array([2.40, 4.89, 8.37, 4.13, 0.95, 1.93])
"""Lower bound of the first of ``Comfort``, and upper bounds of the others."""


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

    def compare_with_bounds(self, is_within: Callable[[Any, Any], Any]) -> bool:
        """Return whether every extreme is within its bound by a comparison: with the bound itself, or without."""
        return bool(are_within_bounds(np.array([[*vars(self).values()]]), is_within)[0])


def are_within_bounds(extremes: Float64, is_within: Callable[[Any, Any], Any] = operator.le) -> Bool:
    """Return which episodes (B,) have all extremes (B, 7), in the order of ``Comfort``, within their bounds."""
    found: Bool = is_within(_LOWEST, extremes[:, 0]) & is_within(extremes[:, 1:], _HIGHEST).all(axis=1)
    return found


def measure_comfort(acceleration: Float64, heading: Float64, dt: float) -> Comfort:
    """Return the extremes of an episode.

    Args:
        acceleration: (T, 2) longitudinal and lateral [m/s²], see :func:`body_acceleration`.
        heading: (T,) [rad], wrapped or not.
        dt: [s].
    """
    (found,) = measure_comforts(acceleration, heading, np.array([0, len(heading)]), np.array([dt])).tolist()
    return Comfort(*found)


def measure_comforts(acceleration: Float64, heading: Float64, offsets: Int64, dt: Float64) -> Float64:
    """Return the extremes (B, 7) of B episodes, of S moments in total, in the order of ``Comfort``.

    Args:
        acceleration, heading: (S, 2) and (S,), see :func:`measure_comfort`.
        offsets: (B + 1,) first moment of each.
        dt: (B,) [s].
    """
    extremes, counts = np.zeros((len(dt), 7)), np.diff(offsets)
    series = np.empty(_NUM_SERIES * int(counts.max(initial=0)))
    lengths = np.minimum(counts, _LONGEST_WINDOW)
    for length in np.unique(lengths).tolist():
        smooth, slope, turn, bend = (fit(min(window, length), order) for window, order in _FITS)
        which = np.flatnonzero(lengths == length)
        find_extremes(which, offsets, acceleration, heading, dt, (smooth, slope, turn, bend), series, extremes)
    return extremes


_FITS = (8, 2), (15, 2), (5, 2), (5, 3)
"""Window and order for accelerations, jerks, yaw rate and yaw acceleration."""

_LONGEST_WINDOW = max(window for window, _ in _FITS)

LON, LAT, SIZE, LON_JERK, JERK, YAW_RATE, YAW_ACCELERATION, _RAW, _TURN, _NUM_SERIES = range(10)
"""Series of an episode: smoothed accelerations along and across, and their magnitude; their derivatives; those of the
heading; what is smoothed next, and the heading without jumps."""


@kernel(allocates=False)
def find_extremes(
    which: IntP, offsets: Int64, accelerations: Float64, headings: Float64, dt: Float64,
    fits: tuple[Float64, Float64, Float64, Float64], memory: Float64, extremes: Float64,
) -> None:  # fmt: skip
    """Write the extremes (B, 7) of some episodes, in the order of ``Comfort``.

    Args:
        which: The episodes.
        offsets, accelerations, headings, dt: See :func:`measure_comforts`.
        fits: For ``_FITS``.
        memory: (_NUM_SERIES * T,) memory.
        extremes: Output.
    """
    for b in which:
        begin, end = offsets[b], offsets[b + 1]
        found, series = extremes[b], memory[: _NUM_SERIES * (end - begin)].reshape((_NUM_SERIES, end - begin))
        _find_extremes(accelerations[begin:end], headings[begin:end], dt[b], fits, series, found)


@device_function
def _find_extremes(
    acceleration: Float64,
    heading: Float64,
    dt: float,
    fits: tuple[Float64, Float64, Float64, Float64],
    series: Float64,
    extremes: Float64,
) -> None:
    """Write the extremes (7,) of an episode; see :func:`find_extremes`."""
    turns = 0.0
    for t in range(len(heading)):
        if t and abs(heading[t] - heading[t - 1]) > math.pi:
            turns += (heading[t] - heading[t - 1] + math.pi) // (2.0 * math.pi)
        series[_TURN, t] = heading[t] - turns * 2.0 * math.pi
    for row in (LON, LAT, SIZE):
        for t in range(len(heading)):
            size = math.hypot(acceleration[t, 0], acceleration[t, 1])
            series[_RAW, t] = size if row == SIZE else acceleration[t, row]
        smooth_series(series[_RAW], fits[0], 0, dt, series[row])
        _round(series[row])
    smooth_series(series[LON], fits[1], 1, dt, series[LON_JERK])
    smooth_series(series[SIZE], fits[1], 1, dt, series[JERK])
    smooth_series(series[_TURN], fits[2], 1, dt, series[YAW_RATE])
    smooth_series(series[_TURN], fits[3], 2, dt, series[YAW_ACCELERATION])
    for row in range(LON_JERK, _RAW):
        _round(series[row])
    extremes[0], extremes[1] = series[LON, 0], series[LON, 0]
    for t in range(len(heading)):
        extremes[0], extremes[1] = min(extremes[0], series[LON, t]), max(extremes[1], series[LON, t])
        for n, row in enumerate((LAT, JERK, LON_JERK, YAW_RATE, YAW_ACCELERATION)):
            extremes[2 + n] = max(extremes[2 + n], abs(series[row, t])) if t else abs(series[row, t])


@device_function
def _round(values: Float64) -> None:
    """Round to ``_DECIMALS`` decimals, as ``numpy.round``."""
    for n in range(len(values)):
        values[n] = np.rint(values[n] * 10.0**_DECIMALS) / 10.0**_DECIMALS


def body_acceleration(velocity: Float64, heading: Float64, dt: float) -> Float64:
    """Return longitudinal and lateral acceleration (T, 2), by central differences.

    Args:
        velocity: (T, 2) along the scenario's axes [m/s].
        heading: (T,) [rad].
        dt: [s].
    """
    found = np.zeros((len(velocity), 2))
    if len(velocity) > 1:
        _accelerate(velocity.astype(np.float64), heading.astype(np.float64), dt, found)
    return found


@kernel(allocates=False)
def _accelerate(velocity: Float64, heading: Float64, dt: float, found: Float64) -> None:
    accelerate(velocity, heading, dt, found)


@device_function
def accelerate(velocity: Float64, heading: Float64, dt: float, found: Float64) -> None:
    """Write the accelerations (T, 2); see :func:`body_acceleration`."""
    last = len(velocity) - 1
    for t in range(last + 1):
        first, end = max(t - 1, 0), min(t + 1, last)
        time = (end - first) * dt
        x, y = (velocity[end, 0] - velocity[first, 0]) / time, (velocity[end, 1] - velocity[first, 1]) / time
        cos, sin = math.cos(heading[t]), math.sin(heading[t])
        found[t, 0], found[t, 1] = cos * x + sin * y, cos * y - sin * x
