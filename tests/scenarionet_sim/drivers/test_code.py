"""Policies of commits, files and other environments, each in a process of its own."""

from __future__ import annotations

import os
import stat
import subprocess
import sys

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.errors import BadParameter, SourceNotFound, WorkerLost
from scenarionet_sim import evaluate
from scenarionet_sim.drivers.code import PolicyCode, pinned_code, policy_name
from scenarionet_sim.drivers.own_process import OwnProcess, executor_of
from scenarionet_sim.evaluation.receipts import make_receipt, verify

PLANNER = """
import numpy as np
from speeds import SPEED
from scenarionet_sim import Planner, Trajectory

class Mine(Planner):
    frame = "ego"
    def act(self, view):
        print("a planner may print")
        times = np.arange(1, 41) * view.dt
        return Trajectory(np.column_stack([SPEED * times, 0 * times, 0 * times]), times)
"""


def git(*words: str) -> str:
    names = ["-c", "user.name=x", "-c", "user.email=x"]
    return subprocess.run(["git", *names, *words], check=True, capture_output=True, text=True).stdout.strip()


@pytest.fixture
def repository(tmp_path, monkeypatch):
    """A repository with a planner in a folder, slow in the first commit and fast in the second."""
    root = tmp_path / "repository"
    (root / "planners").mkdir(parents=True)
    monkeypatch.chdir(root / "planners")
    monkeypatch.setenv("SCENARIONET_CACHE", str(tmp_path / "cache"))
    git("init", "-q", "-b", "main", "..")
    (root / "planners" / "mine.py").write_text(PLANNER)
    for name, speed in (("slow", 1.0), ("fast", 5.0)):
        (root / "planners" / "speeds.py").write_text(f"SPEED = {speed}\n")
        git("add", "-A")
        git("commit", "-qm", name)
        git("tag", name)
    return root


def test_a_policy_of_a_commit_is_pinned_and_written_to_a_cache(repository):
    commit = git("rev-parse", "slow")
    pinned = f"git:{commit}:planners/mine:Mine"
    assert pinned_code("git:slow:mine:Mine") == pinned_code("mine:Mine@slow") == pinned
    assert pinned_code(pinned) == pinned, "also outside of the folder"
    code = PolicyCode.of(pinned)
    assert code is not None and code.reference == "mine:Mine" and code.folder == code.root / "planners"
    assert (code.folder / "speeds.py").read_text() == "SPEED = 1.0\n"
    assert policy_name(pinned) == f"mine.Mine-{commit[:8]}"
    file = pinned_code("mine.py:Mine")
    assert file == f"{repository}/planners/mine.py:Mine" and policy_name(file) == "mine.Mine"
    assert pinned_code("runs/trained@12") == "runs/trained@12" and PolicyCode.of("mine:Mine") is None


def test_bad_code_is_a_sentence(repository, monkeypatch, tmp_path):
    with pytest.raises(SourceNotFound, match="no commit 'nowhere'"):
        pinned_code("git:nowhere:mine:Mine")
    with pytest.raises(BadParameter, match="expected git:REF:module:Class"):
        pinned_code("git:main:mine")
    with pytest.raises(SourceNotFound, match=r"there is no file .*other\.py"):
        pinned_code("other.py:Mine")
    with pytest.raises(BadParameter, match="not on a cluster"):
        executor_of(f"{repository}/planners/mine.py:Mine", "", 1, OwnProcess(()))
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SourceNotFound, match="not a git repository"):
        pinned_code("git:main:mine:Mine")


@pytest.mark.integration
def test_old_and_new_share_no_modules(repository, tmp_path):
    lake = tmp_path / "lake"
    convert("pg", "0:2", lake, version="v1")
    for name, policy in (("old", "git:slow:mine:Mine"), ("new", "git:fast:mine:Mine"), ("file", "mine.py:Mine")):
        report = evaluate(lake, policy=policy, name=name, workers=2 if name == "new" else 1, tracker="perfect")
        assert not report.broken
    speeds = dict(Lake(lake).sql("SELECT run, max(mean_speed) FROM results GROUP BY run").rows())
    assert speeds["old"] < 1.5 and speeds["new"] == speeds["file"] > 4.0
    receipt = make_receipt(lake, "old")
    assert receipt.description["policy"] == f"git:{git('rev-parse', 'slow')}:planners/mine:Mine"
    assert verify(lake, "old").first is None
    (repository / "planners" / "speeds.py").write_text("SPEED = 2.0\n")
    with pytest.raises(BadParameter, match="a run 'file' exists with code"):
        evaluate(lake, policy="mine.py:Mine", name="file", tracker="perfect")


@pytest.mark.integration
def test_what_happens_in_the_other_process_is_said(repository, tmp_path):
    lake = tmp_path / "lake"
    convert("pg", "0:1", lake, version="v1")
    (repository / "planners" / "broken.py").write_text("1 / 0\n")
    with pytest.raises(BadParameter, match=r"broken:Mine: its module raised ZeroDivisionError"):
        evaluate(lake, policy="broken.py:Mine")
    with pytest.raises(BadParameter, match="has no attribute 'Other'"):
        evaluate(lake, policy="git:slow:mine:Other")
    (repository / "planners" / "dies.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGKILL)\n")
    with pytest.raises(WorkerLost, match="exit status -9"):
        evaluate(lake, policy="dies.py:Mine")
    with pytest.raises(BadParameter, match="expected a Python interpreter"):
        evaluate(lake, policy="mine.py:Mine", python="/nowhere/python")
    other = tmp_path / "python"
    other.write_text(f'#!/bin/sh\nPYTHONPATH= exec {os.path.realpath(sys.executable)} -I "$@"\n')
    other.chmod(other.stat().st_mode | stat.S_IXUSR)
    with pytest.raises(BadParameter, match="has no working scenarionet-lake"):
        evaluate(lake, policy="mine.py:Mine", python=str(other))
