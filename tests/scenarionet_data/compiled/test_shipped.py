"""Machine code that travels with an installation: read where the cache is empty, never for changed code."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import sys

import pytest
from numba.core import config
from numba.core.registry import cpu_target

from scenarionet_data.compiled import gate, shipped
from scenarionet_data.compiled.announcing import compilations

pytestmark = pytest.mark.skipif(not gate.uses_internals(), reason="the cache of Numba itself")

_, CPU, FEATURES = cpu_target.target_context.codegen().magic_tuple()


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with one kernel, run with an empty cache: its result, and whether the kernel was compiled."""
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr(shipped, "FOLDER", tmp_path / "shipped")
    monkeypatch.setattr(shipped, "level", lambda: shipped.Level(CPU, FEATURES, ()))
    (tmp_path / "shipping").mkdir()

    def run(factor: float, cache: str) -> tuple[float, bool]:
        file = tmp_path / "shipping" / "kernels.py"
        file.write_text(
            "from scenarionet_data.compiled.decorators import kernel\n\n"
            f"@kernel\ndef scale(value):\n    return {factor} * value\n"
        )
        monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path / cache))
        spec = importlib.util.spec_from_file_location("shipping.kernels", file)
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "shipping.kernels", module)
        spec.loader.exec_module(module)
        return module.scale(3.0), not compilations[-1].from_cache

    assert run(2.0, "first") == (6.0, True)
    shutil.copytree(compilations[-1].cache_folder, tmp_path / "shipped" / CPU / "shipping")
    return run


def test_shipped_code_is_used_with_an_empty_cache(package):
    assert package(2.0, "second") == (6.0, False)


def test_changed_code_is_compiled(package):
    assert package(4.0, "second") == (12.0, True)


def test_code_of_another_level_is_not_used(package, monkeypatch):
    monkeypatch.setattr(shipped, "level", lambda: shipped.Level(CPU, FEATURES + ",+other", ()))
    assert package(2.0, "second") == (6.0, True)


def test_processors_without_a_level_compile(package, monkeypatch):
    monkeypatch.setattr(shipped, "level", lambda: None)
    assert package(2.0, "second") == (6.0, True)


@pytest.mark.parametrize(
    ("missing", "names"),
    [(None, ["x86-64-v4", "x86-64-v3"]), ("avx512vbmi2", ["x86-64-v3"]), ("fma", ["x86-64-v4"]), ("all", [])],
)
def test_levels_are_those_whose_features_the_processor_has(monkeypatch, missing, names):
    features = {name: missing not in (name, "all") for level in shipped.LEVELS for name in level.needs}
    monkeypatch.setattr("llvmlite.binding.get_host_cpu_features", lambda: features)
    assert [level.cpu for level in shipped.levels_of_host()] == names


def test_a_processor_set_for_numba_is_obeyed(monkeypatch):
    monkeypatch.setattr(config, "CPU_NAME", "generic")
    assert shipped.level.__wrapped__() is None


USE = """
import sys, hashlib
from pathlib import Path
import numpy as np
from scenarionet_data.compiled import shipped
shipped.FOLDER = Path(sys.argv[1])
shipped.level = lambda: next((level for level in shipped.LEVELS if level.cpu == sys.argv[3]), None)
from scenarionet_data import Samples, ScenarioLoader, TimeWindow, convert
from scenarionet_data.compiled.announcing import compilations
from scenarionet_sim import Camera, EgoState, ScenarioNetEnv, Scenarios

convert("pg", "8:10", sys.argv[2])
samples = Samples(sys.argv[2], window=TimeWindow(1.0, 1.0)).batch([0])
env = ScenarioNetEnv(scenarios=Scenarios(sys.argv[2]), sensors=(Camera(64, 48), EgoState()), observation="dict")
observed = [env.reset(seed=0)[0], *(env.step([0.1, 0.5])[0] for _ in range(5))]
arrays = [*samples.values(), *(value for each in observed for value in each.values())]
digest = hashlib.sha256(b"".join(np.ascontiguousarray(array).tobytes() for array in arrays)).hexdigest()
print(digest, sum(not done.from_cache for done in compilations))
"""


@pytest.mark.long  # compiles everything for all levels
def test_all_levels_compute_the_same_as_code_for_this_processor(tmp_path, monkeypatch):
    from scenarionet_pipelines.compiling import ship_kernels

    monkeypatch.setattr(shipped, "FOLDER", tmp_path / "shipped")
    levels = shipped.levels_of_host()
    ship_kernels(levels)
    results = []
    for name in ("none", *(level.cpu for level in levels)):
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / f"cache-{name}"))
        words = [sys.executable, "-c", USE, str(tmp_path / "shipped"), str(tmp_path / f"lake-{name}"), name]
        results.append(subprocess.run(words, capture_output=True, text=True, check=True).stdout.split())
    assert len({digest for digest, _ in results}) == 1
    assert int(results[0][1]) > 10
    assert {compiled for _, compiled in results[1:]} <= {"0"}
