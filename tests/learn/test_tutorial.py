"""The tutorials: a forecaster that is better than constant velocity; a driver, its curve and its failures."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from scenarionet_data import Lake, convert

pytestmark = pytest.mark.learn
pytest.importorskip("torch", reason="no torch: run `make test-learn`")
TUTORIALS = Path(__file__).parents[2] / "docs" / "tutorials"


def test_the_tutorial_beats_constant_velocity(tmp_path):
    convert("pg", "0:64", tmp_path / "lake")
    lake = Lake(tmp_path / "lake")
    lake.filter("ego_distance > 10", name="driven")
    lake.split("driven", {"train": 0.8, "val": 0.2}, seed=0)
    code = "\n".join(
        re.findall(r"```py\n(.*?)```", (TUTORIALS / "train_a_forecaster.md").read_text("utf-8"), re.DOTALL)
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    error = {name: float(value) for name, value in map(str.split, done.stdout.splitlines())}
    assert error["learned"] < 0.8 * error["constant"]


def test_the_commands_that_train_a_driver_run(tmp_path):
    """With 8,192 steps in each training, and without the browser."""
    page = re.sub(r"steps=[\d_]+", "steps=8_192", (TUTORIALS / "train_a_driver.md").read_text("utf-8"))
    for language, code in re.findall(r"```(bash|sh|py)\n(.*?)```", page, re.DOTALL):
        if language == "py":
            commands = [["-c", code]]
        else:
            lines = [shlex.split(line)[1:] for line in code.splitlines() if "browse" not in line]
            commands = [["-m", "scenarionet_pipelines.cli", *words] for words in lines]
        for command in commands:
            done = subprocess.run([sys.executable, *command], cwd=tmp_path, capture_output=True, text=True, check=False)
            assert done.returncode == 0, (command, done.stderr)
            assert language != "py" or "arrive" in done.stdout
    runs = Lake(tmp_path / "lake").sql("SELECT DISTINCT run FROM training")["run"]
    assert set(runs) == {"first", "second", "careful"}
