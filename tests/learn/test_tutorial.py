"""The tutorial trains a model that is better than constant velocity."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from scenarionet_data import Lake, convert

pytestmark = pytest.mark.learn
pytest.importorskip("torch", reason="no torch: run `make test-learn`")
PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "train_a_forecaster.md"


def test_the_tutorial_beats_constant_velocity(tmp_path):
    convert("pg", "0:64", tmp_path / "lake")
    lake = Lake(tmp_path / "lake")
    lake.filter("ego_distance > 10", name="driven")
    lake.split("driven", {"train": 0.8, "val": 0.2}, seed=0)
    code = "\n".join(re.findall(r"```py\n(.*?)```", PAGE.read_text("utf-8"), re.DOTALL))
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    error = {name: float(value) for name, value in map(str.split, done.stdout.splitlines())}
    assert error["learned"] < 0.8 * error["constant"]
