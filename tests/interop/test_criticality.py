"""Criticality beside CommonRoad-CriMe 0.4.5 and ad-rss 5.0.0, run now on exported scenes: values and processor time."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.scenarionet_data.criticality.agreement import compare, rss_differences
from tests.scenarionet_data.criticality.scenes import scenes, write

ROOT = Path(__file__).parents[2]
PYTHON = ROOT / ".venv-interop" / "criticality" / "bin" / "python"

pytestmark = pytest.mark.interop


def test_values_and_speed(tmp_path):
    if not PYTHON.exists():
        pytest.fail("no .venv-interop/criticality: run `make test-interop`")
    compared = list(scenes())
    rng = np.random.default_rng(0)
    speeds = np.column_stack([rng.uniform(0, 40, (40, 2)), rng.uniform(-2, 2, (40, 2))]).round(3).tolist()
    write(tmp_path, compared, speeds)
    script = ROOT / "tests" / "interop" / "crime_answers.py"
    done = subprocess.run(
        [PYTHON, "-W", "ignore", script, tmp_path, tmp_path / "answers.json"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    answers = json.loads((tmp_path / "answers.json").read_text())
    found = compare(compared, answers["scenes"])
    assert len(compared) >= 20 and found.differences == []
    assert rss_differences(answers["rss"]) < 1e-6
    print(f"{found.ratio:,.0f} times as fast; {json.dumps(found.figures)}")
    assert found.ratio >= 1000
