"""The simulation loop: W worlds advanced in lockstep."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.compiled import Kernel
from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, UInt8, UInt32
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS
from scenarionet_sim.backends.base import Backend, checked_actions
from scenarionet_sim.backends.kinematic import Kinematic, KinematicSession
from scenarionet_sim.kernels.bicycle import NUM_COLUMNS
from scenarionet_sim.kernels.episodes import UNDRIVEN, begin_worlds, list_agents
from scenarionet_sim.kernels.idm import SightMemory
from scenarionet_sim.kernels.observation import Scratch, Sensing
from scenarionet_sim.kernels.scoring import NUM_TOTALS, NUMBERS, StepResult
from scenarionet_sim.kernels.step import (
    DRIVE,
    FOLLOW_PATH,
    LOCATE,
    MOVE,
    OBSERVE,
    ONLY_BEGUN,
    UNCOMPILED,
    DrivenArrays,
    Traffic,
    drive_by_idm,
    step_worlds,
)
from scenarionet_sim.policies import External, Policy, Replay
from scenarionet_sim.policies.base import is_compiled
from scenarionet_sim.sensors.base import require_located
from scenarionet_sim.threads import Threads
from scenarionet_sim.worlds.state import History, State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch

LOOK_BACK, LOOK_AHEAD = 10.0, 20.0
"""Search window on an agent's path around its last location [m]."""


@dataclass(eq=False)
class Observer:
    """Scores and observes the agents as a part of each step.

    Attributes:
        task: (12,) see ``task.task_parameters``.
        result: Scores of the agents.
        sensing: Sensors of the agents.
        phases: ``SCORE``, ``OBSERVE``, both or neither.
    """

    task: Float64
    result: StepResult
    sensing: Sensing
    phases: int
    is_stale: bool = False
    """Whether the agents have changed since they were observed."""

    @classmethod
    def nothing(cls) -> Observer:
        """Return an observer that does nothing."""
        numbers, totals = np.zeros((0, len(NUMBERS))), np.zeros((0, 0, NUM_TOTALS))
        result = StepResult(numbers, np.zeros(0, np.uint8), totals)
        return cls(np.zeros(12), result, Sensing.of_no_sensors(), 0)

    def resize(self, simulation: Simulation) -> None:
        """Allocate the results for the agents of a simulation, which have changed."""


class Simulation:
    """Worlds advanced in lockstep, each in a slot with its own episode.

    In a step every policy writes the next state of its objects, the backend moves the agents by their actions, then
    contacts and locations on paths are updated, and an observer scores and observes the agents. All of it is one
    compiled function over ranges of worlds, except policies and backends of your own and Bullet. Results are
    deterministic and independent of the number of threads.

    Args:
        worlds: One per slot; all with the same timestep length.
        policies: Policies in rising priority: an object is driven by the last one that selects it.
        backend: Vehicle dynamics of the agents; None for ``Kinematic()``.
        history: Number of past moments to keep in ``state.history``, for sensors that show them.
        has_passengers: The agents are the egos, which policies drive: they are scored and observed without actions.
        threads: Largest number of threads.
        keep: Number of worlds to keep in memory that no slot plays.
        observer: Scores and observes the agents.

    Attributes:
        batch: Maps, logs and paths of the worlds.
        state: The current state, and ``previous`` the one before; a step exchanges the two.
        driver: (W, N) uint8 policy of each object, or ``UNDRIVEN``.
        agents: (A, 2) int32 world and row of each present agent, sorted; the order of ``step``'s actions.
        actions: (A, 2) float64 actions of the last step, clipped to [-1, 1].
        route: (W, N, 2) float64 location of the agents on their paths, see ``State``.
        contacts: (A, N) bool objects that each agent's box overlaps.
        hits: (A,) uint32 types of those objects: bit k is set for type k.

    Example:
        simulation = Simulation([World.from_scenario(scenario)], (Replay(), Idm(), External()))
        simulation.step([[0.0, 1.0]])  # straight on, full throttle
        simulation.state.position[0, simulation.batch.ego[0]]
    """

    def __init__(
        self,
        worlds: Sequence[World],
        policies: Iterable[Policy] = (Replay(), External()),
        backend: Backend | None = None,
        history: int = 0,
        *,
        has_passengers: bool = False,
        threads: int = 1,
        keep: int = 32,
        observer: Observer | None = None,
    ) -> None:
        self._policies = tuple(policies)
        self.observer = observer or Observer.nothing()
        self._dt = worlds[0].dt
        self._has_passengers, self._threads = has_passengers, Threads(threads)
        self.batch = WorldBatch(worlds, self._policies, self._prepare, keep)
        shape = len(worlds), self.batch.max_objects
        self.state = State.empty(*shape)
        history = max([history, *(policy.history for policy in self._policies)])
        if history:
            self.state.history = History.empty(history, *shape)
        self.previous = self.state.twin()
        self.driver: UInt8 = np.full(shape, UNDRIVEN, np.uint8)
        self._own_route, self._own_route_before = np.full((2, *shape, 2), np.nan)
        self._session = (backend or Kinematic()).open(self.batch)
        movement = [policy.movement if is_compiled(policy) else UNCOMPILED for policy in self.policies]
        self._movement: UInt8 = np.array(movement, np.uint8)
        self._is_compiled = UNCOMPILED not in movement and isinstance(self._session, KinematicSession)
        self._law: Float64 = np.zeros((len(worlds), len(movement), 8))
        self._next_law = _laws(self._policies)
        self._playing = [self._policies] * len(worlds)
        self._is_agent: Bool = np.zeros(256, np.bool_)
        self._is_agent[[n for n, policy in enumerate(self.policies) if isinstance(policy, External)]] = True
        self._has_begun: Bool = np.zeros(len(worlds), np.bool_)
        self.agents: Int32 = np.zeros((0, 2), np.int32)
        self._first_agent: Int32 = np.zeros(len(worlds) + 1, np.int32)
        self._clear_agents()
        self.reset_slots(range(len(worlds)), worlds)

    def __repr__(self) -> str:
        drivers = ", ".join(type(policy).__name__ for policy in self.policies)
        return f"Simulation({len(self.batch)} worlds, {len(self.agents)} agents, policies: {drivers})"

    @property
    def policies(self) -> tuple[Policy, ...]:
        """Policies of the episodes that begin next; others of the same kinds can be set, with other parameters."""
        return self._policies

    @policies.setter
    def policies(self, policies: tuple[Policy, ...]) -> None:
        kinds, expected = list(map(type, policies)), list(map(type, self._policies))
        if kinds != expected:
            raise BadParameter(f"policies of the kinds {kinds} in a simulation of {expected}; make a new simulation")
        if policies != self._policies:  # worlds are prepared once for the same tuple
            self._policies, self._next_law = policies, _laws(policies)

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return self._dt

    @property
    def route(self) -> Float64:
        """(W, N, 2) location of the agents on their paths."""
        return self._own_route if self._has_passengers else self.state.route

    def reset(self, slot: int, world: World | None = None, start: int | None = None) -> None:
        """Begin an episode in a slot.

        Args:
            slot: The slot.
            world: Its next world; None for the same again.
            start: First timestep of the log; None for the first at which the ego is valid.

        Raises:
            BadParameter: The world has another timestep length.
        """
        self.reset_slots([slot], [world], start)

    def reset_slots(self, slots: Sequence[int], worlds: Sequence[World | None], start: int | None = None) -> None:
        """Begin episodes in several slots, and observe the agents there; as :meth:`reset`."""
        self.begin(slots, worlds, start)
        self._run(LOCATE | ONLY_BEGUN | self.observer.phases)
        self._has_begun[:] = False

    def begin(self, slots: Sequence[int], worlds: Sequence[World | None], start: int | None = None) -> None:
        """Begin episodes in several slots whose worlds do not move in the next step; as :meth:`reset`."""
        for slot, world in zip(slots, worlds, strict=True):
            self.batch.replace(slot, world, self._policies)
            self._playing[slot] = self._policies
        self._law[list(slots)] = self._next_law
        self._grow()
        starts = np.full(len(slots), -1 if start is None else start, np.int32)
        numbers = np.asarray(slots, np.int32)
        arrays = self.batch.recorded, self.state.moment, self.previous.moment, self.driver
        _unchecked(begin_worlds)(numbers, starts, *arrays)
        if self.state.history is not None:
            self.state.history.present[:, numbers] = False
        self._own_route[numbers] = np.nan
        for slot in slots:
            self._session.reset(slot, self.state)
            for policy in self._playing[slot]:
                if not is_compiled(policy):
                    policy.begin(self.batch, self.state, slot)
        self._has_begun[numbers] = True
        self._list_agents()

    def step(self, actions: npt.ArrayLike | None = None) -> None:
        """Advance every world by one timestep.

        Args:
            actions: (A, 2) steering and throttle in [-1, 1] for each of ``agents``, clipped; None for zeros.

        Raises:
            BadParameter: The number of actions differs from that of agents, or one is NaN.
        """
        self.actions = checked_actions(np.zeros((len(self.agents), 2)) if actions is None else actions)
        if len(self.actions) != len(self.agents):
            raise BadParameter(f"{len(self.actions)} actions for {len(self.agents)} agents; pass one per agent")
        if self.state.history is not None:
            self.state.history.push(self.state)
        self.state, self.previous = self.previous, self.state
        drive = DRIVE if isinstance(self._session, KinematicSession) and not self._has_passengers else 0
        rest = LOCATE | self.observer.phases
        if self._is_compiled and not self._is_agent_due:
            self._run(MOVE | drive | rest)
        else:
            self._step_in_parts(drive, rest)
        self._has_begun[:] = False

    def retire(self, agents: npt.ArrayLike) -> None:
        """Remove agents from their worlds for the rest of the episode.

        Args:
            agents: (K, 2) world and row of each, out of ``agents``.
        """
        worlds, rows = np.asarray(agents, np.int32).reshape(-1, 2).T
        self.driver[worlds, rows] = UNDRIVEN
        self.state.present[worlds, rows] = self.previous.present[worlds, rows] = False
        self._list_agents()

    def rest(self, slot: int) -> None:
        """Stop driving the objects of a slot, until its next episode begins."""
        self.driver[slot] = UNDRIVEN
        self._list_agents()

    def observe(self) -> None:
        """Let the observer observe the agents again, if they have changed since the last step."""
        if self.observer.is_stale:
            self._run(OBSERVE)

    def close(self) -> None:
        """Release the resources of the backend, and stop the threads."""
        self._session.close()
        self._threads.close()

    def are_agents_due(self) -> Bool:
        """Return the worlds (W,) in which an agent is absent that may still appear."""
        worlds, steps = self.batch.worlds, self.state.timestep.tolist()
        due: Bool = np.zeros(len(worlds), np.bool_)
        for slot in np.flatnonzero((self._is_agent[self.driver] & ~self.state.present).any(axis=1)).tolist():
            absent = self._is_agent[self.driver[slot]] & ~self.state.present[slot]
            later = worlds[slot].log_valid[steps[slot] + 1 :, absent[: worlds[slot].num_objects]]
            due[slot] = later.any()
        return due

    # --- a step ---------------------------------------------------------------------------------------

    def _step_in_parts(self, drive: int, rest: int) -> None:
        """Step with policies or a backend outside of the compiled step, or with agents that appear."""
        self._run(MOVE | drive)
        driver = np.where(self._has_begun[:, None], np.uint8(UNDRIVEN), self.driver)
        for number in np.flatnonzero(self._movement == UNCOMPILED).tolist():
            playing = [policies[number] for policies in self._playing]
            for policy in dict.fromkeys(playing):
                rows = np.array([other == policy for other in playing])
                here = driver if rows.all() else np.where(rows[:, None], driver, np.uint8(UNDRIVEN))
                policy.advance(self.batch, self.previous, self.state, here, number, self.dt)
        if not drive and len(self.agents) and not self._has_passengers:
            moves = ~self._has_begun[self.agents[:, 0]]
            self._session.drive(self.state, self.agents[moves], self.actions[moves], self.dt)
        acted = self.agents
        if self._is_agent_due:
            self._list_agents()
        if self.agents is acted:
            self._run(rest)
            return
        is_new = ~among(self.agents, acted)
        self._run(LOCATE)
        self._contacts_before[is_new] = self.contacts[is_new]  # a new agent's first contacts are no crashes
        self._run(rest & ~LOCATE)

    def _run(self, phases: int) -> None:
        """Run phases of the compiled step in all worlds."""
        session, observer = self._session, self.observer
        vehicles, substeps = (
            (session.vehicles, session.substeps) if isinstance(session, KinematicSession) else _NO_VEHICLE
        )
        before = self._own_route_before if self._has_passengers else self.previous.route
        agents = DrivenArrays(
            self.agents, self._first_agent, self.actions, self.route, before, self.contacts, self._contacts_before,
            self.hits,
        )  # fmt: skip
        traffic = Traffic(self.driver, self._movement, self._law, LIGHT_COLORS)
        numbers = self._dt, LOOK_BACK, LOOK_AHEAD, 0.0 if self._has_passengers else 1.0
        moments = self.previous.moment, self.state.moment
        rest = (
            numbers, self._has_begun, self.batch.recorded, self.batch.lines, *moments, traffic, agents, vehicles,
            observer.task, observer.result, observer.sensing,
        )  # fmt: skip

        step, follow = _unchecked(step_worlds), _unchecked(drive_by_idm)
        is_split = phases & MOVE and FOLLOW_PATH in self._movement

        def run(first: int, end: int) -> int:
            scratch = Scratch.of(self.batch.max_objects, observer.sensing)
            if is_split:
                step((first, end, MOVE, substeps), *rest, scratch)
                memory = SightMemory.of(self.batch.max_objects)
                follow(first, end, self._dt, self._has_begun, self.batch.recorded, *moments, traffic, memory)
            lost: int = step((first, end, phases & ~MOVE if is_split else phases, substeps), *rest, scratch)
            return lost

        lost = self._threads.run(run, len(self.batch))
        if phases & OBSERVE:
            self.observer.is_stale &= bool(phases & ONLY_BEGUN)
            require_located(max(lost), self.agents)

    # --- agents ---------------------------------------------------------------------------------------

    def _list_agents(self) -> None:
        """List the present agents; those that were present before keep their contacts."""
        if self._has_passengers:
            slots = np.arange(len(self.batch) + 1, dtype=np.int32)
            rows, first = np.stack([slots[:-1], self.batch.ego.astype(np.int32)], axis=1), slots
            self._is_agent_due = False
        else:
            listed, first = np.empty((self.driver.size, 2), np.int32), np.empty(len(self.batch) + 1, np.int32)
            arrays = self.driver, self.state.present, self._is_agent, listed, first
            self._is_agent_due = _unchecked(list_agents)(*arrays)
            rows = listed[: first[-1]].copy()
        contacts, before = self.contacts, self._contacts_before
        if np.array_equal(first, self._first_agent) and contacts.shape[1] == self.batch.max_objects:
            if not np.array_equal(rows, self.agents):
                self.agents = rows  # in worlds that begin an episode
            return
        old, hits, actions = self.agents, self.hits, self.actions
        self.agents, self._first_agent = rows, first
        self._clear_agents()
        kept, place, width = among(old, rows), among(rows, old), contacts.shape[1]
        self.contacts[place, :width], self._contacts_before[place, :width] = contacts[kept], before[kept]
        self.hits[place], self.actions[place] = hits[kept], actions[kept]
        self.observer.resize(self)
        self.observer.is_stale = True

    def _clear_agents(self) -> None:
        """Allocate contacts and actions of the agents."""
        count = len(self.agents)
        self.actions = np.zeros((count, 2))
        self.contacts: Bool = np.zeros((count, self.batch.max_objects), np.bool_)
        self._contacts_before: Bool = self.contacts.copy()
        self.hits: UInt32 = np.zeros(count, np.uint32)

    # --- worlds ---------------------------------------------------------------------------------------

    def _prepare(self, world: World, policies: Any) -> tuple[World, UInt8]:
        """Return a world as policies need it, and the policy of each object."""
        if abs(world.dt - self._dt) > 1e-3:
            raise BadParameter(
                f"{world.scenario_id}: timestep {world.dt} s among worlds of {self._dt} s; make it with "
                f"World.from_scenario(scenario, dt={self._dt})"
            )
        driver = np.full(world.num_objects, UNDRIVEN, np.uint8)
        for number, policy in enumerate(policies):
            driver[policy.selects(world)] = number
        for number, policy in enumerate(policies):
            world = policy.prepare(world, driver == number)
        return world, driver

    def _grow(self) -> None:
        """Make room for the largest world."""
        more = self.batch.max_objects - self.driver.shape[1]
        if more <= 0:
            return
        self.state, previous = self.state.resized(self.batch.max_objects), self.previous
        self.previous = self.state.twin()
        here = np.s_[:, : previous.present.shape[1]]
        for name in ("motion", "route", "present"):
            getattr(self.previous, name)[here] = getattr(previous, name)
        self.previous.timestep[:] = previous.timestep
        self.driver = np.pad(self.driver, ((0, 0), (0, more)), constant_values=UNDRIVEN)
        wider = (0, 0), (0, more), (0, 0)
        self._own_route = np.pad(self._own_route, wider, constant_values=np.nan)
        self._own_route_before = np.pad(self._own_route_before, wider, constant_values=np.nan)


_NO_VEHICLE = np.zeros((0, 0, NUM_COLUMNS)), 1
"""Vehicles and substeps for the compiled step of a backend that is not part of it."""


def _laws(policies: tuple[Policy, ...]) -> Float64:
    """Return the numbers (P, 8) of the policies' driver models."""
    return np.array([policy.law for policy in policies]).reshape(-1, 8)


def _unchecked(kernel: Any) -> Any:
    """Return a kernel that does not check the types of its arguments, which are the same in every call."""
    return kernel.unchecked if isinstance(kernel, Kernel) else kernel


def among(rows: Int32, others: Int32) -> Bool:
    """Return which rows (A, 2) of worlds and objects are among others (B, 2); both are sorted."""
    keys = np.array([1 << 32, 1])
    wanted, known = rows @ keys, others @ keys
    found: Bool = np.append(known, -1)[np.searchsorted(known, wanted)] == wanted
    return found
