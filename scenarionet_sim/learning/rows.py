"""What an algorithm learns in: rows of agents that come and go, as in ``FlatEnv``; and what their episodes achieve."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64
from scenarionet_data.errors import LakeError
from scenarionet_sim.task.scoring_kernels import NUMBERS

CRASHES = ("vehicle_crashes", "human_crashes", "object_crashes")
_CRASH_ROWS = [NUMBERS.index(name) for name in CRASHES]


class AgentRows(Protocol):
    """The part of ``FlatEnv`` that the algorithms need; attributes as there."""

    num_agents: int
    seats: int
    observations: Float32
    last_observations: Float32
    last_numbers: Float64
    rewards: Float32
    terminals: Bool
    truncations: Bool
    arrivals: Bool
    masks: Bool

    def step(self, actions: npt.ArrayLike) -> Any:
        """Drive for one timestep."""

    @property
    def positions(self) -> Float64:
        """(num_agents, 2) positions [m]."""

    def scenario_id(self, row: int) -> str:
        """Return the scenario that a row's world plays."""


class Outcomes:
    """Sums over the episodes of agents that have ended since the last :meth:`take`.

    Attributes:
        returns: (num_agents,) float64 rewards of the current episodes.
    """

    def __init__(self, num_agents: int) -> None:
        self.returns: Float64 = np.zeros(num_agents)
        self._clear()

    def add(self, env: AgentRows, counts: Bool | None = None) -> None:
        """Count a step.

        Args:
            env: The rows after the step.
            counts: (num_agents,) rows whose ends count; None for all.

        Raises:
            LakeError: A reward is not a number.
        """
        if not np.isfinite(env.rewards).all():
            row = int(np.flatnonzero(~np.isfinite(env.rewards))[0])
            raise LakeError(
                f"{env.scenario_id(row)}: a reward is {env.rewards[row]}, expected a number; check the scenario with "
                "Lake.check(), and leave it out of the database"
            )
        self.returns += env.rewards
        ended = env.terminals | env.truncations
        if ended.any():
            rows = ended if counts is None else ended & counts
            self._count += int(rows.sum())
            self._arrived += int(env.arrivals[rows].sum())
            self._late += int(env.truncations[rows].sum())
            self._numbers += env.last_numbers[rows].sum(axis=0)
            self._crashed += int((env.last_numbers[rows][:, _CRASH_ROWS] > 0.0).any(axis=1).sum())
            self._returned += float(self.returns[rows].sum())
            self.returns[ended] = 0.0

    @property
    def episodes(self) -> int:
        """Number of episodes that ended since the last :meth:`take`."""
        return self._count

    def take(self) -> dict[str, Any]:
        """Return means over the episodes since the last call, null without any, and forget them."""
        count = self._count
        mean = dict(zip(NUMBERS, (self._numbers / max(count, 1)).tolist(), strict=True))
        sums = {
            "success": self._arrived,
            "out_of_road": count - self._arrived - self._late,
            "timeout": self._late,
            "crashed": self._crashed,
            "reward": self._returned,
        }
        means = {name: value / max(count, 1) for name, value in sums.items()}
        means |= {"route_completion": mean["route_completion"], "speed": mean["mean_speed"]}
        means["distance_to_log"] = mean["mean_distance_to_log"]
        means["final_distance"] = mean["distance_to_log"]
        means["cost"] = sum(mean[name] for name in CRASHES)
        self._clear()
        return {"episodes": count} | {name: value if count else None for name, value in means.items()}

    def _clear(self) -> None:
        self._count = self._arrived = self._late = self._crashed = 0
        self._returned, self._numbers = 0.0, np.zeros(len(NUMBERS))


class Clock:
    """Wall time by activity.

    Attributes:
        seconds: Time of each activity since it was cleared.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, activity: str) -> Iterator[None]:
        """Count the time of the block for an activity."""
        began = time.perf_counter()
        yield
        self.seconds[activity] = self.seconds.get(activity, 0.0) + time.perf_counter() - began
