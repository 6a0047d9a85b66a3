"""One episode as arrays: trajectories of all objects, contacts of the evaluated vehicle, and the outcome."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int64, IntP
from scenarionet_sim.arrays.log import HEADING, VX, VY
from scenarionet_sim.environments.batched import BatchedEnvironment
from scenarionet_sim.environments.outputs import ENDS
from scenarionet_sim.simulation.recording import EpisodeArrays, record_moments
from scenarionet_sim.task.task import DRIVING
from scenarionet_sim.worlds.world import World

_ENDS = {code: name for name, code in ENDS.items()}
_MOMENTS = 512
"""Moments of an episode that a recorder has room for at first; those that are not written take no memory."""


@dataclass(frozen=True, eq=False)
class Rollout:
    """An episode of T moments, the first before any step, with the N objects of the world.

    Attributes:
        scenario_id: The scenario.
        start: Timestep of the log at the first moment.
        dt: Seconds between moments.
        agent: Row of the evaluated vehicle.
        end: ``success``, ``out_of_road``, ``timeout``, or ``unfinished`` if the episode is over before.
        end_step: Step in which that was decided; None if unfinished.
        num_scored: Number of steps that metrics look at; the steps after them only decide the outcome.
        completion: Completed share of the route, 0 to 1.
        progress: (T,) distance along the route since the first moment [m].
        position: (T, N, 2) float64 [m].
        heading: (T, N) float64 [rad].
        velocity: (T, N, 2) float64 [m/s].
        present: (T, N) bool.
        contacts: (T, N) bool objects that the agent's box overlaps.
    """

    scenario_id: str
    start: int
    dt: float
    agent: int
    end: str
    end_step: int | None
    num_scored: int
    completion: float
    progress: Float64
    position: Float64
    heading: Float64
    velocity: Float64
    present: Bool
    contacts: Bool

    @property
    def num_steps(self) -> int:
        """Number of steps, T - 1."""
        return len(self.position) - 1

    def scored(self) -> Rollout:
        """The part that metrics look at, without the moments after the agent has left at the end of its path."""
        seen = np.flatnonzero(self.present[: self.num_scored + 1, self.agent])
        part = slice(0, int(seen[-1]) + 1 if len(seen) else 0)
        names = "progress", "position", "heading", "velocity", "present", "contacts"
        return replace(self, **{name: getattr(self, name)[part] for name in names})


class RolloutRecorder:
    """Records the episodes in the slots of an environment with one agent per world.

    Args:
        core: The environment.
    """

    def __init__(self, core: BatchedEnvironment) -> None:
        self._core = core
        self._worlds = list(core.simulation.batch.worlds)
        count, objects = len(self._worlds), core.simulation.batch.max_objects
        self._start: Int64 = np.zeros(count, np.int64)
        self._episodes = EpisodeArrays.of(count, _MOMENTS, objects)

    def begin(self, slot: int, world: World, num_scored: int | None = None, *, waits: bool = True) -> None:
        """Prepare to record an episode that has just begun; its first moment is the next that is added.

        Args:
            slot: The slot.
            world: What it plays.
            num_scored: Steps that metrics look at; None for all until the ego's last recorded state.
            waits: Whether the episode goes on until its outcome is decided.
        """
        self._worlds[slot], self._start[slot] = world, self._core.simulation.state.timestep[slot]
        if num_scored is None:
            num_scored = int(np.flatnonzero(world.log_valid[:, world.ego])[-1] - self._start[slot])
        self._episodes.num_scored[slot], self._episodes.waits[slot] = num_scored, waits
        self._episodes.last[slot], self._episodes.status[slot] = -1, DRIVING

    def play(self) -> None:
        """Record the episodes of all slots to their ends, as far as there is room, if policies drive every object."""
        self._make_room(int(self._episodes.last.max()) + 2)
        self._core.simulation.play(self._episodes)

    def add(self, slots: IntP) -> None:
        """Record the current moment of some slots (K,), in order."""
        core, simulation, agents = self._core, self._core.simulation, self._core.simulation.by_place
        self._make_room(int(self._episodes.last[slots].max()) + 2)
        record_moments(
            slots, simulation.batch.place, simulation.state.moment, simulation.route, agents.contacts, core.result,
            self._episodes,
        )  # fmt: skip

    @property
    def is_over(self) -> Bool:
        """(W,) slots that have all steps that are scored, and their outcome if they wait for it."""
        return self._episodes.is_over

    def rollout(self, slot: int) -> Rollout:
        """Return the episode of a slot as recorded so far."""
        world, episodes, status = self._worlds[slot], self._episodes, int(self._episodes.status[slot])
        part = np.s_[slot, : episodes.last[slot] + 1, : world.num_objects]
        motion, arc = episodes.motion[part], episodes.arc[part[:2]]
        return Rollout(
            scenario_id=world.scenario_id,
            start=int(self._start[slot]),
            dt=world.dt,
            agent=world.ego,
            end=_ENDS.get(status, "unfinished"),
            end_step=None if status == DRIVING else int(episodes.end_step[slot]),
            num_scored=int(episodes.num_scored[slot]),
            completion=float(episodes.completion[slot]),
            progress=arc - arc[0],
            position=motion[..., :2].copy(),
            heading=motion[..., HEADING].copy(),
            velocity=motion[..., VX : VY + 1].copy(),
            present=episodes.present[part].copy(),
            contacts=episodes.contacts[part].copy(),
        )

    def _make_room(self, num_moments: int) -> None:
        """Make room for twice as many moments, and for the largest world."""
        episodes = self._episodes
        count, moments, objects = episodes.present.shape
        wanted = 2 * moments if num_moments > moments else moments, self._core.simulation.batch.max_objects
        if wanted == (moments, objects):
            return
        used = np.s_[:, : min(int(episodes.last.max()) + 1, moments), :objects]

        def larger(values: Array) -> Array:  # pages that were never written to take no memory
            grown = np.empty((count, *wanted[: values.ndim - 1], *values.shape[3:]), values.dtype)
            grown[used[: values.ndim]] = values[used[: values.ndim]]
            return grown

        names = "motion", "present", "contacts", "arc"
        self._episodes = episodes._replace(**{name: larger(getattr(episodes, name)) for name in names})
