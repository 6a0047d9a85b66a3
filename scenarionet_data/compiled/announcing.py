"""What this process compiled, and the line on standard error that announces it: one for each group of kernels."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import current_process, parent_process

_GROUPS: tuple[tuple[str, str, int], ...] = (
    ("scenarionet_data.codec", "loading", 3),
    ("scenarionet_data.storage", "loading", 3),
    ("scenarionet_data.samples", "samples", 5),
    ("scenarionet_data.procedural", "generated traffic", 5),
    ("scenarionet_data.converters", "reading raw records", 3),
    ("scenarionet_sim.cameras", "cameras", 12),
    ("scenarionet_sim", "the simulator", 8),
    ("scenarionet_data", "conversion", 4),
)
"""Module prefix, purpose and seconds to compile of each group of kernels; the first prefix that matches counts."""


@dataclass(frozen=True)
class Compilation:
    """A kernel that this process made ready: its name, processor time [s], whether it came from the cache."""

    name: str
    seconds: float
    from_cache: bool
    cache_folder: str | None


compilations: list[Compilation] = []
"""Kernels that this process compiled or read from the cache, in order; kernels inside kernels come first."""


_announced: set[str] = set()


def _write(message: str) -> None:
    if sys.stderr is not None:
        sys.stderr.write(f"{message}\n")
        sys.stderr.flush()


_tell: Callable[[str], None] = _write


@contextmanager
def telling(tell: Callable[[str], None]) -> Iterator[None]:
    """Pass announcements to a function of the caller, who displays progress, instead of to standard error."""
    global _tell
    before, _tell = _tell, tell
    try:
        yield
    finally:
        _tell = before


def announce(module: str) -> None:
    """Announce that compilation takes a while, once per process and group; of several workers, only the first does."""
    group = next((group for group in _GROUPS if module.startswith(group[0])), None)
    is_first = parent_process() is None or current_process().name.endswith("-1")
    if group is not None and is_first and group[1] not in _announced:
        _announced.add(group[1])
        _tell(f"Compiling loops for {group[1]}, once per installation (about {group[2]} s)")
