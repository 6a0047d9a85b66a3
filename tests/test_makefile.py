"""``make`` lists its targets and names missing settings."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from scenarionet_data import Lake
from tests.fixtures import nuplan, nuplan_drive

ROOT = Path(__file__).parents[1]


def make(*words: str, **environment: str) -> subprocess.CompletedProcess[str]:
    clean = {k: v for k, v in os.environ.items() if k not in ("SCENARIONET_RAW", "NUPLAN_DATA_ROOT", "MAKEFLAGS")}
    return subprocess.run(
        ["make", "--no-print-directory", *words], cwd=ROOT, env=clean | environment, capture_output=True, text=True,
        check=False,
    )  # fmt: skip


def test_make_without_target_lists_every_target():
    listed = make().stdout.splitlines()
    targets = re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert [line.split()[1] for line in listed] == targets
    assert all(len(line.split()) > 3 for line in listed)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "set DATASET"),
        (["DATASET=waymo"], "set RAW=FOLDER, or SCENARIONET_RAW to the folder that holds waymo/"),
        (["DATASET=nuplan"], "NUPLAN_DATA_ROOT"),
    ],
)
def test_convert_names_missing_settings_in_one_line(words, says):
    done = make("-n", "convert", *words)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert says in line


@pytest.mark.parametrize(
    ("words", "environment", "command"),
    [
        ("DATASET=pg RAW=0:200", {}, "convert 'pg' '0:200' 'lake'"),
        ("DATASET=waymo", {"SCENARIONET_RAW": "/raw"}, "convert 'waymo' '/raw/waymo' 'lake'"),
        ("DATASET=nuplan", {"NUPLAN_DATA_ROOT": "/nuplan"}, "convert 'nuplan' '/nuplan' 'lake'"),
        ("DATASET=pg RAW=0:9 LAKE=other SPLIT=val WORKERS=3 ARGS=--reconvert-stale", {},
         "convert 'pg' '0:9' 'other' --split 'val' --workers '3' --reconvert-stale"),
    ],
)  # fmt: skip
def test_convert_calls_the_command_line(words, environment, command):
    done = make("-n", "convert", *words.split(), **environment)
    assert done.returncode == 0, done.stderr
    assert command in " ".join(done.stdout.replace("\\\n", " ").split())


@pytest.mark.integration
def test_nuplan_is_converted_by_make(tmp_path):
    lake = tmp_path / "lake"
    raw = nuplan.write_raw(tmp_path / "nuplan", [nuplan_drive.invented(seconds=6.0, num_tracks=8)], scene_seconds=3.0)
    folder = Path(sys.executable).parent
    done = make("-o", "install", "convert", "DATASET=nuplan", f"RAW={raw}", f"LAKE={lake}", f"BIN={folder}")
    assert done.returncode == 0, done.stderr
    assert len(Lake(lake).select()) > 0


HOOK = ROOT / ".ci" / "hooks" / "commit-msg"


@pytest.mark.parametrize(
    ("subject", "says"),
    [
        ("Compile kernels once", None),
        ("Merge branch 'main' of somewhere into a branch whose name is longer than all that the rule allows", None),
        ("Compile " + "kernels " * 9, "79 characters, at most 72"),
        ("wip", "imperative"),
        ("Fixed the loader", "imperative"),
        ("Fix the loader.", "without a full stop"),
    ],
)
def test_hook_checks_subjects(tmp_path, subject, says):
    message = tmp_path / "message"
    message.write_text(f"{subject.strip()}\n\nA body, which may be as long as it likes.\n# a comment\n")
    done = subprocess.run([HOOK, message], capture_output=True, text=True, check=False)
    assert done.returncode == (says is not None)
    assert (says or "") in done.stdout


def test_subjects_are_checked_since_the_tag_and_not_without_one(tmp_path):
    identity = ["-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "core.hooksPath="]

    def git(*words):
        subprocess.run(["git", *identity, *words], cwd=tmp_path, check=True, capture_output=True)

    def check():
        return subprocess.run([HOOK], cwd=tmp_path, capture_output=True, text=True, check=False)

    def commit(subject):
        git("commit", "--allow-empty", "-m", subject)

    assert (check().returncode, "no git repository" in check().stdout) == (0, True)
    git("init")
    commit("wrong before the release")
    assert (check().returncode, "no tag v0.2.0" in check().stdout) == (0, True)
    git("tag", "v0.2.0")
    assert (check().returncode, check().stdout) == (0, "")
    commit("Compile kernels once")
    assert check().returncode == 0
    commit("wrong since then")
    assert (check().returncode, "wrong since then" in check().stdout) == (1, True)


def test_old_python_is_refused_with_a_message(tmp_path):
    old = tmp_path / "old-python"
    old.write_text('#!/bin/sh\nexec python3 -c "import sys; sys.version_info = (3, 9, 2); exec(sys.argv[2])" "$@"\n')
    old.chmod(0o755)
    text = (ROOT / "Makefile").read_text()
    copy = tmp_path / "Makefile"
    copy.write_text(text)
    (tmp_path / "pyproject.toml").touch()
    done = subprocess.run(
        ["make", "install", f"PYTHON={old}"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "is Python 3.9, 3.11 or newer is needed: make install PYTHON=python3.11" in done.stderr
    assert not (tmp_path / ".venv").exists()
