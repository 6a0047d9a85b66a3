"""A planner as a policy: it drives objects of a simulation, through a tracker or a vehicle model."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from weakref import WeakKeyDictionary

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, IntP, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_sim.arrays.log import HEADING, VALID, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.backends.base import Backend, Session, checked_actions
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.planners.base import Planner, Trajectory
from scenarionet_sim.planners.supervision import supervised
from scenarionet_sim.planners.tracking import Lqr, TrackedVehicle, Tracker
from scenarionet_sim.planners.view import View
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.objects import ObjectMask, ego
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True, kw_only=True)
class Planned(Policy):
    """Objects driven by planners, one planner for each.

    An object appears as recorded at its first valid timestep, and then goes where its planner drives it: along a
    trajectory by the tracker, by an action through the backend.

    Attributes:
        planner: Makes a planner at the beginning of each episode: a class, or a function without arguments.
        objects: Selects the objects; by default the ego.
        tracker: Follows trajectories: nuPlan's ``Lqr()``, or ``PerfectTracking()``.
        backend: Vehicle dynamics for actions.
        step_limit, episode_limit: Longest time that a planner may take for an answer and for an episode [s].

    Example:
        evaluate("lake", policy="my_planner:MyPlanner")  # by name, or as a policy of an environment
        EnvConfig(scenarios, policies=(Replay(), Planned(planner=MyPlanner, objects=other_vehicles), External()))
    """

    planner: Callable[[], Planner]
    objects: ObjectMask = ego
    tracker: Tracker = field(default_factory=Lqr)
    backend: Backend = field(default_factory=Kinematic)
    step_limit: float = 60.0
    episode_limit: float = 1800.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not callable(self.planner):
            raise BadParameter(f"planner={self.planner!r}; expected a class of planners, such as IdmPlanner")
        for name, kind, example in (("tracker", Tracker, "Lqr()"), ("backend", Backend, "Kinematic()")):
            value = getattr(self, name)
            if isinstance(value, type) or not isinstance(value, kind):
                raise BadParameter(f"{name}={value!r}; expected, for example, {name}={example}")

    @property
    def history(self) -> int:
        """Moments that the simulation keeps: the current one and those that the planner asks for."""
        moments = self.made().history
        return moments + 1 if moments else 0

    def made(self) -> Planner:
        """Return another planner; its construction may end the process as little as its answers."""
        with supervised(f"{getattr(self.planner, '__name__', 'planner')}()", self.step_limit):
            return self.planner()

    def begin(self, batch: WorldBatch, state: State, slot: int) -> None:
        """Forget the planners of a slot, where an episode begins."""
        self._drives(batch).begin(state, slot)

    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, policy_id: int, dt: float) -> None:
        """Ask the planners, and move their objects."""
        self._drives(batch).advance(batch.worlds, now, then, np.argwhere(driver == policy_id).astype(np.intp), dt)

    def _drives(self, batch: WorldBatch) -> _Drives:
        of_batch = _DRIVES.setdefault(batch, {})
        if self not in of_batch:
            of_batch[self] = _Drives(self, batch)
        return of_batch[self]


@dataclass(eq=False)
class _Seat:
    """What is kept of a driven object from step to step.

    Attributes:
        planner: Its planner.
        speed: A step before [m/s]; None in the first.
        arc: Last known distance along the route [m].
        acceleration, steering: Of the tracked vehicle, see ``TrackedVehicle``.
        left: Time that the planner may still take in this episode [s].
    """

    planner: Planner
    left: float
    speed: float | None = None
    arc: float = math.nan
    acceleration: float = 0.0
    steering: float | None = None


class _Drives:
    """The planners of a policy in the worlds of a batch."""

    def __init__(self, policy: Planned, batch: WorldBatch) -> None:
        self._policy = policy
        self._session: Session = policy.backend.open(batch)
        self._seats: dict[tuple[int, int], _Seat] = {}

    def begin(self, state: State, slot: int) -> None:
        self._seats = {place: seat for place, seat in self._seats.items() if place[0] != slot}
        self._session.reset(slot, state)

    def advance(self, worlds: Sequence[World], now: State, then: State, places: IntP, dt: float) -> None:
        acting, actions, asked = [], [], []
        for slot, row in places.tolist():
            if not now.present[slot, row]:
                log, later = worlds[slot].log, int(now.timestep[slot]) + 1
                if later < len(log) and log[later, row, VALID] != 0.0:
                    then.motion[slot, row], then.present[slot, row] = log[later, row, :VALID], True
                continue
            seat = self._seats.get((slot, row))
            if seat is None:
                seat = self._seats[slot, row] = _Seat(self._policy.made(), self._policy.episode_limit)
            view = View(worlds[slot], now, slot, row, seat.planner.frame, seat.speed, seat.arc, skip=1)
            with supervised(f"{type(seat.planner).__name__}.expect", self._policy.step_limit):
                seat.planner.expect(view)
            asked.append((slot, row, seat, view))
        for slot, row, seat, view in asked:
            started = time.perf_counter()
            with supervised(f"{type(seat.planner).__name__}.act", min(self._policy.step_limit, seat.left)):
                answer = seat.planner.act(view)
            seat.left = max(seat.left + started - time.perf_counter(), 1e-3)
            if isinstance(answer, Trajectory):
                self._track(view, answer, seat, then.motion[slot, row], dt)
            else:
                if np.shape(answer) != (2,):
                    raise BadParameter(
                        f"{type(seat.planner).__name__}.act returned {answer!r}; expected a Trajectory, or steering "
                        "and throttle"
                    )
                acting.append((slot, row))
                actions.append(answer)
            seat.speed, seat.arc = view.ego.speed, view.known_arc
        if acting:
            self._session.drive(then, np.array(acting, np.int32), checked_actions(np.array(actions, np.float64)), dt)

    def _track(self, view: View, answer: Trajectory, seat: _Seat, motion: Float64, dt: float) -> None:
        """Move an object along a trajectory; ``motion`` is its row (7,) of the next state."""
        tracker, ego = self._policy.tracker, view.ego
        x, y, _, heading, vx, vy, yaw_rate = motion.tolist()
        speed = math.cos(heading) * vx + math.sin(heading) * vy
        if seat.steering is None:  # as it was recorded
            slope = tracker.wheelbase(ego.length) * yaw_rate / speed if abs(speed) > 0.5 else 0.0
            seat.steering = math.atan(slope)
        vehicle = TrackedVehicle(x, y, heading, speed, yaw_rate, ego.length, (vx, vy), seat.acceleration, seat.steering)
        if answer.times[-1] < dt - 1e-9:
            raise BadParameter(
                f"{type(seat.planner).__name__}.act returned a trajectory that ends after {answer.times[-1]:g} s; "
                f"expected one of at least a timestep, {dt:g} s"
            )
        scenario = Trajectory(view.frame.poses_to_scenario(answer.poses), answer.times)
        tracker.follow(vehicle, scenario, dt)
        motion[X], motion[Y], motion[HEADING] = vehicle.x, vehicle.y, vehicle.heading
        motion[VX], motion[VY] = vehicle.velocity
        motion[YAW_RATE] = vehicle.yaw_rate
        seat.acceleration, seat.steering = vehicle.acceleration, vehicle.steering


_DRIVES: WeakKeyDictionary[WorldBatch, dict[Planned, _Drives]] = WeakKeyDictionary()
"""Live planners by batch: a policy itself is a specification, which is compared, hashed and pickled."""
