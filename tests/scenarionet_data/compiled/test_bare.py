"""Kernels by their images, in processes that do not import Numba."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from scenarionet_data.compiled import bare, gate, shipped

pytestmark = pytest.mark.skipif(
    not gate.uses_internals() or not bare._IS_POSSIBLE or not shipped.levels_by_flags(), reason="no images here"
)

KERNELS = """
from typing import Any, NamedTuple
import numpy as np
from scenarionet_data.compiled.byte_views import as_int32
from scenarionet_data.compiled.decorators import device_function, kernel

class Columns(NamedTuple):
    values: Any
    codes: Any

@device_function
def _times(value, factor):
    return value * factor

@kernel(allocates=False)
def total(columns, factor):
    found = 0.0
    for row in range(len(columns.values)):
        found += _times(columns.values[row], FACTOR * factor)
    return found + as_int32(columns.codes)[0]

@kernel(allocates=False)
def divided(number, by):
    return number // by

@kernel
def ones(count):
    return np.ones(count)

FACTOR = 2.0
"""
"""Used as a module of this package: others declare with Numba."""

RUN = """
import importlib.util, json, sys
import numpy as np
from pathlib import Path
from scenarionet_data.compiled import bare, shipped
shipped.FOLDER = Path(sys.argv[2])
spec = importlib.util.spec_from_file_location("scenarionet_data.made.kernels", sys.argv[1])
module = sys.modules[spec.name] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)
values, codes = np.arange(6.0), np.array([7, 0, 0, 0], np.uint8)
made = module.Columns(values, codes)
found = []
def note(call):
    try:
        result = call()
    except Exception as error:
        result = f"{type(error).__name__}: {error}"
    found.append([result, "numba" in sys.modules])
"""

SAME = """
note(lambda: module.total(made, 1.5))
note(lambda: module.total(made, 1.5))
note(lambda: module.divided(7, 2))
note(lambda: module.divided(7, 0))
print(json.dumps(found))
"""

OTHERS = {
    "an integer": "module.total(made, 1)",
    "every other element": "module.total(made._replace(values=np.arange(12.0)[::2]), 1.5)",
    "another dtype": "module.total(made._replace(values=values.astype(np.float32)), 1.5)",
    "a keyword": "module.total(made, factor=1.5)",
    "read-only": "values.flags.__setattr__('writeable', False) or module.total(made, 1.5)",
}


def test_numba_is_imported_by_no_module_that_declares_kernels_of_data():
    code = "import sys; from scenarionet_data import Samples, ScenarioLoader, convert; print('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout == "False\n"


def test_flags_of_linux_tell_the_same_levels_as_llvm():
    assert shipped.levels_by_flags() == shipped.levels_of_host()


@pytest.fixture(scope="module")
def shipped_at(tmp_path_factory):
    """Machine code of the kernels, where an installation has it."""
    folder = tmp_path_factory.mktemp("bare")
    (folder / "kernels.py").write_text(KERNELS)
    for level in shipped.levels_by_flags()[:1]:
        wait = "\nassert module.ones(3).sum() == 3"
        environment = {"NUMBA_CACHE_DIR": str(folder / "cache")}
        run(folder / "kernels.py", folder / "none", SAME.replace("print", wait + "\nprint"), environment)
        (caches,) = {file.parent for file in (folder / "cache").rglob("kernels.*.nbi")}
        shutil.copytree(caches, folder / "shipped" / level.cpu / "scenarionet_data.made")
    return folder


def run(file: Path, shipped_at: Path, code: str, environment: dict[str, str] | None = None) -> list[list[object]]:
    """Results of calls in a process of their own, and whether Numba was imported by then."""
    words = [sys.executable, "-c", RUN + code, str(file), str(shipped_at)]
    plain = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "SCENARIONET_PLAIN"))}
    done = subprocess.run(words, env=plain | (environment or {}), check=True, capture_output=True, text=True)
    found: list[list[object]] = json.loads(done.stdout)
    return found


def test_images_compute_and_raise_the_same_without_numba(shipped_at):
    expected = [52.0, 52.0, 3, "ZeroDivisionError: integer division by zero"]
    found = run(shipped_at / "kernels.py", shipped_at / "shipped", SAME)
    assert [result for result, _ in found] == expected
    assert [is_imported for _, is_imported in found[:3]] == [False] * 3


@pytest.mark.integration
def test_kernels_without_an_image_and_calls_after_it_use_numba(shipped_at):
    calls = "module.total(made, 1.5)", "module.ones(3).sum()", "module.total(made, 1.5)"
    code = "\n".join(f"note(lambda: {call})" for call in calls) + "\nprint(json.dumps(found))"
    found = run(shipped_at / "kernels.py", shipped_at / "shipped", code)
    assert found == [[52.0, False], [3.0, True], [52.0, True]]
    names = {file.name.split(".")[0] for file in (shipped_at / "shipped").rglob("*.bare")}
    assert names == {"total", "divided"}


@pytest.mark.integration
@pytest.mark.parametrize("what", OTHERS)
def test_other_arguments_use_numba(shipped_at, what):
    code = f"note(lambda: module.total(made, 1.5)); note(lambda: {OTHERS[what]})\nprint(json.dumps(found))"
    first, other = run(shipped_at / "kernels.py", shipped_at / "shipped", code)
    assert first == [52.0, False]
    assert other == [{"an integer": 37.0, "every other element": 97.0}.get(what, 52.0), True]


@pytest.mark.integration
@pytest.mark.parametrize("change", ["FACTOR = 2.0", "value * factor"])
def test_images_of_other_code_are_not_used(shipped_at, tmp_path, change):
    changed = tmp_path / "kernels.py"
    changed.write_text(KERNELS.replace(change, f"{change} * 2"))
    code = "note(lambda: module.total(made, 1.5))\nprint(json.dumps(found))"
    cache = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    assert run(changed, shipped_at / "shipped", code, cache) == [[97.0, True]]


@pytest.mark.integration
@pytest.mark.parametrize("name", ["NUMBA_CPU_NAME", "NUMBA_DISABLE_JIT", "SCENARIONET_PLAIN_NUMBA"])
def test_settings_of_numba_are_obeyed(shipped_at, tmp_path, name):
    value = {"NUMBA_CPU_NAME": "generic"}.get(name, "1")
    environment = {name: value, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    code = "note(lambda: module.divided(7, 2))\nprint(json.dumps(found))"
    assert run(shipped_at / "kernels.py", shipped_at / "shipped", code, environment) == [[3, True]]


@pytest.mark.integration
def test_damaged_images_are_not_run(shipped_at, tmp_path):
    """A changed byte of machine code ends the process, or computes something else."""
    whole = shipped_at / "shipped"
    (image,) = whole.rglob("divided.*.bare")
    size = image.stat().st_size
    code = "note(lambda: module.divided(7, 2))\nprint(json.dumps(found))"
    for place in (0, 40, size // 2, size - 1, None):
        damaged = tmp_path / f"at {place}"
        shutil.copytree(whole, damaged)
        content = bytearray(image.read_bytes())
        if place is None:
            del content[size // 2 :]
        else:
            content[place] ^= 1
        (damaged / image.relative_to(whole)).write_bytes(content)
        assert run(shipped_at / "kernels.py", damaged, code) == [[3, True]]
