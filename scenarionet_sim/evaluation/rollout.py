"""One episode as arrays: trajectories of all objects, contacts of the evaluated vehicle, and the outcome."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64
from scenarionet_sim.environments.batched import ENDS, BatchedEnvironment
from scenarionet_sim.kernels.log import HEADING, VX, VY
from scenarionet_sim.kernels.scoring import NUMBERS
from scenarionet_sim.task.task import DRIVING
from scenarionet_sim.worlds.world import World

_ENDS = {code: name for name, code in ENDS.items()}
_COMPLETION = NUMBERS.index("route_completion")
_MOMENTS = 256
"""Moments that a recorder has room for at first."""


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
    """Records the episode of a slot.

    Args:
        world: The scenario.
        slot: The slot that plays it.
        core: Environment in which the episode has just begun.
        num_scored: Steps that metrics look at; None for all until the ego's last recorded state.

    Attributes:
        num_scored: As above.
        num_steps: Number of recorded steps.
        is_decided: Whether the outcome is known.
    """

    def __init__(self, world: World, slot: int, core: BatchedEnvironment, num_scored: int | None = None) -> None:
        self._world, self._slot = world, slot
        self._start = int(core.simulation.state.timestep[slot])
        last = int(np.flatnonzero(world.log_valid[:, world.ego])[-1])
        self.num_scored = last - self._start if num_scored is None else num_scored
        self.num_steps = -1
        self._status, self._end_step, self._completion = DRIVING, 0, 0.0
        count = world.num_objects
        self._motion, self._arc = np.empty((_MOMENTS, count, 7)), np.empty(_MOMENTS)
        self._present, self._contacts = np.empty((2, _MOMENTS, count), np.bool_)

    @property
    def is_decided(self) -> bool:
        """Whether the outcome is known."""
        return self._status != DRIVING

    def add(self, core: BatchedEnvironment, agent: int) -> None:
        """Record the current moment.

        Args:
            core: The environment.
            agent: Index of the evaluated vehicle into ``core.agents``.
        """
        self.num_steps += 1
        moment, slot = self.num_steps, self._slot
        if moment == len(self._arc):
            self._grow()
        simulation, count = core.simulation, self._motion.shape[1]
        state, row = simulation.state, int(core.agents[agent, 1])
        self._motion[moment], self._present[moment] = state.motion[slot, :count], state.present[slot, :count]
        self._contacts[moment] = simulation.contacts[agent, :count]
        self._arc[moment] = simulation.route[slot, row, 0]
        self._completion = float(core.numbers[agent, _COMPLETION])
        if moment and not self.is_decided:
            self._status, self._end_step = int(core.status[agent]), moment

    def rollout(self) -> Rollout:
        """Return the episode as recorded so far."""
        so_far = slice(self.num_steps + 1)
        motion, arc = self._motion[so_far], self._arc[so_far]
        return Rollout(
            scenario_id=self._world.scenario_id,
            start=self._start,
            dt=self._world.dt,
            agent=self._world.ego,
            end=_ENDS.get(self._status, "unfinished"),
            end_step=self._end_step if self.is_decided else None,
            num_scored=self.num_scored,
            completion=self._completion,
            progress=arc - arc[0],
            position=motion[..., :2].copy(),
            heading=motion[..., HEADING].copy(),
            velocity=motion[..., VX : VY + 1].copy(),
            present=self._present[so_far],
            contacts=self._contacts[so_far],
        )

    def _grow(self) -> None:
        """Make room for twice as many moments."""

        def doubled(values: Array) -> Array:
            return np.concatenate([values, np.empty_like(values)])

        self._motion, self._arc = doubled(self._motion), doubled(self._arc)
        self._present, self._contacts = doubled(self._present), doubled(self._contacts)
