"""Limits of address space (``ulimit -v``): what verbs do to need less, and the words for what is still too little."""

from __future__ import annotations

import ctypes
import importlib
import importlib.util
import os
import sys

NEEDED = 1_500 * 2**20
"""Address space in which every verb handles a small lake [bytes]; a test runs them."""
_AMPLE = 4_000_000_000
_ARENA_MAX = -8  # the parameter M_ARENA_MAX of mallopt(3)


def reserve_less_if_limited() -> str:
    """Let libraries that are not loaded yet reserve less address space if it is limited; return what is short.

    Arrow's allocator takes 1 GiB at once and the C library 64 MiB for each thread, to be a little faster: without,
    0.7 of 2.5 GB are left.

    Returns:
        What the limit allows and what verbs need; empty if the limit leaves that much.
    """
    if importlib.util.find_spec("resource") is None:  # Windows
        return ""
    resource = importlib.import_module("resource")
    allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    if allowed == resource.RLIM_INFINITY or allowed >= _AMPLE:
        return ""
    os.environ.setdefault("MIMALLOC_ARENA_RESERVE", str(64 * 1024))  # [KiB]
    os.environ.setdefault("MALLOC_ARENA_MAX", "2")  # for worker processes
    if sys.platform == "linux" and hasattr(library := ctypes.CDLL(None), "mallopt"):
        library.mallopt(_ARENA_MAX, 2)
    if allowed >= NEEDED:
        return ""
    return (
        f"`ulimit -v` allows {allowed / 1e9:.1f} GB of address space; verbs need {NEEDED / 1e9:.1f} GB, and more for "
        "large lakes"
    )
