"""Tyres: hand-computed cases with grip, and the friction limit without."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_sim.backends.tyre_kernels import apply_tyres

STEP, SIZE = 0.02, np.array([[4.5, 1.8, 1.5]])
VEHICLE = (math.radians(40.0), 4.0, 8.0, 9.0, 40.0, 0.6)
numbers = st.floats(-30.0, 30.0)


def after(motion, action=(0.0, 0.0), vehicle=VEHICLE) -> np.ndarray:
    moved = np.array([motion], np.float64)
    apply_tyres(moved, SIZE, np.array([action], np.float64), vehicle, STEP)
    return moved[0]


def test_throttle_and_brake_along_the_heading():
    assert after((0, 0, math.pi / 2, 0, 10, 0), (0.0, 0.5))[3:] == pytest.approx([0, 10 + 0.5 * 4.0 * STEP, 0])
    assert after((0, 0, 0, 10, 0, 0), (0.0, -0.5))[3:] == pytest.approx([10 - 0.5 * 8.0 * STEP, 0, 0])
    assert after((0, 0, 0, 0.01, 0, 0), (0.0, -1.0))[3:] == pytest.approx([0, 0, 0])
    assert after((0, 0, 0, 45.0, 0, 0), (0.0, 1.0))[3] == 45.0, "faster than the engine drives: it adds nothing"


def test_vehicle_with_grip_follows_its_wheels():
    """Momentum balance of the two impulses, and no velocity across either axle: four equations, solved by NumPy."""
    steer, arm, gyration = math.radians(40.0) * 0.1, 0.5 * 0.6 * 4.5, (4.5**2 + 1.8**2) / 12.0
    cos, sin = math.cos(steer), math.sin(steer)
    # unknown: forward, left and yaw rate afterwards, and the impulses of the front and the rear tyres
    system = [
        [1, 0, 0, sin, 0],
        [0, 1, 0, -cos, -1],
        [0, 0, 1, -arm * cos / gyration, arm / gyration],
        [-sin, cos, cos * arm, 0, 0],
        [0, 1, -arm, 0, 0],
    ]
    forward, left, turn, *_ = np.linalg.solve(system, [1.0, 0.01, 0.05, 0, 0])
    assert after((3, 4, 0, 1.0, 0.01, 0.05), (0.1, 0.0)) == pytest.approx([3, 4, 0, forward, left, turn])


@given(numbers, numbers, st.floats(-4, 4), st.floats(-1, 1), st.floats(-1, 1))
def test_impulses_respect_the_friction_limit(forward, left, turn, steer, throttle):
    before = np.array([0, 0, 0.4, forward, left, turn])
    moved = after(before, (steer, throttle))
    assert np.isfinite(moved).all()
    assert np.hypot(*(moved - before)[3:5]) <= 9.0 * STEP * (1 + 1e-9)


@given(numbers, numbers, st.floats(-4, 4), st.floats(-1, 1))
def test_tyres_do_not_add_energy(forward, left, turn, steer):
    gyration = (4.5**2 + 1.8**2) / 12.0
    weights = np.array([0, 0, 0, 1, 1, gyration])
    before = np.array([0, 0, 0.4, forward, left, turn])
    assert weights @ after(before, (steer, 0.0)) ** 2 <= weights @ before**2 * (1 + 1e-9)


def reference(forward, left, turn, steer, throttle):
    """Two impulses at the axles of a rigid body: unclipped ones by NumPy, the larger one clipped first."""
    arm, gyration, grip = 0.5 * 0.6 * 4.5, (4.5**2 + 1.8**2) / 12.0, 9.0 * STEP
    angle, wheel = steer * VEHICLE[0], np.array([np.cos(steer * VEHICLE[0]), np.sin(steer * VEHICLE[0])])
    wanted = throttle * 4.0 * STEP if throttle >= 0 else -np.sign(forward) * min(-throttle * 8.0 * STEP, abs(forward))
    engine = np.clip(min(wanted, max(0.0, 40.0 - forward)), -grip, grip)
    most = 0.5 * np.sqrt(grip**2 - engine**2)

    def push(state, place, impulse):
        return state + np.array([impulse[0], impulse[1], place * impulse[1] / gyration])

    def slip(state, place, along):
        return np.array([-along[1], along[0]]) @ [state[0], state[1] + place * state[2]]

    ahead, across = np.array([1.0, 0.0]), np.array([-np.sin(angle), np.cos(angle)])
    state = push(push(np.array([forward, left, turn]), arm, 0.5 * engine * wheel), -arm, 0.5 * engine * ahead)
    slips = np.array([slip(state, arm, wheel), slip(state, -arm, ahead)])
    units = [push(np.zeros(3), arm, across), push(np.zeros(3), -arm, np.array([0.0, 1.0]))]
    effect = np.array([[slip(unit, arm, wheel), slip(unit, -arm, ahead)] for unit in units]).T
    impulses = np.linalg.solve(effect, -slips)
    first = int(abs(impulses[1]) >= abs(impulses[0]))
    if abs(impulses[first]) > most:
        other = 1 - first
        impulses[first] = np.clip(impulses[first], -most, most)
        impulses[other] = -(slips[other] + effect[other, first] * impulses[first]) / effect[other, other]
    impulses = np.clip(impulses, -most, most)
    return state + impulses[0] * units[0] + impulses[1] * units[1]


def test_impulses_are_those_of_a_rigid_body():
    rng = np.random.default_rng(0)
    for scale in (0.02, 3.0):  # with grip, and without
        for _ in range(100):
            forward, left, turn = rng.normal(size=3) * [10.0, scale, scale]
            steer, throttle = rng.uniform(-1, 1, 2)
            moved = after((0, 0, 0, forward, left, turn), (steer, throttle))[3:]
            assert moved == pytest.approx(reference(forward, left, turn, steer, throttle), abs=1e-9)
