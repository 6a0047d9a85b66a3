"""Processes that train and are killed or meet each other: the weights at the end are those of an undisturbed run."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.storage import checkpoints
from scenarionet_data.storage.files.opening import open_files
from tests.fixtures.waiting import until

pytestmark = [pytest.mark.learn, pytest.mark.integration]
pytest.importorskip("torch", reason="no torch: run `make test-learn`")

SETTINGS = ("worlds=3", "horizon=20", "minibatch=32", "epochs=2", "hidden=16,16", "steps=3000", "checkpoint_every=2")


WITHOUT_LOCKS = """
import fcntl, runpy
def flock(*arguments): raise OSError("no locks")
fcntl.flock = flock
runpy.run_module("scenarionet_pipelines.cli", run_name="__main__", alter_sys=True)
"""


def begin(lake, name, program=("-m", "scenarionet_pipelines.cli")):
    """Start ``scenarionet train`` in a process."""
    words = [sys.executable, *program, "train", "ppo", str(lake.root), "--size", "small"]
    words += [word for setting in SETTINGS for word in ("-p", setting)]
    words += ["-p", "levels=2", "-p", "traffic=idm", "--name", name, "--quiet"]
    return subprocess.Popen(words, stderr=subprocess.PIPE, text=True)


def assert_equal_runs(files, *names):
    whole, parts = (checkpoints.load(files, name) for name in names)
    assert whole.number == parts.number == 25
    assert whole.facts["series"] == parts.facts["series"]
    assert list(whole.arrays) == list(parts.arrays)
    for name, values in whole.arrays.items():
        np.testing.assert_array_equal(parts.arrays[name], values, err_msg=name)


def test_a_run_killed_twice_ends_with_the_weights_of_an_undisturbed_run(drives, tmp_path):
    lake = Lake(shutil.copytree(drives, tmp_path / "lake"))
    files = open_files(lake.root)
    assert begin(lake, "whole").wait() == 0
    for wanted in (2, 5):
        process = begin(lake, "parts")
        until(lambda wanted=wanted: max(checkpoints.numbers(files, "parts"), default=0) >= wanted, "a checkpoint")
        process.kill()
        assert process.wait() == -signal.SIGKILL
    begun = max(checkpoints.numbers(files, "parts"))
    assert begin(lake, "parts").wait() == 0
    assert 5 <= begun < 25
    assert_equal_runs(files, "whole", "parts")


def test_a_second_process_is_refused_while_the_first_one_trains(drives, tmp_path):
    lake = Lake(shutil.copytree(drives, tmp_path / "lake"))
    files = open_files(lake.root)
    first = begin(lake, "run")
    until(lambda: checkpoints.numbers(files, "run"), "a checkpoint")
    second = begin(lake, "run")
    assert "another process trains it" in second.communicate()[1] and second.returncode == 1
    assert first.wait() == 0
    checkpoints.verify(files, "run")


@pytest.mark.parametrize("steps_apart", [0, 2])
def test_two_processes_without_locks_leave_the_run_of_one(drives, tmp_path, steps_apart):
    lake = Lake(shutil.copytree(drives, tmp_path / "lake"))
    files = open_files(lake.root)
    assert begin(lake, "whole").wait() == 0
    first = begin(lake, "run", ("-c", WITHOUT_LOCKS))
    until(lambda: max(checkpoints.numbers(files, "run"), default=0) >= steps_apart, "a checkpoint")
    second = begin(lake, "run", ("-c", WITHOUT_LOCKS))
    said = [process.communicate()[1] for process in (first, second)]
    assert sorted([first.returncode, second.returncode]) == [0, 1]
    assert "another process trains it, too" in "".join(said)
    checkpoints.verify(files, "run")
    assert_equal_runs(files, "whole", "run")
