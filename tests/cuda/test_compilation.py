"""All kernels compile to machine code of graphics cards, without one: numba-cuda makes PTX, and ptxas machine code."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numba import typeof, types
from numba.core import config

from scenarionet_sim.cameras.cuda.rounding import support_rounding
from scenarionet_sim.sensors.camera import Camera
from tests.cuda.played_card import PlayedCard
from tests.cuda.scenes import ALL, street

CAPABILITY = 9, 0
"""Compute capability of Hopper cards."""

pytestmark = pytest.mark.cuda


@pytest.fixture(scope="module")
def signatures():
    """The types of each kernel's arguments in a call that launches all of them."""
    drive = street()
    with pytest.MonkeyPatch.context() as patch:
        card = PlayedCard(patch)
        patch.setattr("scenarionet_sim.sensors.camera.require_cuda", lambda: None)
        camera = Camera(24, 16, channels=ALL, supersampling=2, noise=1.0, device="cuda")
        camera.frames(drive.batch, drive.state, np.array([[0, 0]], np.int32))
    return {name: types.void(*map(typeof, arguments)) for name, arguments in card.launches}


@pytest.fixture
def without_card(monkeypatch):
    """Device functions are compiled for the current card: say which."""
    pytest.importorskip("numba_cuda")
    if config.ENABLE_CUDASIM:
        pytest.skip("the simulator compiles nothing")
    from numba.cuda import dispatcher

    support_rounding()
    monkeypatch.setattr(dispatcher, "get_current_device", lambda: SimpleNamespace(compute_capability=CAPABILITY))


def assembler():
    """Path of NVIDIA's assembler: of its package, whose version goes with numba-cuda's, or of a CUDA toolkit."""
    nvidia = pytest.importorskip("nvidia")
    packaged = (Path(folder) / "cu13/bin/ptxas" for folder in nvidia.__path__)
    found = next((path for path in packaged if path.exists()), None) or shutil.which("ptxas")
    if not found:
        pytest.skip("no assembler of NVIDIA: pip install nvidia-cuda-nvcc")
    return found


@pytest.mark.parametrize(
    "name",
    ["find", "list_found", "set_up", "bound", "light", "stretch", "draw", "shrink", "add_noise"],
)
def test_kernels_compile(name, signatures, without_card, tmp_path):
    from numba import cuda

    from scenarionet_sim.cameras.cuda import kernels

    function = getattr(kernels, name).py_func
    code, _ = cuda.compile(function, signatures[name], device=False, cc=CAPABILITY, abi="numba")
    (tmp_path / "kernel.ptx").write_text(code)
    arch = f"-arch=sm_{CAPABILITY[0]}{CAPABILITY[1]}"
    command = [assembler(), arch, "-v", tmp_path / "kernel.ptx", "-o", tmp_path / "kernel.cubin"]
    done = subprocess.run(command, check=True, capture_output=True, text=True, timeout=300)
    assert (tmp_path / "kernel.cubin").stat().st_size > 0
    spilled = re.findall(r"(\d+) bytes spill stores", done.stderr)
    assert spilled and not any(map(int, spilled)), done.stderr
