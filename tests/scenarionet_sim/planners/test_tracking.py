"""Trackers: nuPlan's LQR and bicycle against the numbers of its devkit, and perfect tracking."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenarionet_data.errors import BadParameter
from scenarionet_sim.planners.base import Trajectory
from scenarionet_sim.planners.tracking import Lqr, PerfectTracking, TrackedVehicle

# x, y, heading, speed, steering and yaw rate after some steps: LQRTracker and KinematicBicycleModel of nuplan-devkit
# e924167 with a vehicle of 5 m, axles 1.5 m from its centre, along the trajectory of ``winding``.
DEVKIT = {
    0: (0.19724227, 0.50495233, 0.05333378, 5.06458396, 0.0201498, 0.03402138),
    1: (0.70269981, 0.53704634, 0.05673592, 5.17320291, 0.02102031, 0.03625278),
    4: (2.29360883, 0.65170683, 0.06885165, 5.63076192, 0.02729478, 0.05124286),
    9: (5.26153735, 0.94358443, 0.10268039, 6.44420534, 0.04440468, 0.09544704),
    19: (12.12605379, 2.24533345, 0.23732456, 7.49883267, 0.06663969, 0.1668203),
    39: (26.13015386, 8.11644534, 0.47304557, 7.24166511, 0.01141631, 0.02755888),
}


def winding() -> tuple[np.ndarray, np.ndarray]:
    """Poses (80, 3) of box centres and their times: a winding way, faster and slower."""
    times = 0.1 * np.arange(80)
    speed, heading = 6.0 + 2.0 * np.sin(0.6 * times), 0.5 * np.sin(0.35 * times)
    steps = 0.1 * speed[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    position = np.vstack([[0.0, 0.0], np.cumsum(steps, axis=0)[:-1]])
    return np.column_stack([position, heading]), times


def test_lqr_drives_as_the_devkit():
    poses, times = winding()
    vehicle = TrackedVehicle(
        -1.8 + 1.5 * math.cos(0.05), 0.4 + 1.5 * math.sin(0.05), 0.05, 5.0, 0.0, 5.0, steering=0.02
    )
    for step in range(40):
        Lqr().follow(vehicle, Trajectory(poses[step:], times[step:] - times[step]), 0.1)
        if step in DEVKIT:
            found = vehicle.x, vehicle.y, vehicle.heading, vehicle.speed, vehicle.steering, vehicle.yaw_rate
            np.testing.assert_allclose(found, DEVKIT[step], atol=2e-8)


def test_lqr_stops_and_stands():
    vehicle = TrackedVehicle(0.0, 0.0, 0.0, 0.15, 0.0, 4.5, steering=0.1)
    here = Trajectory.every(0.5, [[0.0, 0.0, 0.0]] * 8)
    for _ in range(100):
        Lqr().follow(vehicle, here, 0.1)
    assert abs(vehicle.speed) < 1e-2 and abs(vehicle.x) < 0.5
    assert vehicle.steering == 0.1, "it steers in standing"


def test_perfect_tracking_is_on_the_trajectory():
    poses, times = winding()
    vehicle = TrackedVehicle(0.0, 0.0, 0.0, 6.0, 0.0, 5.0)
    for step in range(30):
        PerfectTracking().follow(vehicle, Trajectory(poses[step:], times[step:] - times[step]), 0.1)
        np.testing.assert_allclose([vehicle.x, vehicle.y, vehicle.heading], poses[step + 1], atol=1e-12)
    assert vehicle.speed == pytest.approx(6.0 + 2.0 * math.sin(0.6 * 3.0), rel=0.02)
    assert math.hypot(*vehicle.velocity) == pytest.approx(vehicle.speed)


def test_trajectories_turn_the_short_way():
    there = Trajectory(np.array([[0.0, 0.0, 3.1], [1.0, 2.0, -3.1]]), np.array([0.0, 1.0])).at(np.array([0.5, 9.0]))
    np.testing.assert_allclose(np.abs(there), [[0.5, 1.0, np.pi], [1.0, 2.0, 3.1]], atol=1e-12)


@pytest.mark.parametrize(
    ("poses", "times", "message"),
    [
        (np.zeros((3, 2)), np.arange(3.0), r"expected \(K, 3\)"),
        (np.zeros((0, 3)), np.zeros(0), r"expected \(K, 3\)"),
        (np.full((1, 3), np.nan), np.ones(1), "not finite"),
        (np.zeros((2, 3)), np.array([0.2, 0.2]), "must rise"),
        (np.zeros((1, 3)), -np.ones(1), "must rise"),
    ],
)
def test_impossible_trajectories_are_refused(poses, times, message):
    with pytest.raises(BadParameter, match=message):
        Trajectory(poses, times)
