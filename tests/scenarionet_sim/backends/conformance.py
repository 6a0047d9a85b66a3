"""The behaviour suite that every backend inherits.

    class TestKinematic(BackendConformance):
        backend = Kinematic()

All vehicles drive on an empty plane: a backend's treatment of a vehicle must not depend on the recording.
"""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from scenarionet_sim.backends.base import CONTROL_STEP, Backend, Drive
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch
from tests.fixtures.scenarios import make_scenario

SIZE = 4.5, 1.8, 1.5
NUM_OBJECTS = 4
COAST, FULL, BRAKE = (0.0, 0.0), (0.0, 1.0), (0.0, -1.0)
EGO = np.array([[0, 0]], np.int32)


def make_stage(num_worlds: int = 1) -> WorldBatch:
    scenario = make_scenario(0, num_objects=NUM_OBJECTS, num_steps=11, has_map=False, num_lights=0)
    return WorldBatch([World.from_scenario(scenario)] * num_worlds)


def make_state(num_worlds: int = 1, speed: float = 0.0, heading: float = 0.0) -> State:
    """One car, object 0, at the origin of every world; the other objects are not present."""
    state = State.empty(num_worlds, NUM_OBJECTS)
    state.size[:] = SIZE
    state.object_type[:] = 1
    state.present[:, 0] = True
    state.heading[:, 0] = heading
    state.velocity[:, 0] = speed * math.cos(heading), speed * math.sin(heading)
    return state


def put(state: State, row: int, position: tuple[float, float], velocity: tuple[float, float] = (0.0, 0.0)) -> None:
    state.present[0, row] = True
    state.position[0, row] = position
    state.velocity[0, row] = velocity


def motion_of(state: State, agents: np.ndarray) -> np.ndarray:
    """(A, 6) x, y, heading, vx, vy, yaw rate."""
    world, row = agents.T
    parts = (
        state.position[world, row],
        state.heading[world, row],
        state.velocity[world, row],
        state.yaw_rate[world, row],
    )
    return np.column_stack(parts)


def roll(session, state: State, action, steps: int, agents: np.ndarray = EGO) -> np.ndarray:
    """(steps + 1, A, 6) motion of the agents under one constant action, or one action per step (steps, 2)."""
    actions = np.broadcast_to(np.asarray(action, np.float64), (steps, 2))
    passed = [motion_of(state, agents)]
    for step in range(steps):
        session.drive(state, agents, np.repeat(actions[step : step + 1], len(agents), axis=0), CONTROL_STEP)
        passed.append(motion_of(state, agents))
    return np.array(passed)


def wild(steps: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (steps, 2))


class BackendConformance:
    """Inherit, set ``backend``."""

    backend: Backend

    @pytest.fixture
    def session(self):
        session = self.backend.open(make_stage())
        yield session
        session.close()

    @property
    def car(self) -> Drive:
        return self.backend.drive

    # --- driving --------------------------------------------------------------------------------------

    def test_accelerates(self, session):
        passed = roll(session, make_state(), FULL, 20)[:, 0]
        assert passed[-1, 3] == pytest.approx(2.0 * self.car.acceleration, rel=0.02)
        assert passed[-1, 0] == pytest.approx(0.5 * self.car.acceleration * 2.0**2, rel=0.05)
        assert (np.diff(passed[:, 3]) > 0).all()

    def test_half_throttle_is_half_as_much(self, session):
        passed = roll(session, make_state(), (0.0, 0.5), 20)[:, 0]
        assert passed[-1, 3] == pytest.approx(self.car.acceleration, rel=0.02)

    def test_brakes_to_a_stop_and_stays(self, session):
        speed = 15.0
        passed = roll(session, make_state(speed=speed), BRAKE, 60)[:, 0]
        assert passed[-1, 0] == pytest.approx(speed**2 / (2 * self.car.braking), rel=0.05)
        assert (np.diff(passed[:, 0]) > -1e-9).all(), "the brake drives backwards"
        assert abs(passed[-30:, 3:]).max() < 1e-9

    def test_brakes_to_a_stop_in_a_turn(self, session):
        passed = roll(session, make_state(speed=8.0), (1.0, -1.0), 60)[:, 0]
        assert abs(passed[-20:, 3:]).max() < 1e-3

    @pytest.mark.parametrize("heading", [0.0, 0.7, -3.0])
    def test_does_not_drift_on_a_straight_road(self, session, heading):
        passed = roll(session, make_state(speed=20.0, heading=heading), COAST, 100)[:, 0]
        across = passed[:, :2] @ [-math.sin(heading), math.cos(heading)]
        assert abs(across).max() < 1e-6
        assert abs(passed[:, 2] - heading).max() < 1e-9
        assert np.hypot(*passed[-1, 3:5]) == pytest.approx(20.0, rel=0.01), "coasting costs speed"

    def test_positive_steering_turns_left_at_the_right_radius(self, session):
        steer, speed = 0.3, 4.0
        passed = roll(session, make_state(speed=speed), (steer, 0.0), 60)[10:, 0]
        wheelbase = self.car.wheelbase * SIZE[0]
        rear = wheelbase / math.tan(steer * self.car.max_steer)
        assert (passed[:, 5] > 0).all()
        assert _radius(passed[:, :2]) == pytest.approx(math.hypot(rear, 0.5 * wheelbase), rel=0.02)

    def test_left_and_right_are_mirrored(self):
        actions = wild(40)
        left, right = (
            roll(self.backend.open(make_stage()), make_state(speed=8.0), actions * [sign, 1.0], 40)[:, 0]
            for sign in (1.0, -1.0)
        )
        np.testing.assert_allclose(left, right * [1, -1, -1, 1, -1, -1], atol=1e-9)

    def test_has_a_top_speed(self, session):
        passed = roll(session, make_state(speed=self.car.max_speed - 2.0), FULL, 30)[:, 0]
        assert passed[:, 3].max() <= self.car.max_speed + 1e-9
        assert passed[-1, 3] == pytest.approx(self.car.max_speed, rel=0.01)

    def test_velocity_is_motion(self, session):
        passed = roll(session, make_state(speed=6.0), (0.2, 0.1), 30)[:, 0]
        mean = 0.5 * (passed[1:, 3:5] + passed[:-1, 3:5])
        np.testing.assert_allclose(np.diff(passed[:, :2], axis=0) / CONTROL_STEP, mean, atol=0.25)

    def test_headings_stay_wrapped(self, session):
        heading = roll(session, make_state(speed=5.0), (1.0, 0.1), 150)[:, 0, 2]
        assert (heading >= -np.pi).all() and (heading < np.pi).all()
        assert (np.diff(heading) < 0).any(), "it has not gone round"

    # --- what comes in, what changes ------------------------------------------------------------------

    @pytest.mark.parametrize("speed", [0.0, 1e-12, 5.0, 70.0])
    def test_stays_finite_under_any_actions(self, session, speed):
        state = make_state(speed=speed)
        state.velocity[0, 0, 1] = 12.0  # slides sideways
        state.yaw_rate[0, 0] = 5.0
        actions = np.sign(wild(100, seed=3))
        assert np.isfinite(roll(session, state, actions, 100)).all()

    def test_moves_nothing_but_the_agents(self, session):
        state = make_state(speed=3.0)
        put(state, 1, (6.0, 0.5), (1.0, 0.0))
        put(state, 2, (0.0, 40.0))
        before = {name: np.copy(getattr(state, name)) for name in ("position", "heading", "velocity", "yaw_rate")}
        roll(session, state, FULL, 10)
        for name, array in before.items():
            np.testing.assert_array_equal(array[0, 1:], getattr(state, name)[0, 1:])

    def test_a_step_without_agents(self, session):
        state = make_state(speed=3.0)
        session.drive(state, np.zeros((0, 2), np.int32), np.zeros((0, 2)), CONTROL_STEP)
        np.testing.assert_array_equal(motion_of(state, EGO), motion_of(make_state(speed=3.0), EGO))

    # --- the same again -------------------------------------------------------------------------------

    def test_is_deterministic_and_sessions_are_independent(self):
        actions, alone = wild(40, seed=1), self._episode(wild(40, seed=1))
        sessions = [self.backend.open(make_stage()) for _ in range(5)]
        states = [make_state(speed=8.0) for _ in sessions]
        for action in actions:
            for session, state in zip(sessions, states, strict=True):
                session.drive(state, EGO, action[None], CONTROL_STEP)
        for state in states:
            np.testing.assert_array_equal(motion_of(state, EGO), alone[-1])
        for session in sessions:
            session.close()
            session.close()

    def test_reset_is_complete(self, session):
        actions, passed = wild(30, seed=2), []
        for _ in range(2):
            state = make_state(speed=8.0)
            put(state, 1, (9.0, 0.0), (2.0, 0.0))
            session.reset(0, state)
            passed.append(roll(session, state, actions, 30))
        np.testing.assert_array_equal(*passed)

    def test_every_slot_gives_the_same_result(self):
        num_worlds = 5
        session, state = self.backend.open(make_stage(num_worlds)), make_state(num_worlds, speed=8.0)
        state.present[:, 1] = True
        state.position[:, 1] = 9.0, 0.4
        agents = np.array([[world, 0] for world in range(num_worlds)], np.int32)
        passed = roll(session, state, wild(40, seed=4), 40, agents)
        assert abs(passed - passed[:, :1]).max() <= 1e-6

    def test_pickles(self):
        again = pickle.loads(pickle.dumps(self.backend))
        assert again == self.backend and hash(again) == hash(self.backend)
        assert isinstance(again, Backend)
        actions = wild(10)
        ends = [roll(backend.open(make_stage()), make_state(), actions, 10)[-1] for backend in (again, self.backend)]
        np.testing.assert_array_equal(*ends)

    def _episode(self, actions: np.ndarray) -> np.ndarray:
        session = self.backend.open(make_stage())
        passed = roll(session, make_state(speed=8.0), actions, len(actions))
        session.close()
        return passed


def _radius(points: np.ndarray) -> float:
    """Radius of the circle through points, by least squares."""
    system = np.column_stack((2.0 * points, np.ones(len(points))))
    x, y, rest = np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=None)[0]
    return math.sqrt(rest + x**2 + y**2)
