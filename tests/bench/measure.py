"""Timing and memory: medians of repeated runs, each printed next to its goal."""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scenarionet_data import ScenarioLoader


@dataclass(frozen=True)
class Figure:
    """One measured figure.

    Attributes:
        name: What was measured.
        value: The median.
        unit: Its unit.
        wanted: What it should reach, as text: ``>= 80``; empty when there is no goal.
        reference: What others take, as text.
    """

    name: str
    value: float
    unit: str
    wanted: str = ""
    reference: str = ""

    @property
    def is_reached(self) -> bool | None:
        """Whether the goal is met; None without one."""
        if not self.wanted:
            return None
        sign, bound = self.wanted.split()
        return self.value >= float(bound) if sign == ">=" else self.value <= float(bound)

    def row(self) -> dict[str, Any]:
        return {**asdict(self), "is_reached": self.is_reached}


def median_ms(action: Callable[[int], Any], repeats: int, warmup: int = 3) -> float:
    """Median wall time of ``action(k)`` in milliseconds."""
    for k in range(warmup):
        action(k)
    times = []
    for k in range(repeats):
        started = time.perf_counter()
        action(k)
        times.append(time.perf_counter() - started)
    return 1e3 * statistics.median(times)


def crop_loads(name: str, lake: Path) -> Iterator[Figure]:
    """Load scenarios that use a part of a shared map, with warm caches."""
    loader = ScenarioLoader(lake)
    times = [median_ms(lambda _, index=index: loader[index], 9) for index in range(min(len(loader), 40))]  # type: ignore[misc]
    yield Figure(f"{name}: one whole scenario with its part of the map, warm", statistics.median(times), "ms", "<= 5")
    yield Figure(f"{name}: the same, the slowest scenario", max(times), "ms")


def peak_mb() -> float:
    """Peak resident memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def in_fresh_process(code: str, *arguments: str) -> str:
    """Standard output of Python code in a new process, for memory measurements."""
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(done.stderr)
    return done.stdout
