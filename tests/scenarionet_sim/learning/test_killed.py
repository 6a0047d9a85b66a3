"""Processes that train and are killed with SIGKILL: the weights at the end are those of an undisturbed run."""

from __future__ import annotations

import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.storage.files.opening import open_files
from scenarionet_sim.drivers import checkpoints
from tests.fixtures.waiting import until

pytestmark = [pytest.mark.learn, pytest.mark.integration]
pytest.importorskip("torch", reason="no torch: run `make test-learn`")

SETTINGS = ("worlds=3", "horizon=20", "minibatch=32", "epochs=2", "hidden=16,16", "steps=3000", "checkpoint_every=2")


def begin(lake, name):
    """Start ``scenarionet train`` in a process."""
    words = [sys.executable, "-m", "scenarionet_pipelines.cli", "train", "ppo", str(lake.root), "--size", "small"]
    words += [word for setting in SETTINGS for word in ("-p", setting)]
    return subprocess.Popen([*words, "-p", "levels=2", "-p", "traffic=idm", "--name", name, "--quiet"])


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
    whole, parts = (checkpoints.load(files, name) for name in ("whole", "parts"))
    assert 5 <= begun < whole.number == parts.number == 25
    assert whole.facts["series"] == parts.facts["series"]
    for name, values in whole.arrays.items():
        np.testing.assert_array_equal(parts.arrays[name], values, err_msg=name)
