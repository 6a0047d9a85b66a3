"""Savitzky-Golay filter: smoothing and derivatives by polynomial fits to moving windows.

A. Savitzky and M. J. E. Golay, Analytical Chemistry 36 (1964) 1627. Ends and even windows are treated as in
``scipy.signal.savgol_filter`` with its default mode "interp", which nuPlan's metrics use: the first and last half
window use the polynomial of the first and last full window, and the output of an even window is shifted by half a
sample.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.compiled.decorators import device_function, kernel


def savitzky_golay(values: Float64, window: int, order: int, dt: float, derivative: int = 0) -> Float64:
    """Return the smoothed series or a derivative of it.

    Args:
        values: (..., T).
        window: Window length [samples], at most T.
        order: Order of the polynomials.
        dt: Sampling interval [s].
        derivative: Order of the derivative; 0 for the series itself.

    Returns:
        (..., T); NaN if there are at most ``order`` samples.

    Example:
        >>> savitzky_golay(np.array([0.0, 1.0, 4.0, 9.0, 16.0]), 5, 2, dt=1.0, derivative=1).round(6).tolist()
        [0.0, 2.0, 4.0, 6.0, 8.0]
    """
    count = values.shape[-1]
    series = np.ascontiguousarray(values.reshape(-1, count))
    smooth = np.empty_like(series)
    _smooth_all(series, fit(min(window, count), order), derivative, dt, smooth)
    return smooth.reshape(values.shape)


@kernel(allocates=False)
def _smooth_all(series: Float64, fitted: Float64, derivative: int, dt: float, smooth: Float64) -> None:
    """Smooth series (S, T); see :func:`smooth_series`."""
    for s in range(len(series)):
        smooth_series(series[s], fitted, derivative, dt, smooth[s])


@device_function
def smooth_series(series: Float64, fitted: Float64, derivative: int, dt: float, smooth: Float64) -> None:
    """Write a derivative (T,) of the polynomials through the windows of a series (T,).

    Args:
        series: The samples.
        fitted: See :func:`fit`.
        derivative: Order of the derivative.
        dt: Sampling interval [s].
        smooth: Output; NaN where the windows have at most ``order`` samples.
    """
    order, window = fitted.shape[0] - 1, fitted.shape[1]
    half, middle, last = window // 2, 0.5 * (window - 1), len(series) - window
    if window <= order:
        smooth[:] = np.nan
        return
    unit, scale = dt**derivative, 1.0
    for power in range(2, derivative + 1):
        scale *= power
    for start in range(last + 1):
        coefficient = 0.0
        for k in range(window):
            coefficient += fitted[derivative, k] * series[start + k]
        smooth[start + int(middle)] = coefficient * (scale / unit)
    for n in range(half):
        smooth[n] = _evaluate(series, 0, fitted, n - middle, derivative) / unit
        end = _evaluate(series, last, fitted, window - half - middle + n, derivative)
        smooth[len(series) - half + n] = end / unit


@device_function
def _evaluate(series: Float64, start: int, fitted: Float64, at: float, derivative: int) -> float:
    """Return the value of a derivative of the polynomial through a window, by Horner's rule."""
    value = 0.0
    for power in range(fitted.shape[0] - 1, derivative - 1, -1):
        factor = 0.0
        for k in range(fitted.shape[1]):
            factor += fitted[power, k] * series[start + k]
        for degree in range(power, power - derivative, -1):
            factor *= degree
        value = factor + value * at
    return value


@cache
def fit(window: int, order: int) -> Float64:
    """Return the matrix (order + 1, window) from the samples of a window to their polynomial's rising coefficients."""
    return np.linalg.pinv(np.vander(np.arange(window) - (window - 1) / 2, order + 1, increasing=True))
