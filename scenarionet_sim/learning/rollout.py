"""The experience of one round: T steps of A rows, with a mask of the rows that had an agent."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64
from scenarionet_sim.learning.rows import AgentRows


@dataclass(eq=False)
class RolloutBuffer:
    """Experience of A rows in T steps; rows without an agent are False in ``alive`` and undefined elsewhere.

    Attributes:
        observations: (T + 1, A, D) float32, the last ones after the last step.
        actions: (T, A, 2) float32.
        log_probabilities: (T, A) float32 of the actions.
        rewards: (T, A, K) float32 of K kinds.
        alive: (T, A) bool.
        ends: (T, A) bool episodes that ended with this step.
        last: (step, rows, observations) of the episodes that ended.
        is_late: For each entry of ``last`` whether the episodes were truncated, so that their values count.
    """

    observations: Tensor
    actions: Tensor
    log_probabilities: Tensor
    rewards: Float32
    alive: Bool
    ends: Bool
    last: list[tuple[int, np.ndarray, Tensor]] = field(default_factory=list)
    is_late: list[Bool] = field(default_factory=list)

    @classmethod
    def empty(cls, steps: int, agents: int, width: int, kinds: int) -> RolloutBuffer:
        """Return arrays for T = ``steps``, A = ``agents``, D = ``width`` and K = ``kinds``."""
        here = steps, agents
        return cls(
            torch.zeros(steps + 1, agents, width),
            torch.zeros(*here, 2),
            torch.zeros(here),
            np.zeros((*here, kinds), np.float32),
            np.zeros(here, np.bool_),
            np.zeros(here, np.bool_),
        )

    @property
    def num_bytes(self) -> int:
        """Memory of the arrays."""
        tensors = self.observations, self.actions, self.log_probabilities
        arrays = self.rewards, self.alive, self.ends
        return int(sum(each.nbytes for each in tensors)) + sum(each.nbytes for each in arrays)

    def begin(self) -> None:
        """Forget the ends of the round before."""
        self.last.clear()
        self.is_late.clear()

    def end_step(self, step: int, env: AgentRows) -> None:
        """Note which episodes ended with a step."""
        self.ends[step] = env.terminals | env.truncations
        rows = np.flatnonzero(self.ends[step])
        if len(rows):
            self.last.append((step, rows, torch.from_numpy(env.last_observations[rows])))
            self.is_late.append(env.truncations[rows])

    def next_observations(self) -> Tensor:
        """Return (T, A, D) the observations after each step; of an episode that ended, its last one."""
        after = self.observations[1:].clone()
        for step, rows, seen in self.last:
            after[step, rows] = seen
        return after

    def rows(self) -> Tensor:
        """Return the (N,) indices of the agents' steps in arrays whose first two axes are merged."""
        return torch.from_numpy(np.flatnonzero(self.alive))


def advantages(
    rewards: Float32, values: Float32, last_values: Float32, ends: Bool, gamma: float, smoothing: float
) -> Float32:
    """Return generalized advantage estimates (Schulman et al. 2016), from the last step to the first.

    Args:
        rewards: (T, A).
        values: (T + 1, A) of the observations.
        last_values: (T, A) values of the last observations where an episode was truncated, otherwise 0.
        ends: (T, A) bool.
        gamma: Discount.
        smoothing: Lambda.

    Returns:
        (T, A); undefined at rows without an agent.
    """
    after = np.where(ends, last_values, values[1:])
    surprise = rewards + np.float32(gamma) * after - values[:-1]
    decay = np.where(ends, np.float32(0.0), np.float32(gamma * smoothing))
    found: Float32 = np.empty(surprise.shape, np.float32)
    later = np.zeros_like(surprise[0])
    for step in reversed(range(len(rewards))):  # a recursion
        later = surprise[step] + decay[step] * later
        found[step] = later
    return found


def neighbour_rewards(rewards: Float32, positions: Float64, worlds: np.ndarray, alive: Bool, radius: float) -> Float32:
    """Return the mean reward of the agents within a radius of each agent, itself not included; 0 for none.

    Args:
        rewards: (A,).
        positions: (A, 2) [m], before the step.
        worlds: (A,) world of each row; agents of other worlds are no neighbours.
        alive: (A,) rows with an agent.
        radius: [m].
    """
    found = np.zeros_like(rewards)
    for world in np.unique(worlds[alive]).tolist():
        rows = np.flatnonzero(alive & (worlds == world))
        apart = np.hypot(*(positions[rows, None] - positions[None, rows]).transpose(2, 0, 1))
        is_near = (apart <= radius) & ~np.eye(len(rows), dtype=np.bool_)
        found[rows] = (is_near @ rewards[rows]) / np.maximum(is_near.sum(axis=1), 1)
    return found
