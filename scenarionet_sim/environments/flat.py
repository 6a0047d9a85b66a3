"""W worlds as flat buffers, for learners: one row per agent, overwritten by every step."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int64, IntP
from scenarionet_data.errors import BadParameter
from scenarionet_sim.arrays.structures import FIRST_STEP
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.config import EnvConfig
from scenarionet_sim.environments.episodes import Episodes, action_space
from scenarionet_sim.policies.external import External
from scenarionet_sim.simulation.seats import Seats, list_ends
from scenarionet_sim.threads.team import all_cores
from scenarionet_sim.worlds.world import World

_LOADED_AHEAD = 8
"""Scenarios to load ahead: many episodes tend to end in the same step."""


@dataclass(frozen=True, eq=False)
class FlatState:
    """Where a ``FlatEnv`` stands.

    Attributes:
        series: The series of scenarios and what each world plays, JSON-serialisable.
        ages: (W,) int64 steps since each world's episode began.
        actions: (L, num_agents, 2) actions of the last L steps, the largest of ``ages``.
        observations: (num_agents, D) float32.
    """

    series: dict[str, Any]
    ages: Int64
    actions: Array
    observations: Float32


class FlatEnv:
    """Environments in which each agent has a row of every buffer, in the shape of PufferLib's environments.

    World w has the rows ``w * seats`` to ``(w + 1) * seats``. An agent takes the first free row of its world when it
    appears, keeps it, and leaves it when its episode ends; ``masks`` says which rows have an agent. A world without
    agents begins the next scenario in the same step, so its rows show the first observations of new agents, and
    ``last_observations`` the last ones of those that ended. Scenarios that cannot be read are skipped. Agents beyond
    the number of seats drive straight on and never have a row: choose ``seats`` by the scenarios.

    Args:
        num_worlds: W.
        config: ``VectorConfig`` for one agent per world, ``MultiAgentConfig`` for several.
        seats: Largest number of agents of a world.
        seed: Seed of the series of scenarios; None for a random one.
        threads: Largest number of threads; 0 for all cores.
        keeps_past: Remember what ``state`` needs: the actions since the longest current episode began.

    Attributes:
        num_agents: W * seats.
        observations: (num_agents, D) float32; rows without an agent are zero.
        last_observations: (num_agents, D) float32, written at rows that are terminal or truncated in this step.
        rewards: (num_agents,) float32.
        terminals, truncations: (num_agents,) bool ends of this step: arrived or left the route; out of time.
        last_numbers: (num_agents, 14) float64 results in the order of ``NUMBERS``, written at the same rows as
            ``last_observations``.
        arrivals: (num_agents,) bool terminals of agents that arrived.
        masks: (num_agents,) bool rows with an agent that acts in the next step.

    Example:
        envs = FlatEnv(64, VectorConfig(Scenarios("lake"), policies=(Replay(), Idm(), External())))
        observations, infos = envs.reset(seed=0)
        observations, rewards, terminals, truncations, infos = envs.step(actions)  # the same arrays in every step
    """

    def __init__(
        self,
        num_worlds: int,
        config: EnvConfig,
        seats: int = 1,
        seed: int | None = None,
        threads: int = 0,
        *,
        keeps_past: bool = False,
    ) -> None:
        if num_worlds < 1 or seats < 1:
            raise BadParameter(f"num_worlds={num_worlds}, seats={seats}; expected at least 1 of each")
        if config.observation != "flat" or not any(isinstance(policy, External) for policy in config.policies):
            raise BadParameter("FlatEnv needs observation='flat' and agents, that is an External policy")
        self.num_worlds, self.seats, self.num_agents = num_worlds, seats, num_worlds * seats
        prefetch = min(config.prefetch * num_worlds, _LOADED_AHEAD)
        self._episodes = Episodes(config, seed, num_worlds, prefetch, threads or all_cores())
        self.single_observation_space: spaces.Space[Any] = self._episodes.observation.space
        self.single_action_space = action_space()
        (width,) = self.single_observation_space.shape or (0,)
        self._episodes.seats = seats_of = Seats.of(num_worlds, seats, width)
        self.observations, self.last_observations = seats_of.observations, seats_of.last_observations
        self.rewards, self.terminals, self.truncations = seats_of.rewards, seats_of.terminals, seats_of.truncations
        self.arrivals, self.masks, self.last_numbers = seats_of.arrivals, seats_of.masks, seats_of.last_numbers
        self._seats = seats_of
        self._over: Int64 = np.zeros(num_worlds, np.int64)
        self._ends: Int64 = np.zeros((3, num_worlds), np.int64)
        self._past: deque[Array] | None = deque() if keeps_past else None

    def reset(self, seed: int | None = None) -> tuple[Float32, list[dict[str, Any]]]:
        """Begin an episode in every world; a seed restarts the series of scenarios."""
        self._episodes.restart(seed)
        slots = np.arange(self.num_worlds)
        self._begin(slots, self._episodes.draw_all(slots, skips=True))
        self._clear_results()
        if self._past is not None:
            self._past.clear()
        return self.observations, []

    def step(self, actions: npt.ArrayLike) -> tuple[Float32, Float32, Bool, Bool, list[dict[str, Any]]]:
        """Drive for one timestep.

        Args:
            actions: (num_agents, 2) steering and throttle; those of rows without an agent are ignored.

        Returns:
            ``observations``, ``rewards``, ``terminals``, ``truncations``, and the info of each world whose episode
            ended: its slot, scenario id, number of agents and the share that arrived.

        Raises:
            ResetNeeded: No episode has begun.
            BadParameter: The actions have another shape, or that of an agent is not finite.
        """
        core = self._episodes.core
        if self._past is not None:
            given = np.array(actions)
            given[~self.masks] = 0.0
            self._past.append(given)
        self._advance(core, actions)
        infos = self._begin_next(core)
        while self._past and len(self._past) > self._ages().max():
            self._past.popleft()
        return self.observations, self.rewards, self.terminals, self.truncations, infos

    @property
    def positions(self) -> Float64:
        """(num_agents, 2) positions in the scenario's frame [m]; NaN at rows without an agent."""
        simulation, found = self._episodes.core.simulation, np.full((self.num_worlds, self.seats, 2), np.nan)
        rows = simulation.by_place.row_at[:, : self.seats]
        worlds, seats = np.nonzero((rows >= 0) & self.masks.reshape(-1, self.seats)[:, : rows.shape[1]])
        found[worlds, seats] = simulation.state.position[worlds, rows[worlds, seats]]
        return found.reshape(-1, 2)

    @property
    def level(self) -> int | None:
        """Level of the curriculum, from 0; None without one."""
        return self._episodes.level

    @property
    def coverage(self) -> float:
        """Share of the scenarios that were drawn so far."""
        return float(self._episodes.was_played.mean())

    @property
    def num_scenarios(self) -> int:
        """Number of scenarios of the series."""
        return len(self._episodes.ids)

    def scenario_id(self, row: int) -> str:
        """Return the scenario that a row's world plays."""
        return self._episodes.core.simulation.batch.worlds[row // self.seats].scenario_id

    def state(self) -> FlatState:
        """Return what the future depends on, for :meth:`restore`.

        Raises:
            BadParameter: The environment was made without ``keeps_past``.
        """
        if self._past is None:
            raise BadParameter("FlatEnv keeps no past; make it with keeps_past=True")
        shape = len(self._past), self.num_agents, 2
        return FlatState(
            self._episodes.state(), self._ages(), np.array(self._past).reshape(shape), self.observations.copy()
        )

    def restore(self, state: FlatState) -> None:
        """Continue where an environment of the same configuration stood: its current episodes are driven again.

        A simulation is deterministic, so the scenarios and the actions since their episodes began stand for the
        arrays of the simulation, whatever backend and policies these belong to.

        Raises:
            LakeError: A scenario cannot be read.
        """
        worlds = self._episodes.restore(state.series)
        core = self._begin(np.arange(self.num_worlds), worlds)
        longest = len(state.actions)
        for step, actions in enumerate([*state.actions, None]):
            if len(due := np.flatnonzero(state.ages == longest - step)):
                self._begin(due, [worlds[slot] for slot in due])
            self._seats.can_end[:] = state.ages >= longest - step
            if actions is not None:
                self._advance(core, actions)
        self._seats.can_end[:] = True
        self._clear_results()
        self.observations[:] = state.observations
        self._past = deque(state.actions)

    @property
    def skipped(self) -> dict[str, tuple[str, int]]:
        """Scenarios that could not be read and were skipped, by id: the reason, and how often they were drawn."""
        return self._episodes.skipped

    def close(self) -> None:
        """Stop the threads and the physics."""
        self._episodes.close()

    def _clear_results(self) -> None:
        self.rewards[:] = 0.0
        self.terminals[:] = self.truncations[:] = self.arrivals[:] = False

    def _begin(self, slots: IntP, worlds: list[World]) -> BatchedEnvironment:
        """Begin episodes in some slots; return the worlds."""
        core = self._episodes.begin(slots, worlds)
        core.observe_by_place(self._episodes.rng, slots)
        return core

    def _advance(self, core: BatchedEnvironment, given: npt.ArrayLike) -> None:
        """Drive for a timestep by actions (num_agents, 2)."""
        core.step_by_place(given, self.seats)
        if not self._episodes.observation.is_compiled:
            core.observe_by_place(self._episodes.rng)
            core.simulation.settle()

    def _begin_next(self, core: BatchedEnvironment) -> list[dict[str, Any]]:
        """Begin the next scenarios in worlds without agents; return the infos of the episodes that ended there."""
        episodes, seats, over = self._episodes, self._seats, self._over
        count = list_ends(seats.is_over, seats.ended, episodes.playing, over, self._ends)
        if not count:
            return []
        ids, slots = episodes.ids, over[:count]
        infos = [
            {"slot": slot, "scenario_id": ids[scenario], "agents": num_agents, "success": arrived / (num_agents or 1)}
            for slot, scenario, num_agents, arrived in zip(slots.tolist(), *self._ends[:, :count].tolist(), strict=True)
        ]
        if episodes.is_adaptive:
            for info in infos:
                episodes.report(info["slot"], info["success"])
        episodes.begin_next(slots, skips=True)
        if not episodes.observation.is_compiled:
            core.observe_by_place(episodes.rng, slots)
        return infos

    def _ages(self) -> Int64:
        """Return the steps (W,) since the episodes began."""
        simulation = self._episodes.core.simulation
        return simulation.state.timestep - simulation.batch.place[:, FIRST_STEP]
