"""The one loop under every environment: W worlds, stepped together."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Bool, Int32, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_sim.backends.base import Backend, checked_actions
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.kernels.overlap import find_contacts
from scenarionet_sim.kernels.paths import follow_paths
from scenarionet_sim.policies import External, Policy, Replay
from scenarionet_sim.worlds.history import History
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch

UNDRIVEN = 255
"""In ``Simulation.driver``: a row that no policy drives, and that is never present."""

LOOK_BACK, LOOK_AHEAD = 10.0, 20.0  # [m] an agent is looked for on its path around where it was


class Simulation:
    """Worlds that run in step, each in its slot with an episode of its own.

    A step is: every policy writes the next moment of its objects, the backend moves the agents with the actions,
    then contacts and places along paths are found. The same worlds, actions and backend give the same bits.

    Args:
        worlds: One for each slot; all of one timestep.
        policies: ObjectMask drives what; the last that wants an object drives it.
        backend: How agents move.
        history: History moments to remember in ``state.history``, for sensors that show them.

    Attributes:
        batch: The worlds.
        state: The moment, and ``previous`` the one before; a step exchanges the two.
        driver: (W, N) uint8 number of the policy that drives each object, or ``UNDRIVEN``.
        agents: (A, 2) int32 world and row of each agent that is present, in that order: what ``step`` takes
            actions for.
        actions: (A, 2) float64 what the agents of the last step did, within [-1, 1].
        contacts: (A, N) bool what each agent's box overlaps.
        hits: (A,) uint32 the same by type: bit k is set when an object of type k is touched.

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
    ) -> None:
        self.policies = tuple(policies)
        self.batch = WorldBatch(worlds)
        self._worlds = list(worlds)
        shape = len(worlds), self.batch.max_objects
        self.state, self.previous = State.empty(*shape), State.empty(*shape)
        if history:
            self.state.history = self.previous.history = History.empty(history, *shape)
        self.driver: UInt8 = np.full(shape, UNDRIVEN, np.uint8)
        self._session = (backend or Kinematic()).open(self.batch)
        for slot in range(len(worlds)):
            self._begin(slot, worlds[slot], None)
        self._find_agents()

    @property
    def dt(self) -> float:
        """Seconds from one step to the next."""
        return self._worlds[0].dt

    def reset(self, slot: int, world: World | None = None, start: int | None = None) -> None:
        """Begin an episode in a slot.

        Args:
            slot: Which.
            world: Another world; the same again for None.
            start: The log's timestep to begin at; None for the first at which the ego is valid.
        """
        self._begin(slot, world or self._worlds[slot], start)
        self._find_agents()

    def step(self, actions: npt.ArrayLike | None = None) -> None:
        """Advance every world by one timestep.

        Args:
            actions: (A, 2) steering and throttle in [-1, 1] for each of ``agents``; what is outside is clipped.
                None is all zeros.

        Raises:
            BadParameter: There are more or fewer actions than agents, or one is not a number.
        """
        self.actions = np.zeros((len(self.agents), 2)) if actions is None else checked_actions(actions)
        if len(self.actions) != len(self.agents):
            raise BadParameter(f"{len(self.actions)} actions for {len(self.agents)} agents; give one for each")
        now, then = self.state, self.previous
        if now.history is not None:
            now.history.remember(now)
        np.add(now.timestep, 1, out=then.timestep)
        for number in self._driving:
            self.policies[number].advance(self.batch, now, then, self.driver, number, self.dt)
        if len(self.agents):
            self._session.drive(then, self.agents, self.actions, self.dt)
        self.state, self.previous = then, now
        if self._is_agent_due:
            self._find_agents()
        else:
            self._look()

    def retire(self, agents: npt.ArrayLike) -> None:
        """Take agents out of their worlds for the rest of the episode.

        Args:
            agents: (K, 2) world and row of each, of ``agents``.
        """
        worlds, rows = np.asarray(agents, np.int32).reshape(-1, 2).T
        self.driver[worlds, rows] = UNDRIVEN
        self.state.present[worlds, rows] = self.previous.present[worlds, rows] = False
        self._find_agents()

    def close(self) -> None:
        """Give back what the backend holds."""
        self._session.close()

    def _begin(self, slot: int, world: World, start: int | None) -> None:
        if abs(world.dt - self.dt) > 1e-3:
            raise BadParameter(f"{world.scenario_id}: timestep {world.dt} s among worlds of {self.dt} s; select by dt")
        self._worlds[slot] = world
        driver = np.full(world.num_objects, UNDRIVEN, np.uint8)
        for number, policy in enumerate(self.policies):
            driver[policy.wants(world)] = number
        for number, policy in enumerate(self.policies):
            world = policy.prepare(world, driver == number)
        if world is not self.batch.worlds[slot]:
            self.batch.replace(slot, world)
            if self.batch.max_objects > self.driver.shape[1]:
                self._make_room()
        self.driver[slot] = UNDRIVEN
        self.driver[slot, : world.num_objects] = driver
        self._driving = [number for number in range(len(self.policies)) if (self.driver == number).any()]
        first = int(np.argmax(world.log_valid[:, world.ego])) if start is None else start
        self.state.begin(slot, world, first, driver != UNDRIVEN)
        self.previous.begin(slot, world, first, driver != UNDRIVEN)
        if self.state.history is not None:
            self.state.history.forget(slot)
        self._session.reset(slot, self.state)

    def _make_room(self) -> None:
        """Larger moments, with a row for every object that the batch has room for."""
        shape = len(self.batch), self.batch.max_objects
        state, previous, driver = self.state, self.previous, self.driver
        self.state, self.previous = State.empty(*shape), State.empty(*shape)
        self.state.take(state)
        self.previous.take(previous)
        if state.history is not None:
            self.state.history = self.previous.history = state.history.with_room(self.batch.max_objects)
        self.driver = np.full(shape, UNDRIVEN, np.uint8)
        self.driver[:, : driver.shape[1]] = driver

    def _find_agents(self) -> None:
        """ObjectMask is an agent now, and what it touches."""
        is_external = np.array([isinstance(policy, External) for policy in self.policies] + [False])
        is_agent: Bool = is_external[np.minimum(self.driver, len(self.policies))]
        # Rows, also where numpy returns columns: kernels are compiled for each layout.
        self.agents: Int32 = np.argwhere(is_agent & self.state.present).astype(np.int32, order="C")
        self._is_agent_due = bool((is_agent & ~self.state.present).any())
        self.contacts: Bool = np.zeros((len(self.agents), self.batch.max_objects), np.bool_)
        self.hits: npt.NDArray[np.uint32] = np.zeros(len(self.agents), np.uint32)
        self._look()

    def _look(self) -> None:
        """Where agents are on their paths and what they touch."""
        batch, state = self.batch, self.state
        paths = batch.path_points, batch.path_arc, batch.path_heading, batch.path_z, batch.path_offsets
        places = state.arc, state.lateral, state.z
        follow_paths(self.agents, state.position, *paths, LOOK_BACK, LOOK_AHEAD, *places)
        boxes = state.position, state.heading, state.z, state.size, state.object_type, state.present
        find_contacts(self.agents, *boxes, self.contacts, self.hits)
