"""The simulation loop: W worlds advanced in lockstep."""

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
from scenarionet_sim.worlds.state import History, State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch

UNDRIVEN = 255
"""In ``Simulation.driver``: a row that no policy drives and that is never present."""

LOOK_BACK, LOOK_AHEAD = 10.0, 20.0
"""Search window on an agent's path around its last location [m]."""


class Simulation:
    """Worlds advanced in lockstep, each in a slot with its own episode.

    In a step every policy writes the next state of its objects, the backend moves the agents by their actions, then
    contacts and locations on paths are updated. Results are deterministic.

    Args:
        worlds: One per slot; all with the same timestep length.
        policies: Policies in rising priority: an object is driven by the last one that selects it.
        backend: Vehicle dynamics of the agents; None for ``Kinematic()``.
        history: Number of past moments to keep in ``state.history``, for sensors that show them.

    Attributes:
        batch: Maps, logs and paths of the worlds.
        state: The current state, and ``previous`` the one before; a step exchanges the two.
        driver: (W, N) uint8 policy of each object, or ``UNDRIVEN``.
        agents: (A, 2) int32 world and row of each present agent, sorted; the order of ``step``'s actions.
        actions: (A, 2) float64 actions of the last step, clipped to [-1, 1].
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

    def __repr__(self) -> str:
        drivers = ", ".join(type(policy).__name__ for policy in self.policies)
        return f"Simulation({len(self.batch)} worlds, {len(self.agents)} agents, policies: {drivers})"

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return self._worlds[0].dt

    def reset(self, slot: int, world: World | None = None, start: int | None = None) -> None:
        """Begin an episode in a slot.

        Args:
            slot: The slot.
            world: Its next world; None for the same again.
            start: First timestep of the log; None for the first at which the ego is valid.

        Raises:
            BadParameter: The world has another timestep length.
        """
        self._begin(slot, world or self._worlds[slot], start)
        self._find_agents()

    def step(self, actions: npt.ArrayLike | None = None) -> None:
        """Advance every world by one timestep.

        Args:
            actions: (A, 2) steering and throttle in [-1, 1] for each of ``agents``, clipped; None for zeros.

        Raises:
            BadParameter: The number of actions differs from that of agents, or one is NaN.
        """
        self.actions = np.zeros((len(self.agents), 2)) if actions is None else checked_actions(actions)
        if len(self.actions) != len(self.agents):
            raise BadParameter(f"{len(self.actions)} actions for {len(self.agents)} agents; pass one per agent")
        now, then = self.state, self.previous
        if now.history is not None:
            now.history.push(now)
        then.motion[...], then.route[...], then.present[...] = now.motion, now.route, now.present
        np.add(now.timestep, 1, out=then.timestep)
        for number in self._driving:
            self.policies[number].advance(self.batch, now, then, self.driver, number, self.dt)
        if len(self.agents):
            self._session.drive(then, self.agents, self.actions, self.dt)
        self.state, self.previous = then, now
        if self._is_agent_due:
            self._find_agents()
        else:
            self._observe_agents()

    def retire(self, agents: npt.ArrayLike) -> None:
        """Remove agents from their worlds for the rest of the episode.

        Args:
            agents: (K, 2) world and row of each, out of ``agents``.
        """
        worlds, rows = np.asarray(agents, np.int32).reshape(-1, 2).T
        self.driver[worlds, rows] = UNDRIVEN
        self.state.present[worlds, rows] = self.previous.present[worlds, rows] = False
        self._find_agents()

    def close(self) -> None:
        """Release the resources of the backend."""
        self._session.close()

    def _begin(self, slot: int, world: World, start: int | None) -> None:
        if abs(world.dt - self.dt) > 1e-3:
            raise BadParameter(
                f"{world.scenario_id}: timestep {world.dt} s among worlds of {self.dt} s; make it with "
                f"World.from_scenario(scenario, dt={self.dt})"
            )
        self._worlds[slot] = world
        driver = np.full(world.num_objects, UNDRIVEN, np.uint8)
        for number, policy in enumerate(self.policies):
            driver[policy.selects(world)] = number
        for number, policy in enumerate(self.policies):
            world = policy.prepare(world, driver == number)
        if world is not self.batch.worlds[slot]:
            self.batch.replace(slot, world)
            more = self.batch.max_objects - self.driver.shape[1]
            if more > 0:
                self.state, self.previous = (s.resized(self.batch.max_objects) for s in (self.state, self.previous))
                self.previous.history = self.state.history
                self.driver = np.pad(self.driver, ((0, 0), (0, more)), constant_values=UNDRIVEN)
        self.driver[slot] = UNDRIVEN
        self.driver[slot, : world.num_objects] = driver
        self._driving = [number for number in range(len(self.policies)) if (self.driver == number).any()]
        first = int(np.argmax(world.log_valid[:, world.ego])) if start is None else start
        self.state.begin(slot, world, first, driver != UNDRIVEN)
        self.previous.begin(slot, world, first, driver != UNDRIVEN)
        self._session.reset(slot, self.state)

    def _find_agents(self) -> None:
        """List the present agents and their contacts."""
        is_external = np.array([isinstance(policy, External) for policy in self.policies] + [False])
        is_agent: Bool = is_external[np.minimum(self.driver, len(self.policies))]
        # C order, although argwhere may return columns: kernels are compiled per memory layout.
        self.agents: Int32 = np.argwhere(is_agent & self.state.present).astype(np.int32, order="C")
        self._is_agent_due = bool((is_agent & ~self.state.present).any())
        self.contacts: Bool = np.zeros((len(self.agents), self.batch.max_objects), np.bool_)
        self.hits: npt.NDArray[np.uint32] = np.zeros(len(self.agents), np.uint32)
        self._observe_agents()

    def _observe_agents(self) -> None:
        """Update contacts and locations on paths of the agents."""
        batch, state = self.batch, self.state
        follow_paths(
            self.agents, state.motion, batch.path, batch.path_offsets, LOOK_BACK, LOOK_AHEAD, state.route, True
        )
        boxes = state.motion, state.size, state.object_type, state.present
        find_contacts(self.agents, *boxes, self.contacts, self.hits)
