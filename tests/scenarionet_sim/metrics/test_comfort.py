"""Comfort of motions with known accelerations and turns."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_sim.metrics.comfort import body_acceleration, measure_comfort

DT = 0.1
TIME = DT * np.arange(60)


def straight(acceleration: np.ndarray) -> np.ndarray:
    return np.column_stack((acceleration, np.zeros(len(TIME))))


def test_steady_braking():
    comfort = measure_comfort(straight(np.full(60, -4.0)), np.zeros(60), DT)
    assert comfort.min_lon_acceleration == pytest.approx(-4.0)
    assert comfort.max_lon_acceleration == pytest.approx(-4.0)
    assert comfort.max_lat_acceleration == comfort.max_jerk == comfort.max_lon_jerk == comfort.max_yaw_rate == 0.0
    assert comfort.is_comfortable
    assert not measure_comfort(straight(np.full(60, -4.06)), np.zeros(60), DT).is_comfortable
    assert measure_comfort(straight(np.full(60, 2.4)), np.zeros(60), DT).is_comfortable
    assert not measure_comfort(straight(np.full(60, 2.41)), np.zeros(60), DT).is_comfortable


def test_rising_acceleration_is_a_jerk():
    comfort = measure_comfort(straight(0.4 * TIME), np.zeros(60), DT)
    assert comfort.max_lon_jerk == pytest.approx(0.4, rel=0.15), (
        "an even window shifts the smoothed series by half a step"
    )
    assert comfort.max_jerk == pytest.approx(comfort.max_lon_jerk)
    assert comfort.is_comfortable
    swings = straight(2.0 * np.sin(3.0 * TIME))
    assert measure_comfort(swings, np.zeros(60), DT).max_lon_jerk > 4.13
    assert not measure_comfort(swings, np.zeros(60), DT).is_comfortable


def test_turning():
    comfort = measure_comfort(np.zeros((60, 2)), np.pi - 0.3 + 0.9 * TIME, DT)
    assert comfort.max_yaw_rate == pytest.approx(0.9) and comfort.max_yaw_acceleration == pytest.approx(0.0, abs=1e-6)
    wrapped = (np.pi - 0.3 + 0.9 * TIME + np.pi) % (2 * np.pi) - np.pi
    assert measure_comfort(np.zeros((60, 2)), wrapped, DT).max_yaw_rate == pytest.approx(0.9)
    faster = measure_comfort(np.zeros((60, 2)), 0.5 * 0.1 * TIME**2, DT)
    assert faster.max_yaw_rate == pytest.approx(0.1 * TIME[-1])
    assert faster.max_yaw_acceleration == pytest.approx(0.1)
    assert not measure_comfort(np.zeros((60, 2)), 0.96 * TIME, DT).is_comfortable


def test_episodes_too_short_to_measure():
    assert np.isnan(measure_comfort(np.zeros((2, 2)), np.zeros(2), DT).max_jerk)


def test_acceleration_in_the_vehicles_frame():
    """A circle of 10 m at 5 m/s: 2.5 m/s² to the left, nothing along."""
    turn = 0.5 * TIME
    velocity = 5.0 * np.column_stack((np.cos(turn), np.sin(turn)))
    acceleration = body_acceleration(velocity, turn, DT)[1:-1]
    assert acceleration[:, 0] == pytest.approx(0.0, abs=1e-9)
    assert acceleration[:, 1] == pytest.approx(2.5, rel=1e-3)
    assert body_acceleration(velocity[:1], turn[:1], DT).tolist() == [[0.0, 0.0]]
