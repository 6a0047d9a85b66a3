"""The build backend compiles once, and leaves alone what ``make build`` compiled."""

from __future__ import annotations

import importlib.util
import subprocess
from pathlib import Path
from types import SimpleNamespace

import pytest

CODE = Path("scenarionet_data/compiled/machine_code")


@pytest.fixture
def backend(monkeypatch, tmp_path):
    """The backend in an empty project, where compiling makes a file and a wheel has a name."""
    spec = importlib.util.spec_from_file_location("build_backend", Path(__file__).parents[1] / "build_backend.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    made = SimpleNamespace(module=module, compilations=0, shipped=[])

    def compile_all(words, **_):
        made.compilations += 1
        CODE.mkdir(parents=True)
        (CODE / "kernel").touch()

    def build(*_):
        made.shipped = [path.name for path in CODE.glob("*")]
        return "some.whl"

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(subprocess, "run", compile_all)
    monkeypatch.setattr(module.hatchling, "build_wheel", build)
    return made


def test_what_it_compiles_is_in_the_wheel_alone(backend):
    assert backend.module.build_wheel("dist") == "some.whl"
    assert (backend.compilations, backend.shipped, CODE.exists()) == (1, ["kernel"], False)


def test_machine_code_that_is_there_is_shipped_and_stays(backend):
    CODE.mkdir(parents=True)
    (CODE / "made before").touch()
    backend.module.build_wheel("dist")
    assert (backend.compilations, backend.shipped, CODE.exists()) == (0, ["made before"], True)


def test_a_wheel_without_machine_code(backend, monkeypatch):
    backend.module.build_wheel("dist", {"machine-code": "no"})
    assert (backend.compilations, backend.shipped) == (0, [])

    def fail(words, **_):
        raise subprocess.CalledProcessError(1, words)

    monkeypatch.setattr(subprocess, "run", fail)
    assert backend.module.build_wheel("dist") == "some.whl"
    assert backend.shipped == []
