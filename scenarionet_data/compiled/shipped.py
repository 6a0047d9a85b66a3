"""Machine code of kernels that travels with an installation, for levels of processors instead of a single one.

``make install`` and ``make build`` write it into the package. It is read where the user's cache lacks a kernel, and
valid as that is: for the same version of Python and Numba, and unchanged code. Results are the same to the bit.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parent / "machine_code"


@dataclass(frozen=True)
class Level:
    """Processors that run the same machine code.

    Attributes:
        cpu: LLVM's name of the level.
        features: Those that kernels use beyond the level, as LLVM writes them.
        needs: Features by which a processor is recognised, of those that newer ones of the level have as well.
    """

    cpu: str
    features: str
    needs: tuple[str, ...]

    @property
    def folder(self) -> Path:
        """The machine code of the level, a folder for each Python package."""
        return FOLDER / self.cpu


LEVELS = (
    Level("x86-64-v4", "+avx512vbmi2", ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl", "avx512vbmi2")),
    Level("x86-64-v3", "", ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe", "xsave")),
)
"""The best first. Of processors with AVX-512, the older ones without vbmi2 slow down with it."""


_FLAGS = {"avx512vbmi2": "avx512_vbmi2", "bmi": "bmi1", "lzcnt": "abm"}
"""Names that Linux has for features, where they differ from LLVM's."""


def levels_of_host() -> list[Level]:
    """Return the levels whose code this processor runs."""
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    return [level for level in LEVELS if all(features.get(name) for name in level.needs)]


def levels_by_flags() -> list[Level]:
    """Return the same of Linux on x86, without LLVM."""
    lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
    flags = set(next((line for line in lines if line.startswith("flags")), "").split())
    return [level for level in LEVELS if flags.issuperset(_FLAGS.get(name, name) for name in level.needs)]


@cache
def level() -> Level | None:
    """Return the level whose machine code this process uses; None for another processor, or one set for Numba."""
    config: Any = import_module("numba.core.config")
    chosen = config.CPU_NAME is not None or config.CPU_FEATURES is not None or not config.ENABLE_AVX
    return None if chosen else next(iter(levels_of_host()), None)
