"""Samplers: the order in which episodes play scenarios, sequential, shuffled, weighted or from easy to hard.

A sampler is an endless series of indices 0 to n - 1. It receives the result of each episode, and repeats the same
series after :meth:`Sampler.restart` with the same seed. It depends neither on the lake nor on the simulator.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.settings import Count, check_settings


class Sampler(ABC):
    """Base class of samplers; by default they draw by random numbers alone.

    Attributes:
        is_adaptive: Whether the series depends on the results of episodes, which are reported only then.
    """

    is_adaptive: ClassVar[bool] = False

    def restart(self, seed: int) -> None:
        """Restart the series with a seed."""
        self._rng = np.random.default_rng(seed)

    def draw(self) -> int:
        """Return the index of the next scenario."""
        return self.draw_all(1)[0]

    @abstractmethod
    def draw_all(self, count: int) -> list[int]:
        """Return the indices of the next scenarios, as that many calls of :meth:`draw`."""

    def report(self, scenario: int, success: float) -> None:  # noqa: B027
        """Record the result of an episode: 1 for success, 0 for failure, or the share of agents that succeeded."""

    def state(self) -> dict[str, Any]:
        """Return where the series stands, JSON-serialisable."""
        return {"random": self._rng.bit_generator.state}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue a series of the same scenarios where another sampler stood."""
        self._rng.bit_generator.state = state["random"]


class Sequential(Sampler):
    """Indices in ascending order, repeated; independent of the seed.

    Example:
        >>> order = Sequential(3)
        >>> [order.draw() for _ in range(5)]
        [0, 1, 2, 0, 1]
    """

    def __init__(self, count: int) -> None:
        self._count, self._next = count, 0

    def restart(self, seed: int) -> None:  # noqa: ARG002
        """Restart with index 0."""
        self._next = 0

    def draw_all(self, count: int) -> list[int]:
        """Return the indices of the next scenarios."""
        first, self._next = self._next, (self._next + count) % self._count
        return [scenario % self._count for scenario in range(first, first + count)]

    def state(self) -> dict[str, Any]:
        """Return where the series stands."""
        return {"next": self._next}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue where another sampler stood."""
        self._next = int(state["next"])


class Shuffled(Sampler):
    """Every index once per round, in a new random order each round."""

    def __init__(self, count: int) -> None:
        self._first, self._last = 0, count
        self.restart(0)

    def restart(self, seed: int) -> None:
        """Shuffle afresh."""
        super().restart(seed)
        self._rest: list[int] = []

    def draw_all(self, count: int) -> list[int]:
        """Return the indices of the next scenarios."""
        while len(self._rest) < count:  # drawn from the end
            self._rest = (self._first + self._rng.permutation(self._last - self._first)).tolist() + self._rest
        kept = len(self._rest) - count
        drawn = self._rest[kept:][::-1]
        del self._rest[kept:]
        return drawn

    def state(self) -> dict[str, Any]:
        """Return where the series stands."""
        return super().state() | {"rest": list(self._rest)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue where another sampler stood."""
        super().restore(state)
        self._rest = list(state["rest"])


class Weighted(Sampler):
    """Independent draws with probabilities proportional to weights.

    Args:
        weights: (n,) finite, non-negative, at least one positive.

    Raises:
        BadParameter: The weights are invalid.
    """

    def __init__(self, weights: npt.ArrayLike) -> None:
        values = np.asarray(weights, dtype=np.float64)
        if not np.isfinite(values).all() or (values < 0).any() or values.sum() <= 0:
            raise BadParameter("weights must be finite and non-negative, at least one positive; correct the expression")
        self._cumulative = np.cumsum(values)
        self.restart(0)

    def draw_all(self, count: int) -> list[int]:
        """Return the indices of the next scenarios."""
        marks = self._rng.random(count) * self._cumulative[-1]
        drawn: list[int] = np.searchsorted(self._cumulative, marks, side="right").tolist()
        return drawn


@dataclass(frozen=True)
class Curriculum:
    """Curriculum: scenarios sorted by difficulty are divided into levels, and success promotes to the next level.

    The paper sorts by ``difficulty`` (track length times cumulative curvature), trains on 100 levels of 400
    scenarios, and ends a level at a success rate of 75 %.

    Attributes:
        levels: Number of levels; their sizes differ by at most one.
        success: Success rate over the last episodes that promotes to the next level.
        episodes: Number of last episodes that count; None for the number of scenarios in the level.
        by: SQL expression over ``metadata`` to sort by, ascending.
    """

    levels: Count = 100
    success: float = 0.75
    episodes: Count | None = None
    by: str = "difficulty"

    def __post_init__(self) -> None:
        check_settings(self)
        if not 0.0 < self.success <= 1.0:
            raise BadParameter(f"curriculum: expected 0 < success <= 1, found {self.success}")


class CurriculumSampler(Shuffled):
    """Shuffled indices of the current level of a curriculum.

    Episodes of another level (drawn before a promotion) do not count. The last level is played indefinitely.

    Args:
        count: Number of scenarios, sorted by rising difficulty.
        curriculum: Levels and promotion rule.

    Raises:
        BadParameter: A level would be empty.
    """

    is_adaptive: ClassVar[bool] = True

    def __init__(self, count: int, curriculum: Curriculum) -> None:
        if curriculum.levels > count:
            raise BadParameter(f"curriculum: {curriculum.levels} levels of {count} scenarios; expected 1 to {count}")
        self._curriculum = curriculum
        self._starts = np.linspace(0, count, curriculum.levels + 1).astype(np.int64)
        self.restart(0)

    def restart(self, seed: int) -> None:
        """Restart at the first level."""
        super().restart(seed)
        self._enter(0)

    def report(self, scenario: int, success: float) -> None:
        """Record a result, and advance to the next level when the success rate is reached."""
        if not self._first <= scenario < self._last:
            return
        self._results.append(success)
        is_known = len(self._results) == self._results.maxlen
        if is_known and self.success_rate >= self._curriculum.success and self.level + 1 < self._curriculum.levels:
            self._enter(self.level + 1)

    def state(self) -> dict[str, Any]:
        """Return where the series stands."""
        return super().state() | {"level": self.level, "results": list(self._results)}

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue where another sampler stood."""
        self._enter(int(state["level"]))
        super().restore(state)
        self._results.extend(state["results"])

    @property
    def success_rate(self) -> float:
        """Mean success over the last episodes of this level; 0 before the first."""
        return sum(self._results) / max(len(self._results), 1)

    def _enter(self, level: int) -> None:
        self.level = level
        self._first, self._last = int(self._starts[level]), int(self._starts[level + 1])
        self._rest.clear()
        self._results: deque[float] = deque(maxlen=self._curriculum.episodes or self._last - self._first)
