"""Steps of the kinematic bicycle, computed by hand."""

from __future__ import annotations

from math import atan, cos, hypot, inf, pi, sin, tan

import numpy as np
import pytest

from scenarionet_sim.arrays.log import HEADING, VX, VY, YAW_RATE
from scenarionet_sim.backends.bicycle_kernels import drive_bicycles

LENGTH, WHEELBASE, GRIP = 4.5, 0.6 * 4.5, 8.0


def step(motion, steering, throttle, dt=0.1, substeps=1, steer_rate=inf, angle=0.0):
    """Motion (7,) of a car after a step, with 0.5 rad at full lock, 4 m/s² of thrust and 8 m/s² of braking."""
    vehicle = np.array([[[0.5, 4.0, 8.0, 40.0, 0.6, GRIP, steer_rate, 0.0, 0.0, 0.0, angle]]])
    moved, size = np.array([[motion]], np.float64), np.array([[[LENGTH, 1.8, 1.5]]])
    actions = np.array([[steering, throttle]], np.float64)
    drive_bicycles(np.zeros((1, 2), np.int32), actions, dt, substeps, vehicle, size, moved)
    return moved[0, 0], vehicle[0, 0, -1]


def test_one_step_in_a_bend_by_the_midpoint_rule():
    slip = atan(tan(0.2) / 2)
    moved, angle = step([3.0, 4.0, 0.0, 0.3, 5 * cos(0.3 + slip), 5 * sin(0.3 + slip), 0.0], 0.4, 0.5)
    speed = 5.0 + 0.1 * 0.5 * 4.0
    turn = speed * tan(0.2) * cos(slip) / WHEELBASE
    course = 0.3 + slip + 0.05 * turn  # in the middle of the step
    assert moved[:2] == pytest.approx([3.0 + 0.1 * speed * cos(course), 4.0 + 0.1 * speed * sin(course)], abs=1e-12)
    assert moved[[HEADING, YAW_RATE]] == pytest.approx([0.3 + 0.1 * turn, turn], abs=1e-12)
    end = 0.3 + 0.1 * turn + slip
    assert moved[[VX, VY]] == pytest.approx([speed * cos(end), speed * sin(end)], abs=1e-12)
    assert angle == pytest.approx(0.2)


def test_one_step_of_full_braking_takes_the_brakes_deceleration():
    moved, _ = step([0.0, 0.0, 0.0, 0.0, 10.0, 0.0, 0.0], 0.0, -1.0)
    assert moved[[0, VX]] == pytest.approx([0.92, 9.2])


def test_wheels_turn_as_fast_as_they_can():
    _, angle = step([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0], 1.0, 0.0, substeps=5, steer_rate=2.0, angle=-0.1)
    assert angle == pytest.approx(0.1)


def test_the_friction_circle_limits_the_change_of_the_course():
    """The slip angle is a part of the course: it cannot jump to what the front wheels ask for."""
    moved, _ = step([0.0, 0.0, 0.0, 0.0, 20.0, 0.0, 0.0], 1.0, 0.0, dt=0.02)
    course = GRIP * 0.02 / 20.0
    slip = course / (1.0 + 20.0 * 0.02 / (0.5 * WHEELBASE))
    assert np.arctan2(moved[VY], moved[VX]) == pytest.approx(course, rel=1e-3)
    assert moved[HEADING] == pytest.approx(course - slip, rel=3e-3)
    assert moved[YAW_RATE] == pytest.approx(20.0 * 2.0 * sin(slip) / WHEELBASE, rel=0.01)  # slower: the wheels slide
    drag = (
        0.5 * GRIP * sin(0.5 - atan(2.0 * sin(slip)))
    )  # of the front axle, which has half the grip, across the wheels
    assert hypot(moved[VX], moved[VY]) == pytest.approx(20.0 - 0.02 * drag, abs=1e-4)


def test_braking_and_bend_share_the_friction_circle():
    moved, _ = step([0.0, 0.0, 0.0, 0.0, 20.0, 0.0, 0.0], 0.04, -0.5, dt=0.02)
    slip = atan(tan(0.02) / 2)
    swing = 20.0 * 0.02 * tan(0.02) * cos(slip) / WHEELBASE + slip
    asked = hypot(4.0, 20.0 * swing / 0.02)
    assert asked > GRIP
    course = swing * GRIP / asked
    assert np.arctan2(moved[VY], moved[VX]) == pytest.approx(course, rel=1e-2)
    assert hypot(moved[VX], moved[VY]) == pytest.approx(20.0 - 0.02 * 4.0 * GRIP / asked, abs=2e-3)


@pytest.mark.parametrize("steer_rate", [inf, pi / 4])
def test_positions_never_show_more_than_the_tyres_give(steer_rate):
    rng, row, angle, places = np.random.default_rng(0), np.array([0, 0, 0, 0, 25.0, 0, 0]), 0.0, []
    for _ in range(300):
        row, angle = step(row, *rng.choice([-1.0, 0.0, 1.0], 2), substeps=5, steer_rate=steer_rate, angle=angle)
        row[[VX, VY]] *= 25.0 / max(hypot(row[VX], row[VY]), 1.0)
        places.append(row[:2].copy())
    across = np.diff(places, axis=0)
    turned = np.angle(np.exp(1j * np.diff(np.arctan2(across[:, 1], across[:, 0]))))
    assert abs(turned * 25.0 / 0.1).max() < 1.2 * GRIP
