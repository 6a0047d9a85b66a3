"""The Savitzky-Golay filter: derivatives of noisy series by fitting polynomials to moving windows.

A. Savitzky and M. J. E. Golay, Analytical Chemistry 36 (1964) 1627. Ends and even windows are treated as in
``scipy.signal.savgol_filter`` with its default mode "interp", which nuPlan's metrics use: the first and last half
window come from the polynomial of the first and last whole window, and an even window's value lies half a sample
after its place.
"""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Float64


def savitzky_golay(values: Float64, window: int, order: int, dt: float, derivative: int = 0) -> Float64:
    """A smoothed series, or a derivative of it.

    Args:
        values: (T,).
        window: Samples that each polynomial is fitted to; no more than there are.
        order: Of the polynomials.
        dt: Between samples.
        derivative: Which; 0 is the series itself.

    Returns:
        (T,); NaN when there are not more samples than ``order``.

    Example:
        >>> savitzky_golay(np.array([0.0, 1.0, 4.0, 9.0, 16.0]), 5, 2, dt=1.0, derivative=1).round(6).tolist()
        [0.0, 2.0, 4.0, 6.0, 8.0]
    """
    count, window = len(values), min(window, len(values))
    if window <= order:
        return np.full(count, np.nan)
    half, middle = window // 2, (window - 1) / 2
    fit = np.linalg.pinv(np.vander(np.arange(window) - middle, order + 1, increasing=True))  # window to polynomial
    scale = math.factorial(derivative) / dt**derivative
    starts = np.arange(count - window + 1)
    polynomials = np.lib.stride_tricks.sliding_window_view(values, window) @ fit.T
    smooth = np.empty(count)
    smooth[starts + math.floor(middle)] = polynomials[:, derivative] * scale
    ends = np.arange(half, dtype=np.float64) - middle
    smooth[:half] = _evaluate(polynomials[0], ends, derivative) / dt**derivative
    smooth[count - half :] = _evaluate(polynomials[-1], ends + (window - half), derivative) / dt**derivative
    return smooth


def _evaluate(polynomial: Float64, at: Float64, derivative: int) -> Float64:
    derived = (
        np.polynomial.Polynomial(polynomial).deriv(derivative) if derivative else np.polynomial.Polynomial(polynomial)
    )
    return np.asarray(derived(at), np.float64)
