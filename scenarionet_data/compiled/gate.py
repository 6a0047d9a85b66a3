"""The one decision whether parts inside of Numba are used, or only what Numba documents.

With a tested version, kernels have a compiler, a cache and an entry of their own. Otherwise Numba's own compiler and
cache do the work: they take twice as long to compile, do not notice that a called function in another file was edited,
and round pictures of cameras differently.
"""

from __future__ import annotations

import importlib
import os
from functools import cache
from pathlib import Path
from typing import Any

from scenarionet_data.optional_imports import hidden

TESTED = (0, 65), (0, 68)
"""Oldest and newest minor version of Numba whose internals are known."""

PLAIN = "SCENARIONET_PLAIN_NUMBA"
"""Environment variable; 1 stops the use of internals with any version."""


@cache
def import_numba() -> Any:
    """Import Numba without what it imports if it finds it, in 0.1 s."""
    configuration = () if Path(".numba_config.yaml").exists() else ("yaml",)
    with hidden("coverage", "scipy", *configuration):
        return importlib.import_module("numba")


@cache
def uses_internals() -> bool:
    """Return whether this process may use the internals of the installed version, which it imports."""
    version = tuple(map(int, import_numba().__version__.split(".")[:2]))
    return TESTED[0] <= version <= TESTED[1] and os.environ.get(PLAIN) != "1"
