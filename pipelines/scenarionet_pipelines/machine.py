"""What this machine (or this container) has: cores, memory, disk; and how many workers that makes."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

MEMORY_PER_WORKER = 2 * 2**30
"""Bytes a conversion's worker is granted; the largest known shard, a Waymo tfrecord, takes less."""

_CGROUP = Path("/sys/fs/cgroup")


def num_cores() -> int:
    """Cores this process may use: those it is bound to, and no more than its container is granted."""
    bound = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota, period = (_limit("cpu.max") or "max 100000").split()
    granted = bound if quota == "max" else max(1, round(int(quota) / int(period)))
    return min(bound, granted)


def memory() -> int:
    """Bytes of memory of the machine, or of its container when that has less."""
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limit = _limit("memory.max") or "max"
    return there if limit == "max" else min(there, int(limit))


def free_disk(folder: str | Path) -> int:
    """Free bytes where ``folder`` lies or will lie."""
    place = Path(folder).resolve()
    while not place.exists():
        place = place.parent
    return shutil.disk_usage(place).free


def default_workers() -> int:
    """Worker processes for a conversion: one a core, as far as memory goes."""
    return max(1, min(num_cores(), memory() // MEMORY_PER_WORKER))


def _limit(name: str) -> str | None:
    """A limit of the container this process runs in, None outside of one."""
    try:
        return (_CGROUP / name).read_text().strip() or None
    except OSError:
        return None
