"""The order in which episodes meet scenarios: one after the other, shuffled, by weight, from easy to hard.

A sampler draws numbers of scenarios, 0 to n - 1, without end; it is told how each episode went and is the same
again after :meth:`Sampler.restart` with the same seed. It knows neither the lake nor the simulator.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from scenarionet_data.errors import BadParameter


class Sampler(Protocol):
    """What every order can do."""

    def restart(self, seed: int) -> None:
        """Begin again, as if newly made."""

    def draw(self) -> int:
        """The next scenario."""

    def report(self, scenario: int, success: float) -> None:
        """Learn how the episode in a scenario ended: 1 for success, 0 for none, or the share of its agents."""


class Sequential:
    """Scenarios in their order, again and again; the seed changes nothing.

    Example:
        >>> order = Sequential(3)
        >>> [order.draw() for _ in range(5)]
        [0, 1, 2, 0, 1]
    """

    def __init__(self, count: int) -> None:
        self._count = count
        self._next = 0

    def restart(self, seed: int) -> None:  # noqa: ARG002
        """Begin with the first."""
        self._next = 0

    def draw(self) -> int:
        """The next scenario."""
        drawn = self._next
        self._next = (drawn + 1) % self._count
        return drawn

    def report(self, scenario: int, success: float) -> None:
        """Nothing depends on it."""


class Shuffled:
    """Every scenario once in random order, then all again in another."""

    def __init__(self, count: int) -> None:
        self._count = count
        self.restart(0)

    def restart(self, seed: int) -> None:
        """Shuffle afresh."""
        self._rng = np.random.default_rng(seed)
        self._rest: list[int] = []

    def draw(self) -> int:
        """The next scenario."""
        if not self._rest:
            self._rest = self._rng.permutation(self._count).tolist()
        return self._rest.pop()

    def report(self, scenario: int, success: float) -> None:
        """Nothing depends on it."""


class Weighted:
    """Each draw by itself, in proportion to weights.

    Args:
        weights: (n,) finite and not negative, one of them above 0.

    Raises:
        BadParameter: They are not.
    """

    def __init__(self, weights: npt.ArrayLike) -> None:
        values = np.asarray(weights, dtype=np.float64)
        if not np.isfinite(values).all() or (values < 0).any() or values.sum() <= 0:
            raise BadParameter("weights of scenarios: wanted numbers from 0, one of them above; correct the expression")
        self._cumulative = np.cumsum(values)
        self.restart(0)

    def restart(self, seed: int) -> None:
        """Draw the same series again for the same seed."""
        self._rng = np.random.default_rng(seed)

    def draw(self) -> int:
        """The next scenario."""
        mark = self._rng.random() * self._cumulative[-1]
        return int(np.searchsorted(self._cumulative, mark, side="right"))

    def report(self, scenario: int, success: float) -> None:
        """Nothing depends on it."""


@dataclass(frozen=True)
class Curriculum:
    """From easy to hard: scenarios sorted by difficulty are parted into levels, and success leads to the next.

    The paper sorts by ``difficulty`` (track length times cumulative curvature), trains on 100 levels of 400
    scenarios, and ends a level at a success rate of 75 %.

    Attributes:
        levels: Number of levels, of sizes that differ by one at most.
        success: Share of the last episodes that must succeed.
        episodes: How many last episodes count; None for as many as the level has scenarios.
        by: What is difficult: an SQL expression over ``metadata``, rising.
    """

    levels: int = 100
    success: float = 0.75
    episodes: int | None = None
    by: str = "difficulty"


class Rising:
    """Scenarios of one level, shuffled, until enough of the last episodes succeeded; then those of the next.

    Episodes in scenarios of another level (drawn before a promotion) do not count. The last level goes on for ever.

    Args:
        count: Number of scenarios, the easiest first.
        curriculum: How to rise.

    Raises:
        BadParameter: A level would be empty, or a number is out of range.
    """

    def __init__(self, count: int, curriculum: Curriculum) -> None:
        if not 1 <= curriculum.levels <= count:
            raise BadParameter(
                f"curriculum: {curriculum.levels} levels of {count} scenarios; wanted 1 to {count} levels"
            )
        if not 0.0 < curriculum.success <= 1.0:
            raise BadParameter(f"curriculum: wanted success above 0 up to 1, found {curriculum.success}")
        if curriculum.episodes is not None and curriculum.episodes < 1:
            raise BadParameter(f"curriculum: wanted at least one episode that counts, found {curriculum.episodes}")
        self._curriculum = curriculum
        self._starts = np.linspace(0, count, curriculum.levels + 1).astype(np.int64)
        self.restart(0)

    def restart(self, seed: int) -> None:
        """Back to the first level."""
        self._rng = np.random.default_rng(seed)
        self._rest: list[int] = []
        self._enter(0)

    def draw(self) -> int:
        """The next scenario."""
        if not self._rest:
            self._rest = (self._first + self._rng.permutation(self._last - self._first)).tolist()
        return self._rest.pop()

    def report(self, scenario: int, success: float) -> None:
        """Count an episode, and rise when enough succeeded."""
        if not self._first <= scenario < self._last:
            return
        self._results.append(success)
        is_known = len(self._results) == self._results.maxlen
        if is_known and self.success_rate >= self._curriculum.success and self.level + 1 < self._curriculum.levels:
            self._enter(self.level + 1)

    @property
    def success_rate(self) -> float:
        """Mean success of the last episodes of this level; 0 before the first."""
        return sum(self._results) / max(len(self._results), 1)

    def _enter(self, level: int) -> None:
        self.level = level
        self._first, self._last = int(self._starts[level]), int(self._starts[level + 1])
        self._rest.clear()
        self._results: deque[float] = deque(maxlen=self._curriculum.episodes or self._last - self._first)
