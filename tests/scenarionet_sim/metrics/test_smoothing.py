"""The Savitzky-Golay filter against published coefficients and against polynomials, which it reproduces."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_sim.metrics.smoothing import savitzky_golay


def test_five_points_second_order_match_published_coefficients():
    values = np.array([3.0, -1.0, 4.0, 1.0, -5.0, 9.0, 2.0])
    smooth = savitzky_golay(values, 5, 2, dt=1.0)
    wanted = [np.dot([-3, 12, 17, 12, -3], values[k - 2 : k + 3]) / 35 for k in (2, 3, 4)]
    assert smooth[2:5] == pytest.approx(wanted)
    first = savitzky_golay(values, 5, 2, dt=0.5, derivative=1)
    wanted = [np.dot([-2, -1, 0, 1, 2], values[k - 2 : k + 3]) / 10 / 0.5 for k in (2, 3, 4)]
    assert first[2:5] == pytest.approx(wanted)


@pytest.mark.parametrize("derivative", [0, 1, 2])
def test_polynomials_are_reproduced_up_to_their_ends(derivative):
    time = 0.1 * np.arange(25)
    cubic = np.polynomial.Polynomial([1.0, -2.0, 3.0, 0.5])
    found = savitzky_golay(cubic(time), 7, 3, dt=0.1, derivative=derivative)
    assert found == pytest.approx(cubic.deriv(derivative)(time) if derivative else cubic(time))


def test_even_window_shifts_by_half_a_sample():
    """As scipy.signal.savgol_filter does; its first and last half window are not shifted."""
    time = np.arange(20.0)
    found = savitzky_golay(time, 8, 2, dt=1.0)
    assert found[4:16] == pytest.approx(time[4:16] + 0.5)
    assert found[:4] == pytest.approx(time[:4]) and found[16:] == pytest.approx(time[16:])


def test_short_series():
    assert np.isnan(savitzky_golay(np.array([1.0, 2.0]), 5, 2, dt=1.0)).all()
    assert savitzky_golay(np.array([1.0, 2.0, 5.0]), 15, 2, dt=1.0) == pytest.approx([1.0, 2.0, 5.0])
