"""The environment below Gymnasium's interfaces: worlds in lockstep with agents that observe and are scored."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int32, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_sim.environments.config import EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.kernels.overlap import find_contacts
from scenarionet_sim.kernels.paths import follow_paths
from scenarionet_sim.kernels.scoring import NUM_TOTALS, NUMBERS, TERMS, Contacts, StepResult, score_step
from scenarionet_sim.policies import External
from scenarionet_sim.simulation import LOOK_AHEAD, LOOK_BACK, Simulation
from scenarionet_sim.task.task import ARRIVED, DRIVING, OFF_ROUTE, TIMED_OUT, task_parameters
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World

ENDS = {"success": ARRIVED, "out_of_road": OFF_ROUTE, "timeout": TIMED_OUT}
"""How an episode ended, in the terms of the paper's metrics."""


class BatchedEnvironment:
    """W worlds with their agents: objects of ``External``, or without such a policy the ego of every world.

    Args:
        config: Configuration.
        observation: Sensors of the agents.
        worlds: One per slot.

    Attributes:
        simulation: The worlds.
        agents: (A, 2) int32 world and row of each agent, sorted.
        contacts: (A, N) bool objects that each agent's box overlaps.
        route: (W, N, 2) float64 location of the agents on their paths, see ``State``.
        numbers: (A, 14) float64 results of the last step, in the order of ``NUMBERS``.
        terms: (A, 4) view of ``numbers``: weighted terms of the reward.
        status: (A,) uint8 codes of ``task.Status``.
    """

    def __init__(self, config: EnvConfig, observation: Observation, worlds: Sequence[World]) -> None:
        self._observation = observation
        self._task = task_parameters(config.reward, config.termination)
        history = max(getattr(sensor, "history", 0) for sensor in config.sensors)
        self.simulation = Simulation(worlds, config.policies, config.backend, history)
        self._has_actions = any(isinstance(policy, External) for policy in config.policies)
        self.agents: Int32 = np.zeros((len(worlds), 2), np.int32)
        self.route: Float64 = np.zeros((len(worlds), 0, 2))
        self._hits = np.zeros(len(worlds), np.uint32)
        self._totals = np.zeros((len(worlds), 0, NUM_TOTALS))
        self._resize()
        for slot in range(len(worlds)):
            self._locate(slot)
        self._allocate()

    def __repr__(self) -> str:
        return f"BatchedEnvironment({self.simulation!r})"

    @property
    def rewards(self) -> Float64:
        """(A,) sums of the terms."""
        return np.asarray(self.terms.sum(axis=1))

    @property
    def terminated(self) -> Bool:
        """(A,) agents that arrived or left their route."""
        return np.asarray((self.status != DRIVING) & (self.status != TIMED_OUT))

    @property
    def truncated(self) -> Bool:
        """(A,) agents whose time is over."""
        return np.asarray(self.status == TIMED_OUT)

    @property
    def arc(self) -> Float64:
        """(A,) arc length of each agent on its route [m]."""
        arc: Float64 = self.route[self.agents[:, 0], self.agents[:, 1], 0]
        return arc

    def begin(self, slot: int, world: World, start: int | None = None) -> None:
        """Begin an episode in a slot; see :meth:`Simulation.reset`.

        Raises:
            BadParameter: The ego is not valid at timestep ``start``.
        """
        if start is not None and not (0 <= start < world.num_steps and world.log_valid[start, world.ego]):
            (valid,) = np.nonzero(world.log_valid[:, world.ego])
            raise BadParameter(
                f"{world.scenario_id}: the ego is not valid at timestep {start}; choose {valid[0]} to {valid[-1]}"
            )
        self.simulation.reset(slot, world, start)
        self._resize()
        self._totals[slot] = 0.0
        self._locate(slot)
        if len(self.agents) != len(self.numbers):
            self._allocate()
        self._contacts_before = self.contacts.copy()
        self.numbers[self.agents[:, 0] == slot] = 0.0
        self.status[self.agents[:, 0] == slot] = DRIVING

    def step(self, actions: npt.ArrayLike) -> None:
        """Advance every world by one timestep and score the agents.

        Args:
            actions: (A, 2) steering and throttle; ignored without an ``External`` policy.

        Raises:
            BadParameter: The number of actions differs from that of agents, or one is NaN.
        """
        acting = self.agents
        self.simulation.step(actions if self._has_actions else None)
        self._locate()
        steering = np.ascontiguousarray(self.simulation.actions[:, 0]) if self._has_actions else np.zeros(len(acting))
        if self.agents is acting:
            self._score(steering)
            return
        # Agents that appeared in this step are scored too, but earn nothing: they act from the next step on.
        before, row = self._contacts_before, (self.simulation.batch.max_objects, 1)
        place = np.searchsorted(self.agents @ row, acting @ row)
        is_new = np.ones(len(self.agents), np.bool_)
        is_new[place] = False
        self._allocate()
        self._contacts_before[place] = before
        padded = np.zeros(len(self.agents))
        padded[place] = steering
        self._score(padded)
        self.terms[is_new], self.status[is_new] = 0.0, DRIVING

    def retire(self, agents: Array) -> None:
        """Remove agents (indices into ``agents``) from their worlds."""
        self.simulation.retire(self.agents[agents])
        self._locate()
        self._allocate()

    def observe(self, rng: np.random.Generator, rows: Array | None = None) -> Any:
        """Return new arrays with the observations of the agents, or of some (indices into ``agents``)."""
        state, agents = self.simulation.state, self.agents if rows is None else self.agents[rows]
        if not self._has_actions:  # the policy's own location on the path may differ
            state = State(state.motion, self.route, *state.moment[2:], history=state.history)
        return self._observation.of(self.simulation.batch, state, agents, rng)

    def infos(self) -> list[dict[str, Any]]:
        """Return ``NUMBERS``, ``ENDS``, timestep and scenario id of each agent."""
        numbers, status = self.numbers.tolist(), self.status.tolist()
        timestep, worlds = self.simulation.state.timestep.tolist(), self.simulation.batch.worlds
        return [
            dict(zip(NUMBERS, numbers[a], strict=True))
            | {name: status[a] == code for name, code in ENDS.items()}
            | {"timestep": timestep[w], "scenario_id": worlds[w].scenario_id}
            for a, w in enumerate(self.agents[:, 0].tolist())
        ]

    def close(self) -> None:
        """Release the resources of the backend."""
        self.simulation.close()

    def _resize(self) -> None:
        """Grow to the simulation's number of objects."""
        more = self.simulation.batch.max_objects - self._totals.shape[1]
        if more > 0:
            self._totals = np.pad(self._totals, ((0, 0), (0, more), (0, 0)))
            if not self._has_actions:
                self.route = np.pad(self.route, ((0, 0), (0, more), (0, 0)), constant_values=np.nan)
                self._route_before = self.route.copy()
                self.contacts: Bool = np.zeros(self.route.shape[:2], np.bool_)

    def _locate(self, slot: int | None = None) -> None:
        """Update locations and contacts of the agents; ``slot`` begins an episode."""
        simulation = self.simulation
        if self._has_actions:  # the simulation has done it
            self.agents, self.contacts, self._hits = simulation.agents, simulation.contacts, simulation.hits
            self.route, self._route_before = simulation.state.route, simulation.previous.route
            return
        batch, state = simulation.batch, simulation.state
        if slot is not None:
            self.agents[slot] = slot, batch.ego[slot]
            self.route[slot] = np.nan
        self._route_before[...] = self.route
        follow_paths(
            self.agents, state.motion, batch.path, batch.path_offsets, LOOK_BACK, LOOK_AHEAD, self.route, False
        )
        boxes = state.motion, state.size, state.object_type, state.present
        find_contacts(self.agents, *boxes, self.contacts, self._hits)

    def _allocate(self) -> None:
        """Allocate results for the current agents, all zero."""
        self.numbers = np.zeros((len(self.agents), len(NUMBERS)))
        self.terms: Float64 = self.numbers[:, : len(TERMS)]
        self.status: UInt8 = np.zeros(len(self.agents), np.uint8)
        self._contacts_before = self.contacts.copy()

    def _score(self, steering: Float64) -> None:
        simulation, contacts = self.simulation, Contacts(self.contacts, self._contacts_before, self._hits)
        score_step(
            self.agents, steering, contacts, simulation.state.moment, self.route, self._route_before,
            simulation.batch.recorded, self._task, StepResult(self.numbers, self.status, self._totals),
        )  # fmt: skip
        self._contacts_before[...] = self.contacts
