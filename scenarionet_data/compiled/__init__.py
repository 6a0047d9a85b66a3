"""Compilation with Numba: the decorators of all kernels; behind ``gate``, a compiler and a cache of our own."""

import importlib
from pathlib import Path

from scenarionet_data.optional_imports import hidden

_CONFIGURATION = () if Path(".numba_config.yaml").exists() else ("yaml",)
with hidden("coverage", "scipy", *_CONFIGURATION):  # which Numba imports if it finds them, in 0.1 s
    importlib.import_module("numba")
