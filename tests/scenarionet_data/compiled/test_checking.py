"""Calls of kernels without type dispatch: with the check of the tests, no other types get through."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import NamedTuple

import numpy as np
import pytest

from scenarionet_data.compiled import checking
from scenarionet_data.compiled.checking import unchecked
from scenarionet_data.compiled.decorators import kernel


class Rows(NamedTuple):
    values: np.ndarray
    factor: float


def new_kernel():
    @kernel(allocates=False)
    def total(rows, offset):
        result = offset
        for value in rows.values:
            result += value * rows.factor
        return result

    return total


VALUES = np.array([1.0, 2.0, 3.0])
FROZEN = VALUES.copy()
FROZEN.flags.writeable = False


@pytest.mark.parametrize(
    ("rows", "offset", "message"),
    [
        (Rows(VALUES.astype(np.int64), 2.0), 0.0, "array\\(int64"),
        (Rows(VALUES.astype(np.float32), 2.0), 0.0, "array\\(float32"),
        (Rows(np.arange(6.0)[::2], 2.0), 0.0, "array\\(float64, 1d, A\\)"),
        (Rows(np.ones((3, 1)), 2.0), 0.0, "array\\(float64, 2d"),
        (Rows(FROZEN, 2.0), 0.0, "readonly array"),
        (Rows(VALUES, 2), 0.0, "int64"),
        ((VALUES, 2.0), 0.0, "Tuple\\(array"),
        (Rows(VALUES, 2.0), 1, r"total\(\): argument 1 is int64, but the kernel was compiled for float64"),
    ],
    ids=["int64", "float32", "strided", "2-D", "read-only", "int", "tuple", "scalar"],
)
def test_call_with_other_types_than_compiled_raises(rows, offset, message):
    total = new_kernel()
    assert unchecked(total)(Rows(VALUES, 2.0), 0.0) == unchecked(total)(Rows(VALUES, 2.0), 0.0) == 12.0
    with pytest.raises(TypeError, match=message):
        unchecked(total)(rows, offset)


def test_kernel_with_a_second_signature_raises():
    total = new_kernel()
    unchecked(total)(Rows(VALUES, 2.0), 0.0)
    total(Rows(np.arange(3), 2.0), 0.0)  # an ordinary call
    with pytest.raises(TypeError, match=r"total\(\) was compiled for several types"):
        unchecked(total)(Rows(VALUES, 2.0), 0.0)


def test_without_the_check_the_entry_itself_is_called(monkeypatch):
    monkeypatch.setattr(checking, "_IS_CHECKING", False)
    total = new_kernel()
    assert unchecked(total) is total
    total(Rows(VALUES, 2.0), 0.0)
    assert unchecked(total) is getattr(total, "only_entry", total)
    assert unchecked(total)(Rows(VALUES, 2.0), 1.0) == 13.0


DRIVE = """
import hashlib, sys
import numpy as np
from scenarionet_data import ScenarioLoader, convert
from scenarionet_sim import BirdView, Kinematic, Scenarios, ScenarioNetVectorEnv
from scenarionet_data.compiled import checking
from scenarionet_data.scenario.content_hash import content_hash

convert("pg", "0:2", sys.argv[1])
digest = hashlib.sha256()
loader = ScenarioLoader(sys.argv[1])
for scenario in [*loader, *loader]:
    digest.update(str(content_hash(scenario)).encode())
sensors = (BirdView(),)
envs = ScenarioNetVectorEnv(2, scenarios=Scenarios(sys.argv[1]), sensors=sensors, backend=Kinematic())
envs.reset(seed=0)
for _ in range(20):
    observed, rewards, *_ = envs.step(np.full((2, 2), 0.1))
    digest.update(observed.tobytes() + rewards.tobytes())
print(checking._IS_CHECKING, digest.hexdigest())
"""


@pytest.mark.integration
def test_results_are_equal_with_and_without_the_check(tmp_path):
    def run(value):
        command = [sys.executable, "-c", DRIVE, str(tmp_path / value)]
        environment = os.environ | {checking.CHECK: value}
        done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
        return done.stdout.split()

    (is_checking, expected), (is_checking_not, found) = run("1"), run("0")
    assert (is_checking, is_checking_not) == ("True", "False")
    assert found == expected
