"""Compiled functions: one decorator module, cache invalidation, clear errors, one message before a long compilation."""

from __future__ import annotations

import importlib.util
import os
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from scenarionet_data.compiled import announcing
from scenarionet_data.compiled.announcing import compilations
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.compiled.gate import uses_internals

pytestmark = pytest.mark.skipif(not uses_internals(), reason="tests what is built on the internals of numba")

DEVICE = """
from scenarionet_data.compiled.decorators import device_function
FACTOR = 2.0

@device_function
def scaled(value):
    return value * FACTOR + 0.0
"""
KERNEL = """
from device_of_test import scaled
from scenarionet_data.compiled.decorators import kernel

@kernel
def total(values):
    result = 0.0
    for value in values:
        result += scaled(value)
    return result
"""


@device_function
def first(values):
    return values[0]


@device_function
def with_ends(values):
    return values[1:], values[:1]


@kernel
def call_first(values):
    return first(values)


@kernel
def call_with_ends(values):
    return with_ends(values)


def test_device_function_called_from_python_raises_error():
    with pytest.raises(TypeError, match=r"first\(\) is a device function.*first\.py_func"):
        first(np.zeros(3))
    assert call_first(np.ones(3)) == 1.0
    assert first.py_func(np.ones(3)) == 1.0


def test_device_function_returning_arrays_must_declare_it():
    with pytest.raises(TypeError, match="allocates=True"):
        call_with_ends(np.zeros(3))


@pytest.mark.parametrize(
    ("old", "new", "result"),
    [("FACTOR = 2.0", "FACTOR = 3.0", 9.0), ("+ 0.0", "+ 1.0", 9.0), ("FACTOR = 2.0", "FACTOR = 2.0  # same", 6.0)],
    ids=["constant", "code", "comment"],
)
def test_kernel_is_recompiled_when_its_device_function_changes(tmp_path, monkeypatch, old, new, result):
    def run():
        for name in ("device_of_test", "kernel_of_test"):
            spec = importlib.util.spec_from_file_location(name, tmp_path / f"{name}.py")
            module = importlib.util.module_from_spec(spec)
            monkeypatch.setitem(sys.modules, name, module)
            spec.loader.exec_module(module)
        known = len(compilations)
        value = module.total(np.ones(3))
        return value, [done.from_cache for done in compilations[known:]]

    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "device_of_test.py").write_text(DEVICE)
    (tmp_path / "kernel_of_test.py").write_text(KERNEL)
    assert run() == (6.0, [False])
    assert run() == (6.0, [True])
    (tmp_path / "device_of_test.py").write_text(DEVICE.replace(old, new))
    assert run() == (result, [result == 6.0])


def test_threads_that_call_a_new_kernel_do_not_close_each_others_lock(tmp_path, monkeypatch):
    def close_slowly(file, close=os.close):
        time.sleep(0.05)
        close(file)

    monkeypatch.setattr("scenarionet_data.compiled.kernel_cache.os.close", close_slowly)
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "new.py").write_text(KERNEL.replace("scaled(value)", "value").replace("from device_of_test", "# from"))
    spec = importlib.util.spec_from_file_location("new_kernel", tmp_path / "new.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(lambda _: module.total(np.ones(3)), range(4))) == [3.0] * 4


def test_cache_that_names_a_renamed_class_is_ignored(tmp_path, monkeypatch):
    def run(name):
        source = f"""
from typing import NamedTuple
from scenarionet_data.compiled.decorators import kernel

class {name}(NamedTuple):
    x: float

@kernel
def double(point):
    return 2.0 * point.x

result = double({name}(1.5))
"""
        (tmp_path / "renamed_of_test.py").write_text(source)
        spec = importlib.util.spec_from_file_location("renamed_of_test", tmp_path / "renamed_of_test.py")
        module = importlib.util.module_from_spec(spec)
        monkeypatch.setitem(sys.modules, "renamed_of_test", module)
        spec.loader.exec_module(module)
        return module.result

    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    monkeypatch.setattr("numba.core.config.CACHE_DIR", str(tmp_path / "cache"))
    assert run("Before") == 3.0
    assert run("After") == 3.0


def test_constant_argument_is_not_compiled_separately():
    @device_function
    def twice(value, flag):
        return value * 2 if flag else value

    @kernel
    def both(value):
        return twice(value, True) + twice(value, False) + twice(value, value > 0.0)

    assert both(1.0) == 5.0
    assert len(twice.signatures) == 1


def test_compilation_is_announced_once_per_group(monkeypatch, capsys):
    """On a terminal or not: in a script, a notebook or a job, a first call that takes long says why."""
    monkeypatch.setattr(announcing, "_announced", set())
    for module in (
        "scenarionet_sim.roads.ray_kernels",
        "scenarionet_sim.task.task",
        "scenarionet_sim.cameras.draw.frames",
        "scenarionet_data.codec.track_kernels",
    ):
        announcing.announce(module)
    with announcing.telling(lambda _: None):
        announcing.announce("scenarionet_data.procedural.drive")
    announcing.announce("somewhere.else")
    lines = capsys.readouterr().err.splitlines()
    assert [line.partition(",")[0] for line in lines] == [
        "Compiling loops for the simulator",
        "Compiling loops for cameras",
        "Compiling loops for loading",
    ]
    assert lines[0].endswith(", once per installation (about 8 s)")
