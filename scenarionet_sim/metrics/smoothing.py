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
    window = min(window, count)
    if window <= order:
        return np.full(values.shape, np.nan)
    series = values.reshape(-1, count)
    polynomials = np.lib.stride_tricks.sliding_window_view(series, window, axis=-1) @ _fit(window, order).T
    smooth = np.empty_like(series)
    _evaluate_windows(polynomials, window, derivative, dt**derivative, smooth)
    return smooth.reshape(values.shape)


@kernel(allocates=False)
def _evaluate_windows(polynomials: Float64, window: int, derivative: int, unit: float, smooth: Float64) -> None:
    """Write a derivative (S, T) of the polynomials through the windows of some series.

    Args:
        polynomials: (S, W, C) coefficients, which rise in degree, by window.
        window: Window length [samples].
        derivative: Order of the derivative.
        unit: Sampling interval to the power of that order.
        smooth: (S, T) output.
    """
    half, middle, last = window // 2, 0.5 * (window - 1), polynomials.shape[1] - 1
    scale = 1.0
    for power in range(2, derivative + 1):
        scale *= power
    for s in range(len(smooth)):
        for start in range(last + 1):
            smooth[s, start + int(middle)] = polynomials[s, start, derivative] * (scale / unit)
        for n in range(half):
            smooth[s, n] = _evaluate(polynomials[s, 0], n - middle, derivative) / unit
            end = _evaluate(polynomials[s, last], window - half - middle + n, derivative)
            smooth[s, smooth.shape[1] - half + n] = end / unit


@device_function
def _evaluate(polynomial: Float64, at: float, derivative: int) -> float:
    """Return the value of a derivative of a polynomial, whose coefficients rise in degree, by Horner's rule."""
    value = 0.0
    for power in range(len(polynomial) - 1, derivative - 1, -1):
        factor = polynomial[power]
        for degree in range(power, power - derivative, -1):
            factor *= degree
        value = factor + value * at
    return value


@cache
def _fit(window: int, order: int) -> Float64:
    """Matrix (order + 1, window) from the samples of a window to the coefficients of their polynomial."""
    return np.linalg.pinv(np.vander(np.arange(window) - (window - 1) / 2, order + 1, increasing=True))
