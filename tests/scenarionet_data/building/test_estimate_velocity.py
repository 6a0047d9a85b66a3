"""Velocity estimated from positions."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.geometry import estimate_velocity


def test_parabola_has_exact_derivatives_at_inner_points() -> None:
    times = np.array([0.0, 0.1, 0.2, 0.3, 0.4])
    position = np.stack([times**2, 3.0 * times, np.zeros(5)], axis=-1)[None]
    velocity = estimate_velocity(position, np.ones((1, 5), bool), times)
    np.testing.assert_allclose(velocity[0, :, 1], 3.0)
    np.testing.assert_allclose(velocity[0, 1:-1, 0], 2.0 * times[1:-1], atol=1e-12)
    np.testing.assert_allclose(velocity[0, [0, -1], 0], [0.1, 0.7])


def test_uneven_times_and_gaps() -> None:
    times = np.array([0.0, 0.1, 0.25, 0.3, 0.5, 0.6])
    position = np.stack([5.0 * times, -2.0 * times], axis=-1)[None].repeat(2, axis=0)
    valid = np.array([[1, 1, 0, 1, 1, 1], [0, 1, 0, 0, 1, 0]], bool)
    position[~valid] = np.nan
    velocity = estimate_velocity(position, valid, times)
    np.testing.assert_allclose(velocity[0, valid[0]], np.tile([5.0, -2.0], (5, 1)))
    assert not velocity[0, 2].any()
    assert not velocity[1].any()  # states without a valid neighbour


def test_one_timestep() -> None:
    assert estimate_velocity(np.ones((3, 1, 3)), np.ones((3, 1), bool), np.zeros(1)).tolist() == [[[0.0, 0.0]]] * 3
