"""The Bullet backend: the behaviour suite, and contact."""

from __future__ import annotations

import sys
import time

import numpy as np
import pytest

from scenarionet_data.errors import MissingDependency
from scenarionet_sim.backends import bullet
from scenarionet_sim.backends.base import CONTROL_STEP
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.worlds.state import State
from tests.scenarionet_sim.backends.conformance import (
    BRAKE,
    COAST,
    EGO,
    SIZE,
    BackendConformance,
    make_stage,
    make_state,
    motion_of,
    put,
    roll,
)

pytestmark = pytest.mark.integration

pytest.importorskip("pybullet", reason="pybullet has a wheel for CPython 3.11 only")


class TestBullet(BackendConformance):
    backend = Bullet()

    def test_moving_car_pushes_from_behind(self, session):
        """Like a recorded car, it reaches its next pose regardless of obstacles."""
        state = make_state()
        for step in range(40):
            put(state, 1, (-8.0 + 0.8 * step, 0.3), (8.0, 0.0))
            session.drive(state, EGO, np.zeros((1, 2)), CONTROL_STEP)
        ego = motion_of(state, EGO)[0]
        assert ego[0] > 10.0 and ego[3] > 4.0

    def test_stationary_car_stops_a_vehicle_that_hits_it(self, session):
        free = roll(self.backend.open(make_stage()), make_state(speed=10.0), COAST, 20)[-1, 0]
        state = make_state(speed=10.0)
        put(state, 1, (9.0, 0.0))
        hit = roll(session, state, COAST, 20)[:, 0]
        assert free[0] == pytest.approx(20.0, rel=1e-3)
        assert hit[-1, 3] < 2.0
        assert hit[-1, 0] < 9.0

    def test_a_pedestrian_slows_a_car_less(self, session):
        state = make_state(speed=10.0)
        state.size[0, 1] = 0.6, 0.6, 1.75
        put(state, 1, (9.0, 0.0))
        assert roll(session, state, COAST, 12)[-1, 0, 3] > 6.0

    def test_off_centre_hit_causes_rotation(self, session):
        state = make_state(speed=10.0)
        put(state, 1, (9.0, 1.5))
        assert roll(session, state, COAST, 8)[:, 0, 5].max() > 0.1

    def test_two_agents_exchange_momentum(self, session):
        state = make_state(speed=10.0)
        put(state, 1, (6.0, 0.0))
        agents = np.array([[0, 0], [0, 1]], np.int32)
        passed = roll(session, state, COAST, 5, agents)
        assert passed[-1, :, 3].sum() == pytest.approx(10.0, rel=1e-6)
        assert passed[-1, 1, 3] > passed[-1, 0, 3] > 4.0
        gap = passed[:, 1, 0] - passed[:, 0, 0]
        assert gap.min() > SIZE[0] - 0.2, "they have gone into each other"

    def test_absent_objects_do_not_collide(self, session):
        state = make_state(speed=10.0)
        put(state, 1, (9.0, 0.0))
        state.present[0, 1] = False
        assert roll(session, state, COAST, 20)[-1, 0, 0] == pytest.approx(20.0, rel=1e-3)

    def test_vehicle_slides_beyond_the_friction_limit(self):
        on_ice = Bullet(tyre_friction=0.1).open(make_stage())
        passed = roll(on_ice, make_state(speed=15.0), (0.0, -1.0), 10)[:, 0]
        assert passed[-1, 3] == pytest.approx(15.0 - 0.1 * 9.81, rel=1e-3)
        turned = roll(on_ice, make_state(speed=15.0), (1.0, 0.0), 10)[:, 0]
        assert np.hypot(*turned[-1, 3:5] - turned[0, 3:5]) <= 0.1 * 9.81 + 1e-6

    def test_sleeping_bodies_do_not_change_the_result(self):
        """The number of sleeping bodies does not affect the other vehicles."""
        ends = []
        for max_asleep in (0, 32):
            session, state = Bullet(max_asleep=max_asleep).open(make_stage()), make_state(speed=10.0)
            for row in (1, 2, 3):
                put(state, row, (12.0 * row, 2.2))
            there = roll(session, state, (0.02, 0.1), 40)
            state.position[0, 0], state.velocity[0, 0], state.heading[0, 0] = (0.0, 0.0), (10.0, 0.0), 0.0
            ends.append(np.concatenate([there, roll(session, state, (0.02, 0.1), 40)]))
        np.testing.assert_allclose(*ends, atol=1e-6)

    def test_agent_may_become_traffic(self, session):
        state = make_state(speed=10.0)
        put(state, 1, (9.0, 0.0))
        both = np.array([[0, 0], [0, 1]], np.int32)
        roll(session, state, BRAKE, 2, both)
        position = state.position[0, 1].copy()
        hit = roll(session, state, COAST, 20)[:, 0]
        np.testing.assert_array_equal(state.position[0, 1], position)
        assert hit[-1, 0] < position[0]


def crowd(num: int) -> tuple[State, np.ndarray]:
    state = State.empty(1, num)
    state.size[:], state.object_type[:], state.present[:] = SIZE, 1, True
    state.position[0] = [(7.0 * (k % 10), 3.0 * (k // 10)) for k in range(num)]
    state.velocity[..., 0] = 5.0
    return state, np.array([[0, row] for row in range(num)], np.int32)


def test_fifty_dynamic_bodies(record_property, capsys):
    """Fifty cars in a block under random actions: they collide, stay finite and are reproducible bit for bit."""
    ends, actions = [], np.random.default_rng(5).uniform(-1, 1, (60, 50, 2))
    for _ in range(2):
        session, (state, agents) = Bullet().open(make_stage()), crowd(50)
        began = time.process_time()
        for action in actions:
            session.drive(state, agents, action, CONTROL_STEP)
        rate = 50 * len(actions) / (time.process_time() - began)
        ends.append(motion_of(state, agents))
        session.close()
    record_property("agent_steps_per_second", rate)
    with capsys.disabled():
        sys.stdout.write(f"\nBullet, 50 dynamic bodies in contact: {rate:,.0f} agent-steps/s\n")
    np.testing.assert_array_equal(*ends)
    assert np.isfinite(ends[0]).all()
    assert abs(ends[0][:, 3:5]).max() < 60.0, "contact makes energy"


def test_missing_pybullet_names_the_remedy(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(MissingDependency, match=r"scenarionet-lake\[sim\].*Kinematic"):
        Bullet().open(make_stage())


def test_missing_pybullet_without_a_wheel_advises_no_installation(monkeypatch):
    monkeypatch.setitem(sys.modules, "pybullet", None)
    monkeypatch.setattr(bullet, "_NO_WHEEL", (3, 0))
    with pytest.raises(MissingDependency, match=r"no wheel for Python 3.*use the backend Kinematic") as raised:
        Bullet().open(make_stage())
    assert "pip install" not in str(raised.value)


def test_importing_pybullet_is_silent(capfd):
    Bullet().open(make_stage()).close()
    assert capfd.readouterr() == ("", "")
