"""Vehicles by class and size, and what the friction circle, drag, steering rate and reverse gear do."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.backends.fleet import BICYCLE, CAR, LORRY, Fleet
from scenarionet_sim.backends.kinematic import Kinematic
from tests.scenarionet_sim.backends.conformance import BRAKE, COAST, FULL, SIZE, make_stage, make_state, roll


def drive(backend: Kinematic, action, steps: int, speed: float = 0.0, size=SIZE) -> np.ndarray:
    """(steps + 1, 6) motion of one vehicle."""
    session, state = backend.open(make_stage()), make_state(speed=speed)
    state.size[:] = size
    session.reset(0, state)
    return roll(session, state, action, steps)[:, 0]


def test_full_lock_costs_speed():
    speed = np.hypot(*drive(Kinematic(), (1.0, 0.0), 60, 10.0)[:, 3:5].T)
    assert (np.diff(speed) < 1e-9).all() and 4.5 < speed[-1] < 6.0
    gentle = np.hypot(*drive(Kinematic(), (0.1, 0.0), 60, 5.0)[:, 3:5].T)
    np.testing.assert_allclose(gentle, 5.0, atol=1e-9)  # rolling wheels cost nothing


@pytest.mark.parametrize("action", [(1.0, -1.0), (0.3, -1.0), (0.2, 1.0), (0.5, 1.0)])
def test_tyres_give_no_more_than_the_friction_circle(action):
    passed = drive(Kinematic(grip=6.0), action, 15, 15.0)[1:]  # the first step turns the velocity to the slip angle
    speed, turn = np.hypot(*passed[:, 3:5].T), passed[:, 5]
    along, across = np.diff(speed) / 0.1, (speed * np.abs(turn))[1:]
    assert np.hypot(along, across).max() < 6.0 * 1.1
    assert np.hypot(along, across).max() > 5.0


def test_drag_and_engine_brake():
    drag, rolling, speed = 3e-4, 0.4, 30.0
    passed = drive(Kinematic(Drive(drag=drag, rolling=rolling)), COAST, 100, speed)[:, 3]
    time = 10.0
    k, v = math.sqrt(drag / rolling), math.sqrt(rolling / drag)  # dv/dt = -rolling - drag v²
    assert passed[-1] == pytest.approx(v * math.tan(math.atan(speed * k) - math.sqrt(drag * rolling) * time), rel=1e-3)
    stopping = drive(Kinematic(Drive(rolling=rolling)), COAST, 40, 1.0)[:, 3]
    assert (stopping >= 0.0).all() and stopping[-1] == 0.0


def test_steering_rate():
    rate, limit = 0.5, math.radians(40.0)
    passed = drive(Kinematic(Drive(steering_rate=rate)), (1.0, 0.0), 20, 1.0)
    wheelbase = 0.6 * SIZE[0]
    angle = np.minimum(rate * 0.1 * np.arange(21), limit)
    turn = np.hypot(*passed[:, 3:5].T) * np.tan(angle) * np.cos(np.arctan(np.tan(angle) / 2.0)) / wheelbase
    np.testing.assert_allclose(passed[1:, 5], turn[1:], atol=1e-6)


def test_reverse_gear():
    backend = Kinematic(Drive(reverse=3.0))
    passed = drive(backend, BRAKE, 40, 4.0)[:, 3]
    assert passed[-1] == pytest.approx(-3.0) and (np.diff(passed) <= 1e-9).all()
    actions = np.vstack([np.tile(BRAKE, (20, 1)), np.tile(FULL, (20, 1))])
    assert drive(backend, actions, 40)[-1, 3] > 4.0
    assert drive(Kinematic(), BRAKE, 20)[-1, 3] == 0.0


def test_classes_by_type_and_size():
    types = np.array([1, 1, 1, 1, ObjectType.CYCLIST, ObjectType.PEDESTRIAN], np.uint8)
    assert types[0] == ObjectType.VEHICLE
    size = np.array(
        [(4.5, 1.8, 1.5), (12.0, 2.5, 3.5), (7.25, 2.3, 3.0), (2.2, 0.8, 1.5), (1.8, 0.6, 1.7), (0.6, 0.6, 1.7)]
    )
    found = Fleet().numbers(types, size)
    acceleration = found[:, 1].tolist()
    assert acceleration[0] == CAR.acceleration and acceleration[1] == LORRY.acceleration
    assert acceleration[2] == pytest.approx(0.5 * (CAR.acceleration + LORRY.acceleration))
    assert acceleration[3] > CAR.acceleration and acceleration[4] == BICYCLE.acceleration
    assert found[5, 3] == 3.0
    assert drive(Kinematic(Fleet()), FULL, 20, size=(12.0, 2.5, 3.5))[-1, 3] == pytest.approx(2.0 * 0.83, rel=0.05)


def test_spread_is_fixed_by_scenario_and_seed():
    types, size = np.ones(50, np.uint8), np.tile(SIZE, (50, 1))
    fleet = Fleet(spread=0.2)
    numbers, plain = fleet.numbers(types, size), Fleet().numbers(types, size)
    ratio = numbers[:, 1] / plain[:, 1]
    assert 0.8 <= ratio.min() < 0.9 and 1.1 < ratio.max() <= 1.2
    np.testing.assert_array_equal(numbers, fleet.numbers(types, size))
    assert (numbers != fleet.numbers(types, size + 0.01)).any()
    assert (numbers != replace(fleet, seed=1).numbers(types, size)).any()
    np.testing.assert_array_equal(numbers[:, 3], plain[:, 3])
