"""The environment below Gymnasium's interfaces: worlds in lockstep with agents that observe and are scored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.compiled import unchecked
from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int32, IntP, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_sim.agents import places
from scenarionet_sim.environments.config import EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.kernels.scoring import NUM_TOTALS, NUMBERS, TERMS, StepResult, report_scores
from scenarionet_sim.kernels.step import OBSERVE, SCORE
from scenarionet_sim.observer import Observer
from scenarionet_sim.policies import External
from scenarionet_sim.simulation import Simulation
from scenarionet_sim.task.task import ARRIVED, DRIVING, OFF_ROUTE, TIMED_OUT, Status, task_parameters
from scenarionet_sim.worlds.world import World

ENDS = {"success": ARRIVED, "out_of_road": OFF_ROUTE, "timeout": TIMED_OUT}
"""How an episode ended, in the terms of the paper's metrics."""


INFOS = (*NUMBERS, *ENDS, "timestep", "scenario_id")
"""Names of what is known of an agent after a step."""

_ENDS_OF = {int(status): tuple(status == code for code in ENDS.values()) for status in Status}


@dataclass(frozen=True, eq=False)
class StepOutcome:
    """Result of a step for A agents, in arrays that later steps leave alone.

    Attributes:
        rewards: (A,) float64 sums of the terms.
        terminated: (A,) agents that arrived or left their route.
        truncated: (A,) agents whose time is over.
        numbers: (14, A) float64 values by ``NUMBERS``.
        ends: (3, A) bool by ``ENDS``.
        num_ended: Number of agents that are terminated or truncated.
    """

    rewards: Float64
    terminated: Bool
    truncated: Bool
    numbers: Float64
    ends: Bool
    num_ended: int


class BatchedEnvironment:
    """W worlds with their agents: objects of ``External``, or without such a policy the ego of every world.

    Args:
        config: Configuration.
        observation: Sensors of the agents.
        worlds: One per slot.
        threads: Largest number of threads.

    Attributes:
        simulation: The worlds.
        agents: (A, 2) int32 world and row of each agent, sorted.
        contacts: (A, N) bool objects that each agent's box overlaps.
        numbers: (A, 14) float64 results of the last step, in the order of ``NUMBERS``.
        terms: (A, 4) view of ``numbers``: weighted terms of the reward.
        status: (A,) uint8 codes of ``task.Status``.
    """

    def __init__(self, config: EnvConfig, observation: Observation, worlds: Sequence[World], threads: int = 1) -> None:
        self._scorer = _Scorer(task_parameters(config.reward, config.termination), observation)
        has_agents = any(isinstance(policy, External) for policy in config.policies)
        self.simulation = Simulation(
            worlds, config.policies, config.backend, max(getattr(sensor, "history", 0) for sensor in config.sensors),
            has_passengers=not has_agents, threads=threads, keep=config.cache_size, observer=self._scorer,
        )  # fmt: skip
        self._observation, self._has_actions = observation, has_agents

    def __repr__(self) -> str:
        return f"BatchedEnvironment({self.simulation!r})"

    @property
    def is_observing(self) -> bool:
        """Whether steps observe the agents; without, :meth:`observe` does."""
        return bool(self._scorer.phases & OBSERVE)

    @is_observing.setter
    def is_observing(self, is_observing: bool) -> None:
        self._scorer.phases = SCORE | OBSERVE if is_observing else SCORE

    @property
    def agents(self) -> Int32:
        """(A, 2) world and row of each agent, sorted."""
        return self.simulation.agents

    @property
    def contacts(self) -> Bool:
        """(A, N) objects that each agent's box overlaps."""
        return self.simulation.contacts

    @property
    def numbers(self) -> Float64:
        """(A, 14) results of the last step, in the order of ``NUMBERS``."""
        return self._scorer.result.numbers

    @property
    def terms(self) -> Float64:
        """(A, 4) weighted terms of the reward."""
        return self.numbers[:, : len(TERMS)]

    @property
    def status(self) -> UInt8:
        """(A,) codes of ``task.Status``."""
        return self._scorer.result.status

    def outcome(self) -> StepOutcome:
        """Return the result of the last step."""
        count = len(self.status)
        numbers, rewards = np.empty((len(NUMBERS), count)), np.empty(count)
        flags: Bool = np.empty((2 + len(ENDS), count), np.bool_)
        num_ended = unchecked(report_scores)(self._scorer.result, rewards, numbers, flags[:2], flags[2:])
        return StepOutcome(rewards, flags[0], flags[1], numbers, flags[2:], num_ended)

    @property
    def arc(self) -> Float64:
        """(A,) arc length of each agent on its route [m]."""
        arc: Float64 = self.simulation.route[self.agents[:, 0], self.agents[:, 1], 0]
        return arc

    def begin(self, slots: Sequence[int], worlds: Sequence[World], start: int | None = None) -> None:
        """Begin episodes in some slots; see :meth:`Simulation.reset`.

        Raises:
            BadParameter: The ego is not valid at timestep ``start``.
        """
        for world in worlds:
            if start is not None and not (0 <= start < world.num_steps and world.log_valid[start, world.ego]):
                (valid,) = np.nonzero(world.log_valid[:, world.ego])
                raise BadParameter(
                    f"{world.scenario_id}: the ego is not valid at timestep {start}; choose {valid[0]} to {valid[-1]}"
                )
        self.simulation.reset_slots(slots, worlds, start)

    def begin_in_step(self, slots: Sequence[int], worlds: Sequence[World]) -> None:
        """Begin episodes in some slots in the next step, which their worlds sit out."""
        self.simulation.begin(slots, worlds)

    def step(self, actions: npt.ArrayLike) -> None:
        """Advance every world by one timestep, score and observe the agents.

        Args:
            actions: (A, 2) steering and throttle; ignored without an ``External`` policy.

        Raises:
            BadParameter: The number of actions differs from that of agents, or one is NaN.
        """
        acting = self.agents
        self.simulation.step(actions if self._has_actions else None)
        if self.agents is not acting:
            # Agents that appeared in this step earn nothing: they act from the next step on.
            is_new = places(self.agents, acting) < 0
            self.terms[is_new], self.status[is_new] = 0.0, DRIVING

    def retire(self, agents: Array) -> None:
        """Remove agents (indices into ``agents``) from their worlds."""
        self.simulation.retire(self.agents[agents])

    def observe(self, rng: np.random.Generator, slots: IntP | None = None) -> Any:
        """Return the observations of the agents, in arrays that the next step overwrites.

        Args:
            rng: Source of the sensors' noise.
            slots: Worlds whose agents were observed already and lack the sensors outside of the compiled step, if only
                these are needed; None for all.
        """
        simulation, observed = self.simulation, self._scorer.observed
        if slots is None:
            simulation.observe()
        if self._observation.is_compiled:
            return observed
        state, rows = simulation.state, None if slots is None else simulation.agents_of(slots)
        if not self._has_actions:  # the policy's own location on the path may differ
            state = replace(state, route=simulation.route)
        self._observation.complete(observed, simulation.batch, state, self.agents, rng, rows)
        return observed

    def infos(self) -> list[dict[str, Any]]:
        """Return ``NUMBERS``, ``ENDS``, timestep and scenario id of each agent."""
        timestep, worlds = self.simulation.state.timestep.tolist(), self.simulation.batch.worlds
        of_agents = self.numbers.tolist(), self.status.tolist(), self.agents[:, 0].tolist()
        return [
            dict(zip(INFOS, (*numbers, *_ENDS_OF[status], timestep[w], worlds[w].scenario_id), strict=True))
            for numbers, status, w in zip(*of_agents, strict=True)
        ]

    def close(self) -> None:
        """Release the resources of the backend."""
        self.simulation.close()


class _Scorer(Observer):
    """Scores agents by the task and observes them by their sensors, in arrays that steps overwrite.

    Args:
        task: See ``Observer``.
        observation: The sensors.
    """

    def __init__(self, task: Float64, observation: Observation) -> None:
        self._observation = observation
        self.observed, sensing = observation.allocate(0)
        super().__init__(task, Observer.nothing().result, sensing, SCORE | OBSERVE)

    def resize(self, num_agents: int, num_worlds: int, num_objects: int) -> None:
        """Allocate results for other agents, all zero; totals of objects are kept."""
        totals = old = self.result.totals
        if old.shape[:2] != (num_worlds, num_objects):
            totals = np.zeros((num_worlds, num_objects, NUM_TOTALS))
            totals[: old.shape[0], : old.shape[1]] = old
        self.result = StepResult(np.zeros((num_agents, len(NUMBERS))), np.zeros(num_agents, np.uint8), totals)
        self.observed, self.sensing = self._observation.allocate(num_agents)
