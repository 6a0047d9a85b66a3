"""What this process compiled, and the line that announces it: one for each group of kernels, on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import current_process, parent_process

_ANNOUNCED_FROM = 2.0  # [s] of processor time to compile a group
_GROUPS: tuple[tuple[str, str, int], ...] = (
    ("scenarionet_data.storage", "loading", 4),
    ("scenarionet_data.procedural", "generated traffic", 6),
    ("scenarionet_data.converters", "reading raw records", 4),
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
_is_silent = False


@contextmanager
def silent() -> Iterator[None]:
    """Compile without announcing it, for callers that report their own progress."""
    global _is_silent
    before, _is_silent = _is_silent, True
    try:
        yield
    finally:
        _is_silent = before


def announce(module: str) -> None:
    """Announce once per process and group that compilation takes a while, on standard error of a terminal or notebook.

    Of several worker processes, only the first does.
    """
    group = next((group for group in _GROUPS if module.startswith(group[0])), None)
    if group is None:
        return
    _, purpose, seconds = group
    is_seen = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    is_first = parent_process() is None or current_process().name.endswith("-1")
    if seconds >= _ANNOUNCED_FROM and purpose not in _announced and is_seen and is_first and not _is_silent:
        _announced.add(purpose)
        sys.stderr.write(f"Compiling loops for {purpose}, once per installation (about {seconds} s)\n")
        sys.stderr.flush()
