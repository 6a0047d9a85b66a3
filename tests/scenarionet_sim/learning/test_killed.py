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
from scenarionet_data.storage.files.places import open_files
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


def end(process):
    """Wait for a process; return its exit code and its messages."""
    messages = process.communicate()[1]
    return process.returncode, messages


@pytest.fixture(scope="module")
def finished(drives, tmp_path_factory):
    """A lake with a finished run, ``whole``."""
    lake = Lake(shutil.copytree(drives, tmp_path_factory.mktemp("finished") / "lake"))
    assert end(begin(lake, "whole"))[0] == 0
    return lake.root


def stopped(lake, name, at, program=("-m", "scenarionet_pipelines.cli")):
    """Start a run and stop its process after a checkpoint."""
    process = begin(lake, name, program)
    files = open_files(lake.root)
    until(lambda: max(checkpoints.numbers(files, name), default=0) >= at, "a checkpoint")
    process.send_signal(signal.SIGSTOP)
    assert max(checkpoints.numbers(files, name)) < 24
    return process


def assert_equal_runs(files, *names):
    whole, parts = (checkpoints.load(files, name) for name in names)
    assert whole.number == parts.number == 25
    assert whole.facts["series"] == parts.facts["series"]
    assert list(whole.arrays) == list(parts.arrays)
    for name, values in whole.arrays.items():
        np.testing.assert_array_equal(parts.arrays[name], values, err_msg=name)


def test_a_run_killed_twice_ends_with_the_weights_of_an_undisturbed_run(finished, tmp_path):
    lake = Lake(shutil.copytree(finished, tmp_path / "lake"))
    files = open_files(lake.root)
    for wanted in (2, 5):
        process = stopped(lake, "parts", wanted)
        process.kill()
        assert end(process)[0] == -signal.SIGKILL
    assert end(begin(lake, "parts"))[0] == 0
    assert_equal_runs(files, "whole", "parts")


def test_a_second_process_is_refused_while_the_first_one_trains(finished, tmp_path):
    lake = Lake(shutil.copytree(finished, tmp_path / "lake"))
    first = stopped(lake, "run", 1)
    code, messages = end(begin(lake, "run"))
    assert code == 1 and "another process trains it now" in messages
    first.send_signal(signal.SIGCONT)
    assert end(first)[0] == 0
    assert_equal_runs(open_files(lake.root), "whole", "run")


def test_two_processes_without_locks_leave_the_run_of_one(finished, tmp_path):
    lake = Lake(shutil.copytree(finished, tmp_path / "lake"))
    first = stopped(lake, "run", 2, ("-c", WITHOUT_LOCKS))
    assert end(begin(lake, "run", ("-c", WITHOUT_LOCKS)))[0] == 0
    first.send_signal(signal.SIGCONT)
    code, messages = end(first)
    assert code == 1 and "another process trains it, too" in messages
    checkpoints.verify(open_files(lake.root), "run")
    assert_equal_runs(open_files(lake.root), "whole", "run")
