"""Resources of this machine or container: cores, memory and disk, and the resulting default number of workers."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

MEMORY_PER_WORKER = 2 * 2**30
"""Memory reserved per conversion worker [bytes]; the largest known shard, a Waymo tfrecord, needs less."""

_CGROUP = Path("/sys/fs/cgroup")


def num_cores() -> int:
    """Return the number of cores this process may use, limited by CPU affinity and the container's quota."""
    bound = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    quota, period = (_limit("cpu.max") or "max 100000").split()
    granted = bound if quota == "max" else max(1, round(int(quota) / int(period)))
    return min(bound, granted)


def memory() -> int:
    """Return the memory of the machine or container [bytes]."""
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    limit = _limit("memory.max") or "max"
    return there if limit == "max" else min(there, int(limit))


def free_disk(folder: str | Path) -> int:
    """Return the free disk space for a folder, which need not exist yet [bytes]."""
    path = Path(os.path.realpath(folder))
    return shutil.disk_usage(next(each for each in (path, *path.parents) if each.exists())).free


def default_workers() -> int:
    """Return the default number of worker processes: one per core, limited by memory."""
    return max(1, min(num_cores(), memory() // MEMORY_PER_WORKER))


def _limit(name: str) -> str | None:
    """Value of a cgroup limit of the container, None outside a container."""
    try:
        return (_CGROUP / name).read_text().strip() or None
    except OSError:
        return None
