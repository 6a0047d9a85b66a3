"""Versions of Numba that were not tested: what is inside of it stays untouched."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from scenarionet_data.compiled import gate

ROOT = Path(__file__).parents[3]

KERNELS = """
import os, sys
import numpy as np
if sys.argv[1:]:
    import numba
    numba.__version__ = sys.argv[1]
from scenarionet_data.compiled.checking import unchecked
from scenarionet_data.compiled.decorators import device_function, kernel

@device_function(in_lanes=True)
def double(values, out):
    for k in range(len(values)):
        out[k] = 2.0 * values[k]

@kernel(allocates=False, is_wide=True)
def doubled(values, out):
    double(values, out)
    return out[0]

values = np.arange(1.0, 40.0)
for _ in range(2):
    assert unchecked(doubled)(values, np.empty(39)) == 2.0
print(type(doubled).__name__, sorted(name for name in sys.modules if name.startswith("scenarionet_data.compiled.")))
"""


def test_numba_is_used_in_one_room():
    """But for graphics cards, and single instructions of processors by the extension interface of numba."""
    files = [
        file for name in ("scenarionet_data", "scenarionet_sim", "pipelines") for file in (ROOT / name).rglob("*.py")
    ]
    users = {
        file.parent.relative_to(ROOT).as_posix()
        for file in files
        if re.search(r"^(import|from) numba", file.read_text(), re.M)
    }
    elsewhere = {"scenarionet_sim/cameras/cuda", "scenarionet_sim/threads"}
    assert users - elsewhere == {"scenarionet_data/compiled"}


@pytest.mark.parametrize("version", ["0.64.9", "0.69.0", "1.0.0"])
def test_other_versions_are_outside_of_the_gate(monkeypatch, version):
    monkeypatch.delenv(gate.PLAIN, raising=False)
    monkeypatch.setattr("numba.__version__", "0.66.1")
    assert gate.uses_internals.__wrapped__()
    monkeypatch.setattr("numba.__version__", version)
    assert not gate.uses_internals.__wrapped__()


@pytest.mark.integration
@pytest.mark.parametrize("reason", ["version", "variable"])
def test_kernels_of_other_versions_are_compiled_by_numba_alone(monkeypatch, reason):
    monkeypatch.setenv(gate.PLAIN, "1" if reason == "variable" else "0")
    command = [sys.executable, "-c", KERNELS, *(["0.69.0"] if reason == "version" else [])]
    found = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    rooms = ["announcing", "bare", "checking", "declared", "decorators", "gate", "shipped", "stamps"]
    assert found.strip() == f"CPUDispatcher {[f'scenarionet_data.compiled.{room}' for room in rooms]}"
