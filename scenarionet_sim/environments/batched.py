"""The environment below Gymnasium's interfaces: worlds in lockstep with agents that observe and are scored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import repeat
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int32, IntP, UInt8
from scenarionet_data.errors import BadParameter
from scenarionet_sim.environments.config import EnvConfig
from scenarionet_sim.environments.observation import Observation
from scenarionet_sim.environments.outputs import RESULTS, StepOutput, StepOutputs
from scenarionet_sim.policies.external import External
from scenarionet_sim.simulation.agents import DrivenAgents
from scenarionet_sim.simulation.observer import Observer
from scenarionet_sim.simulation.seats import Seats
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.simulation.step import OBSERVE, SCORE, SETTLE
from scenarionet_sim.task.scoring_kernels import HAS_ARRIVED, NUM_TOTALS, StepResult
from scenarionet_sim.task.task import task_parameters
from scenarionet_sim.worlds.world import World

INFOS = (*RESULTS, "scenario_id")
"""Names of what is known of an agent after a step."""


class BatchedEnvironment:
    """W worlds with their agents: objects of ``External``, or without such a policy the ego of every world.

    Args:
        config: Configuration.
        observation: Sensors of the agents.
        worlds: One per slot.
        threads: Largest number of threads.
        seats: Flat buffers to write the results to; None for new arrays in every step.

    Attributes:
        simulation: The worlds.
        agents: (A, 2) int32 world and row of each agent, sorted.
        contacts: (A, N) bool objects that each agent's box overlaps.
        numbers: (A, 14) float64 results of the last step, in the order of ``NUMBERS``.
        rewards: (A,) float64 sums of their terms.
        status: (A,) uint8 codes of ``task.Status``.
    """

    def __init__(
        self,
        config: EnvConfig,
        observation: Observation,
        worlds: Sequence[World],
        threads: int = 1,
        seats: Seats | None = None,
    ) -> None:
        task = task_parameters(config.reward, config.termination, config.dt)
        self._scorer = _Scorer(task, observation, len(worlds), seats)
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
    def result(self) -> StepResult:
        """Result of the last step by place, see ``agents.DrivenAgents``."""
        return self._scorer.result

    @property
    def named_result(self) -> dict[str, Array]:
        """(C,) results of the last step by place, by ``INFOS`` except the scenario id."""
        return self._scorer.named

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
        return self.result.numbers[:, self.simulation.by_place.places].T

    @property
    def rewards(self) -> Float64:
        """(A,) sums of the terms of the reward."""
        return self.result.rewards[self.simulation.by_place.places]

    @property
    def status(self) -> UInt8:
        """(A,) codes of ``task.Status``."""
        return self.result.status[self.simulation.by_place.places]

    @property
    def arc(self) -> Float64:
        """(A,) arc length of each agent on its route [m]."""
        arc: Float64 = self.simulation.route[self.agents[:, 0], self.agents[:, 1], 0]
        return arc

    def begin(
        self,
        slots: Sequence[int] | IntP,
        worlds: Sequence[World],
        start: int | None = None,
        *,
        is_observed: bool = True,
    ) -> None:
        """Begin episodes in some slots; see :meth:`Simulation.reset`.

        Args:
            slots: The slots.
            worlds: Their worlds.
            start: First timestep of the logs.
            is_observed: Observe the agents there; otherwise ``simulation.observe_begun`` has to come next.

        Raises:
            BadParameter: The ego is not valid at timestep ``start``.
        """
        for world in worlds:
            if start is not None and not (0 <= start < world.num_steps and world.log_valid[start, world.ego]):
                (valid,) = np.nonzero(world.log_valid[:, world.ego])
                raise BadParameter(
                    f"{world.scenario_id}: the ego is not valid at timestep {start}; choose {valid[0]} to {valid[-1]}"
                )
        self.simulation.begin(slots, worlds, start)
        if is_observed:
            self.simulation.observe_begun()

    def step(self, actions: npt.ArrayLike) -> None:
        """Advance every world by one timestep, score and observe the agents.

        Args:
            actions: (A, 2) steering and throttle; ignored without an ``External`` policy.

        Raises:
            BadParameter: The number of actions differs from that of agents, or one is not finite.
        """
        self.simulation.step(actions if self._has_actions else None)

    def step_by_place(self, actions: npt.ArrayLike, num_given: int = 1) -> None:
        """Step, with actions by place; see :meth:`Simulation.step_by_place`."""
        if self._has_actions:
            self.simulation.step_by_place(actions, num_given)
        else:
            self.simulation.step()

    def retire(self, agents: Array) -> None:
        """Remove agents (indices into ``agents``) from their worlds."""
        self.simulation.retire(self.agents[agents])

    def observe(self, rng: np.random.Generator, slots: IntP | None = None) -> Any:
        """Return the observations of the agents (A, ...).

        Args:
            rng: Source of the sensors' noise.
            slots: See :meth:`observe_by_place`.
        """
        return self._observation.take(self.observe_by_place(rng, slots), self.simulation.by_place.places)

    def observe_by_place(self, rng: np.random.Generator, slots: IntP | None = None) -> Any:
        """Return the observations of the agents by place, undefined at free ones.

        Args:
            rng: Source of the sensors' noise.
            slots: Worlds whose agents were observed already and lack the sensors outside of the compiled step, if only
                these are needed; None for all.
        """
        simulation = self.simulation
        if slots is None and self._scorer.is_stale:
            simulation.observe()
        observed = self._scorer.observed
        if self._observation.is_compiled:
            return observed
        state, agents, rows = simulation.state, simulation.agents, self._scorer.rows_of(simulation.by_place)
        is_needed = rows >= 0 if slots is None else (rows >= 0) & np.isin(agents[:, 0], slots)
        if not self._has_actions:  # the policy's own location on the path may differ
            state = replace(state, route=simulation.route)
        self._observation.complete(observed, simulation.batch, state, agents[is_needed], rng, rows[is_needed])
        return observed

    def infos(self) -> list[dict[str, Any]]:
        """Return ``NUMBERS``, ``ENDS``, timestep and scenario id of each agent."""
        result, at, worlds = self.result, self.simulation.by_place.places, self.simulation.batch.worlds
        ids = [worlds[w].scenario_id for w in self.agents[:, 0].tolist()]
        numbers, ends = result.numbers[:, at].tolist(), result.flags[HAS_ARRIVED:, at].tolist()
        of_agents = zip(*numbers, *ends, result.timestep[at].tolist(), ids, strict=True)
        return list(map(dict, map(zip, repeat(INFOS), of_agents)))

    def close(self) -> None:
        """Release the resources of the backend."""
        self.simulation.close()


class _Scorer(Observer):
    """Scores agents by the task and observes them by their sensors.

    Args:
        task: See ``Observer``.
        observation: The sensors.
        num_worlds: W.
        seats: Flat buffers to write to; None for new arrays in every step.
    """

    def __init__(self, task: Float64, observation: Observation, num_worlds: int, seats: Seats | None) -> None:
        self._observation, nothing = observation, Observer.nothing(num_worlds)
        self._outputs = StepOutputs(observation, 0)
        output = self._outputs.next()
        super().__init__(
            task, nothing.totals, output.result, output.sensing, SCORE | OBSERVE, seats or nothing.seats
        )  # fmt: skip
        self.observed, self.named = output.observed, output.named
        if seats is not None:
            self.num_seats = len(seats.masks) // num_worlds
            self.observed, self.sensing = seats.observations, observation.writing(seats.observations.reshape(-1))
            self.phases |= SETTLE if observation.is_compiled else 0

    def resize(self, num_places: int, num_worlds: int, num_objects: int) -> None:
        """Make room for results; totals of objects are kept, and the rest of agents at the same places."""
        if self.totals.shape[:2] != (num_worlds, num_objects):
            old, self.totals = self.totals, np.zeros((num_worlds, num_objects, NUM_TOTALS))
            self.totals[: old.shape[0], : old.shape[1]] = old
        if num_places == len(self.result.status):
            return
        self._outputs, self.is_stale = StepOutputs(self._observation, num_places), True
        self._write_to(self._outputs.next())
        for values in self.result:
            values[:] = 0

    def renew_results(self) -> None:
        if self.num_seats is None:
            self._write_to(self._outputs.next())

    def copy_results(self) -> None:
        if self.num_seats is None:
            last, seen = self.result, self.observed
            self.renew_results()
            results: tuple[Array, ...] = self.result
            for values, old in zip(results, last, strict=True):
                values[:] = old
            self._observation.write(seen, self.observed)

    def _write_to(self, output: StepOutput) -> None:
        self.result, self.named = output.result, output.named
        if self.num_seats is None:
            self.observed, self.sensing = output.observed, output.sensing

    def rows_of(self, agents: DrivenAgents) -> IntP:
        """Return where agents (A,) are observed; -1 for those without a seat."""
        if self.num_seats is None:
            return agents.places
        world, place = np.divmod(agents.places, agents.row_at.shape[1])
        return np.where(place < self.num_seats, world * self.num_seats + place, -1)
