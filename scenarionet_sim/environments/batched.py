"""What every environment has inside: worlds that run in step, whose agents observe, are judged and counted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int32, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_sim.environments.config import EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.policies import External
from scenarionet_sim.simulation import Simulation
from scenarionet_sim.task import episode_stats, task
from scenarionet_sim.task.evaluated import Agents, Egos
from scenarionet_sim.worlds.world import World

NUMBERS = (*task.TERMS, "route_completion", "lateral", *episode_stats.COLUMNS)
"""What ``BatchedEnvironment.numbers`` says about an agent."""

ENDS = {"success": task.ARRIVED, "out_of_road": task.OFF_ROUTE, "timeout": task.TIMED_OUT}
"""How an episode ended, in the words of the paper's metrics."""


class BatchedEnvironment:
    """W worlds with their agents.

    Args:
        config: What everything is made of.
        observation: How agents observe.
        worlds: One for each slot.

    Attributes:
        simulation: The worlds.
        terms: (A, 4) float64 weighted terms of the reward of the last step, in the order of ``task.TERMS``; zero
            for an agent that only appeared in it.
        status: (A,) uint8 codes of ``task.Status``.
        numbers: (A, 14) float64, in the order of ``NUMBERS``.
    """

    def __init__(self, config: EnvConfig, observation: Observation, worlds: Sequence[World]) -> None:
        self._config, self._observation = config, observation
        history = max(getattr(sensor, "history", 0) for sensor in config.sensors)
        self.simulation = Simulation(worlds, config.policies, config.backend, history)
        self._is_driven = any(isinstance(policy, External) for policy in config.policies)
        self._watched = Agents(self.simulation) if self._is_driven else Egos(self.simulation)
        self._tally = episode_stats.Tally.of(len(worlds), self.simulation.batch.max_objects)
        self.numbers: Float64
        self._make_room()

    @property
    def agents(self) -> Int32:
        """(A, 2) world and row of each agent that is judged, in that order."""
        return self._watched.rows

    @property
    def terms(self) -> Float64:
        """(A, 4)."""
        return self._verdict.terms

    @property
    def status(self) -> UInt8:
        """(A,)."""
        return self._verdict.status

    @property
    def rewards(self) -> Float64:
        """(A,) the terms' sums."""
        return np.asarray(self.terms.sum(axis=1))

    @property
    def terminated(self) -> Bool:
        """(A,) whose episode came to an end of its own."""
        return np.asarray((self.status != task.DRIVING) & (self.status != task.TIMED_OUT))

    @property
    def truncated(self) -> Bool:
        """(A,) whose time is over."""
        return np.asarray(self.status == task.TIMED_OUT)

    @property
    def contacts(self) -> Bool:
        """(A, N) what each agent's box overlaps."""
        return self._watched.contacts

    @property
    def arc(self) -> Float64:
        """(A,) how far along its route each agent is [m]."""
        arc: Float64 = self._watched.state.arc[self.agents[:, 0], self.agents[:, 1]]
        return arc

    def begin(self, slot: int, world: World, start: int | None = None) -> None:
        """Begin an episode in a slot; see :meth:`Simulation.reset`.

        Raises:
            BadParameter: The ego is not there at the timestep ``start``.
        """
        if start is not None and not (0 <= start < world.num_steps and world.log_valid[start, world.ego]):
            (there,) = np.nonzero(world.log_valid[:, world.ego])
            raise BadParameter(
                f"{world.scenario_id}: its ego is not there at timestep {start}; there are {there[0]} to {there[-1]}"
            )
        self.simulation.reset(slot, world, start)
        self._watched.begin(slot)
        self._tally.begin(slot, self.simulation.batch.max_objects)
        if len(self.agents) != len(self.numbers):
            self._make_room()
        self._touched = self._watched.contacts.copy()
        for array in (self.terms, self.status, self.numbers):
            array[self.agents[:, 0] == slot] = 0

    def can_play(self, world: World) -> bool:
        """Whether a world has the timestep of those that are played."""
        return abs(world.dt - self.simulation.dt) < 1e-3

    def step(self, actions: npt.ArrayLike) -> None:
        """Advance every world by one timestep and judge the agents.

        Args:
            actions: (A, 2) steering and throttle, of no effect where a policy drives.

        Raises:
            BadParameter: One is not a number, or there are more or fewer than agents.
        """
        acting = self.agents
        if self._is_driven:
            self.simulation.step(actions)
            steering = np.ascontiguousarray(self.simulation.actions[:, 0])
        else:
            self.simulation.step()
            steering = np.zeros(len(acting))
        self._watched.look()
        if self.agents is acting:
            self._judge(steering)
        else:
            self._judge_newcomers_too(acting, steering)

    def retire(self, agents: Array) -> None:
        """Take agents (by their place in ``agents``) out of their worlds."""
        self.simulation.retire(self.agents[agents])
        self._make_room()

    def observe(self, rng: np.random.Generator, rows: Array | None = None) -> Any:
        """What the agents (some of them, by their place in ``agents``) observe, in arrays of their own."""
        agents = self.agents if rows is None else self.agents[rows]
        return self._observation.of(self.simulation.batch, self._watched.state, agents, rng)

    def infos(self) -> list[dict[str, Any]]:
        """What there is to know about each agent: ``NUMBERS``, ``ENDS``, and where in which log it is."""
        numbers, status = self.numbers.tolist(), self.status.tolist()
        timestep, worlds = self.simulation.state.timestep.tolist(), self.simulation.batch.worlds
        return [
            dict(zip(NUMBERS, numbers[a], strict=True))
            | {name: status[a] == code for name, code in ENDS.items()}
            | {"timestep": timestep[w], "scenario_id": worlds[w].scenario_id}
            for a, w in enumerate(self.agents[:, 0].tolist())
        ]

    def close(self) -> None:
        """Give back what the backend holds."""
        self.simulation.close()

    def _make_room(self) -> None:
        """Arrays for as many agents as there are, all zero."""
        count = len(self.agents)
        self._touched = self._watched.contacts.copy()
        self._verdict = task.Verdict.of(count)
        self._board = np.zeros((count, len(episode_stats.COLUMNS)))
        self.numbers = np.zeros((count, len(NUMBERS)))

    def _judge_newcomers_too(self, acting: Int32, steering: Float64) -> None:
        """Judge more agents than acted; those who act for the first time with the next step have earned nothing."""
        touched, objects = self._touched, self.simulation.batch.max_objects
        place = np.searchsorted(self.agents @ (objects, 1), acting @ (objects, 1))
        self._make_room()
        self._touched[place] = touched
        turned = np.zeros(len(self.agents))
        turned[place] = steering
        self._judge(turned)
        is_new = np.ones(len(self.agents), np.bool_)
        is_new[place] = False
        self.terms[is_new] = self.numbers[is_new, : len(task.TERMS)] = 0.0
        self.status[is_new] = task.DRIVING

    def _judge(self, steering: Float64) -> None:
        batch, state, watched, agents = self.simulation.batch, self._watched.state, self._watched, self.agents
        task.judge(
            agents, state.arc, watched.arc_before, state.lateral, state.velocity, batch.path_arc, batch.path_offsets,
            state.timestep, batch.num_steps, steering, watched.hits, self._config.reward.numbers,
            self._config.termination.numbers, self.terms, self.status, self._verdict.completion,
        )  # fmt: skip
        episode_stats.count(
            agents, state.position, state.velocity, state.object_type, state.timestep, batch.num_steps, batch.log,
            watched.contacts, self._touched, self._tally.crashes, self._tally.sums, self._board,
        )  # fmt: skip
        self._touched[...] = watched.contacts
        parts = (
            self.terms,
            self._verdict.completion[:, None],
            state.lateral[agents[:, 0], agents[:, 1], None],
            self._board,
        )
        np.concatenate(parts, axis=1, out=self.numbers)
