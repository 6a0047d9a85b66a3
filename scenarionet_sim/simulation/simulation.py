"""The simulation loop: W worlds advanced in lockstep."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, IntP, UInt8, UInt32, is_count
from scenarionet_data.compiled.checking import unchecked
from scenarionet_data.errors import BadParameter
from scenarionet_sim.arrays.structures import Series
from scenarionet_sim.backends.base import Backend, checked_actions
from scenarionet_sim.backends.bicycle_kernels import NUM_COLUMNS
from scenarionet_sim.backends.kinematic import Kinematic, KinematicSession
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.policies.slots import SlotPolicies, prepared
from scenarionet_sim.policies.strip_kernels import SightMemory
from scenarionet_sim.sensors.base import require_located
from scenarionet_sim.sensors.observation_kernels import PIECES_NEAR, Scratch
from scenarionet_sim.simulation.agents import DrivenAgents
from scenarionet_sim.simulation.observer import Observer
from scenarionet_sim.simulation.recording import NOT_RECORDED, EpisodeArrays
from scenarionet_sim.simulation.step import (
    DRIVE,
    GO_ON,
    LOCATE,
    MOVE,
    OBSERVE,
    ONLY_BEGUN,
    RECORD,
    SETTLE,
    step_reactive_worlds,
    step_worlds,
)
from scenarionet_sim.simulation.step_arrays import Exchange, StepArrays, StepSettings
from scenarionet_sim.threads.sharing import Team
from scenarionet_sim.threads.team import Threads
from scenarionet_sim.worlds.episode_kernels import AT_FIRST, GOES_ON, UNDRIVEN
from scenarionet_sim.worlds.state import History, State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch

LOOK_BACK, LOOK_AHEAD = 10.0, 20.0
"""Search window on an agent's path around its last location [m]."""


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
        may_play: Whether steps are compiled as a whole, and nothing shows past moments: see :meth:`play`.

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
        if not isinstance(worlds, Sequence) or not all(isinstance(world, World) for world in worlds) or not worlds:
            raise BadParameter(f"worlds={worlds!r}; expected one or more, as in [World.from_scenario(scenario)]")
        policies = tuple(policies) if isinstance(policies, Iterable) else (policies,)
        if not all(isinstance(policy, Policy) for policy in policies):
            raise BadParameter(f"policies={policies!r}; expected policies, such as (Replay(), Idm(), External())")
        if not isinstance(backend, Backend | None) or isinstance(backend, type):
            raise BadParameter(f"backend={backend!r}; expected, for example, Kinematic()")
        self.observer = observer or Observer.nothing(len(worlds))
        self._dt, self._threads = worlds[0].dt, Threads(threads)
        self._memory: list[tuple[Any, ...]] = []  # by thread
        self._memory_for: tuple[int, int, Any] = 0, 0, None  # largest numbers of objects and pieces, kinds of sensors
        self._policies = SlotPolicies(policies, len(worlds))
        self._agents = DrivenAgents(self._policies.are_external, len(worlds), are_egos=has_passengers)
        self.batch = WorldBatch(worlds, self.policies, self._prepare, keep)
        shape = len(worlds), self.batch.max_objects
        self.state = State.empty(*shape)
        history = max([history, *(policy.history for policy in self.policies)])
        if history:
            self.state.history = History.empty(history, *shape)
        self.previous = State.empty(*shape).sharing(self.state)
        self.driver: UInt8 = np.full(shape, UNDRIVEN, np.uint8)
        self._session = (backend or Kinematic()).open(self.batch)
        self._kinematic = kinematic = self._session if isinstance(self._session, KinematicSession) else None
        substeps = kinematic.substeps if kinematic else 1
        self._settings = StepSettings(self._dt, LOOK_BACK, LOOK_AHEAD, not has_passengers, substeps, 0)
        self._begins: Int32 = np.full(len(worlds), GOES_ON, np.int32)
        self._is_compiled = kinematic is not None and self._policies.are_compiled
        self._moving = MOVE | DRIVE if kinematic and not has_passengers else MOVE
        self.may_play = self._is_compiled and not history
        self._begins_in_step = kinematic is not None and self.may_play and len(kinematic.new_vehicle) > 0
        self._arrays: dict[int, StepArrays] = {}  # of the step to each of the two states, by the identity of the state
        self.begin(range(len(worlds)), worlds)
        self.observe_begun()

    def __repr__(self) -> str:
        drivers = ", ".join(type(policy).__name__ for policy in self.policies)
        return f"Simulation({len(self.batch)} worlds, {len(self.agents)} agents, policies: {drivers})"

    @property
    def policies(self) -> tuple[Policy, ...]:
        """Policies of the episodes that begin next; others of the same kinds can be set, with other parameters."""
        return self._policies.of_next

    @policies.setter
    def policies(self, policies: tuple[Policy, ...]) -> None:
        self._policies.replace(policies)

    @property
    def agents(self) -> Int32:
        """(A, 2) world and row of each present agent, sorted."""
        return self._agents.rows

    @property
    def actions(self) -> Float64:
        """(A, 2) actions of the last step."""
        return self._agents.actions[self._agents.places]

    @property
    def contacts(self) -> Bool:
        """(A, N) objects that each agent's box overlaps."""
        return self._agents.contacts[self._agents.places]

    @property
    def hits(self) -> UInt32:
        """(A,) types of those objects, as bits."""
        return self._agents.hits[self._agents.places]

    @property
    def by_place(self) -> DrivenAgents:
        """The agents by their places, at which observers write their results."""
        return self._agents

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return self._dt

    @property
    def route(self) -> Float64:
        """(W, N, 2) location of the agents on their paths."""
        return self._agents.route(self.state)

    def reset(self, slot: int, world: World | None = None, start: int | None = None) -> None:
        """Begin an episode in a slot.

        Args:
            slot: The slot.
            world: Its next world; None for the same again.
            start: First timestep of the log; None for the first at which the ego is valid.

        Raises:
            BadParameter: The world has another timestep length.
        """
        if not is_count(slot) or slot >= len(self.batch):
            raise BadParameter(f"slot={slot!r}; expected a whole number from 0 to {len(self.batch) - 1}")
        self.begin([slot], [world], start)
        self.observe_begun()

    def begin(self, slots: Sequence[int] | IntP, worlds: Sequence[World | None], start: int | None = None) -> None:
        """Begin episodes in several slots in the next step, in which their worlds do not move; as :meth:`reset`.

        The step has to come next: until then, the state of these slots is undefined.
        """
        self.batch.replace(slots, worlds, self.policies)
        self._grow()
        self._policies.begin(slots)
        self._begins[slots] = AT_FIRST if start is None else start
        self._prepare_beginning(slots)

    def begin_known(self, slots: IntP, coming: IntP, series: Series) -> int:
        """Begin episodes of scenarios, as :meth:`begin`, if the pool has all of their worlds.

        Args:
            slots: (B,) the slots.
            coming: (B + L,) their scenarios, and those that come later.
            series: What ``WorldBatch.note`` noted of them.

        Returns:
            Number of the later ones that the pool has not; -1 if it has not all of the others, or if other policies
            were set since, and then nothing is changed.
        """
        if self._policies.are_replaced:
            return -1
        num_unknown = self.batch.begin_known(slots, coming, series, self._begins)
        if num_unknown >= 0:
            self._prepare_beginning(slots)
        return num_unknown

    def observe_begun(self) -> None:
        """Observe the agents of worlds that have begun an episode, which then move in the next step."""
        self.observer.copy_results()
        self._run(LOCATE | ONLY_BEGUN | GO_ON | self.observer.phases & ~SETTLE)

    def step(self, actions: npt.ArrayLike | None = None) -> None:
        """Advance every world by one timestep.

        Args:
            actions: (A, 2) steering and throttle in [-1, 1] for each of ``agents``, clipped; None for zeros.

        Raises:
            BadParameter: The number of actions differs from that of agents, or one is not finite.
        """
        self._agents.actions[:] = 0.0
        if actions is not None:
            checked = checked_actions(actions)
            if len(checked) != len(self.agents):
                raise BadParameter(f"{len(checked)} actions for {len(self.agents)} agents; pass one per agent")
            self._agents.actions[self._agents.places] = checked
        self._step()

    def step_by_place(self, actions: npt.ArrayLike, num_given: int = 1) -> None:
        """Advance every world by one timestep; see ``DrivenAgents.act`` for the arguments."""
        self._agents.act(actions, num_given)
        self._step()

    def play(self, episodes: EpisodeArrays) -> None:
        """Advance every world until its recorded episode is over or has no room left, if the simulation may."""
        self._step(RECORD, episodes)

    def settle(self) -> None:
        """Let agents that ended leave their rows of flat buffers, if that is not a part of each step."""
        self._run(SETTLE)
        self._agents.forget_list()

    def retire(self, agents: npt.ArrayLike) -> None:
        """Remove agents from their worlds for the rest of the episode.

        Args:
            agents: (K, 2) world and row of each, out of ``agents``.
        """
        worlds, rows = np.asarray(agents, np.int32).reshape(-1, 2).T
        self.driver[worlds, rows] = UNDRIVEN
        self.state.present[worlds, rows] = self.previous.present[worlds, rows] = False
        self._agents.remove(worlds, rows)
        self.observer.is_stale = True

    def rest(self, slot: int) -> None:
        """Stop driving the objects of a slot, until its next episode begins."""
        self.driver[slot] = UNDRIVEN
        self._agents.remove_all(slot)
        self.observer.is_stale = True

    def observe(self) -> None:
        """Let the observer observe the agents again, if some have left since the last step."""
        if self.observer.is_stale:
            self.observer.copy_results()
            self._run(OBSERVE)

    def close(self) -> None:
        """Release the resources of the backend, and stop the threads."""
        self._session.close()
        self._threads.close()

    def _prepare_beginning(self, slots: Sequence[int] | IntP) -> None:
        """Prepare for episodes that begin in slots, whose worlds and first timesteps are set."""
        self._agents.forget_list()
        if self._begins_in_step:
            return
        self._run(0)  # before the step, for what is outside of it
        for slot in list(slots):
            self._session.reset(slot, self.state)
            if not self._policies.are_compiled:
                self._policies.begin_uncompiled(self.batch, self.state, slot)
        if self.state.history is not None:
            self.state.history.present[:, list(slots)] = False

    def _step(self, more: int = 0, episodes: EpisodeArrays = NOT_RECORDED) -> None:
        """Advance every world by one timestep, or by many, in which the agents act as they are set to."""
        if self.state.history is not None:
            self.state.history.push(self.state)
        self.state, self.previous = self.previous, self.state
        self.observer.renew_results()
        if self._is_compiled:
            self._run(self._moving | LOCATE | GO_ON | self.observer.phases | more, episodes)
        else:
            self._step_in_parts()
        self._agents.forget_list()

    def _step_in_parts(self) -> None:
        """Step with policies or a backend outside of the compiled step."""
        self._run(self._moving)
        if not self._policies.are_compiled:
            driver = np.where((self._begins == GOES_ON)[:, None], self.driver, np.uint8(UNDRIVEN))
            self._policies.advance_uncompiled(self.batch, self.previous, self.state, driver, self.dt)
        if self._moving == MOVE and len(self.agents) and not self._agents.are_egos:
            moves = self._begins[self.agents[:, 0]] == GOES_ON
            self._session.drive(self.state, self.agents[moves], self.actions[moves], self.dt)
        self._run(LOCATE | GO_ON | self.observer.phases)

    def _run(self, phases: int, episodes: EpisodeArrays = NOT_RECORDED) -> None:
        """Run phases of the compiled step in all worlds."""
        observer, arrays = self.observer, self._arrays.get(id(self.state))
        if arrays is None or arrays.recorded is not self.batch.recorded:
            arrays = self._arrays[id(self.state)] = self._collect()
        exchange = Exchange(self._agents.actions, observer.result, observer.sensing, episodes)
        step = unchecked(step_reactive_worlds if self._policies.follow_paths else step_worlds)

        def run(own: int, team: Team) -> None:
            step(own, team, phases, self._settings, arrays, exchange, *self._memory[own])

        lost = self._threads.share(run, len(self.batch))
        if phases & OBSERVE:
            observer.is_stale &= bool(phases & ONLY_BEGUN)
            if lost >= 0:
                require_located(0, self.agents[self._agents.places == lost])

    def _collect(self) -> StepArrays:
        """Return the arrays of a step from the previous state to the current one."""
        if (self.observer.sensing.kind == PIECES_NEAR).any():
            self.batch.show_pieces()
        self._allocate_memory()
        kinematic, agents = self._kinematic, self._agents.arrays(self.previous, self.state)
        vehicles, new_vehicle = (kinematic.vehicles, kinematic.new_vehicle) if kinematic else _NO_VEHICLE
        moments, traffic = (self.previous.moment, self.state.moment), self._policies.traffic(self.driver)
        return StepArrays(
            self._begins, self.batch.recorded, self.batch.lines, *moments, traffic, agents, vehicles, new_vehicle,
            self.observer.task, self.observer.totals, self.observer.seats,
        )  # fmt: skip

    def _allocate_memory(self) -> None:
        """Allocate the memory of the threads for the compiled step, if it is for other sensors or smaller worlds."""
        (count, pieces), sensing = (self.batch.max_objects, self.batch.pool.max_pieces), self.observer.sensing
        if self._memory and self._memory_for[:2] == (count, pieces) and self._memory_for[2] is sensing.kind:
            return
        self._threads.dismiss()
        self._memory_for = count, pieces, sensing.kind
        self._memory = [
            (Scratch.of(count, pieces, sensing), *((SightMemory.of(count),) if self._policies.follow_paths else ()))
            for _ in range(self._threads.count)
        ]

    def _prepare(self, world: World, policies: Any) -> tuple[World, UInt8, Bool]:
        """Return a world as policies need it, the policy of each object, and the agents."""
        if abs(world.dt - self._dt) > 1e-3:
            raise BadParameter(
                f"{world.scenario_id}: timestep {world.dt} s among worlds of {self._dt} s; make it with "
                f"World.from_scenario(scenario, dt={self._dt})"
            )
        prepared_world, driver = prepared(world, policies)
        return prepared_world, driver, self._agents.among(prepared_world, driver)

    def _grow(self) -> None:
        """Make room for the largest world."""
        more = self.batch.max_objects - self.driver.shape[1]
        has_other_places = self._agents.make_room(self.batch)
        self._arrays.clear()
        num_seats = self.observer.num_seats
        num_observed = self._agents.row_at.shape[1] if num_seats is None else num_seats
        self._settings = self._settings._replace(num_observed=num_observed)
        if has_other_places or more > 0:
            self.observer.resize(self._agents.num_places, len(self.batch), self.batch.max_objects)
        if more <= 0:
            return
        if self._kinematic:
            self._kinematic.make_room(self.batch.max_objects)
        self.state = self.state.resized(self.batch.max_objects)
        self.previous = self.previous.resized(self.batch.max_objects).sharing(self.state)
        self.driver = np.pad(self.driver, ((0, 0), (0, more)), constant_values=UNDRIVEN)


_NO_VEHICLE = np.zeros((0, 0, NUM_COLUMNS)), np.zeros(0)
"""Vehicles and a new one for the compiled step of a backend that is not part of it."""
