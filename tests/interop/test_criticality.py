"""Criticality beside CommonRoad-CriMe 0.4.5 and ad-rss 5.0.0, run now on exported scenes: values and processor time.

``SCENARIONET_TEST_DATA`` adds recorded scenes, of which nothing is kept.
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, convert
from tests.scenarionet_data.criticality.agreement import compare, rss_differences
from tests.scenarionet_data.criticality.scenes import Compared, recorded, scenes, write

ROOT = Path(__file__).parents[2]
PYTHON = ROOT / ".venv-interop" / "criticality" / "bin" / "python"
SOURCES = {"scenarionet": "scenarionet", "waymo": "waymo/training", "gpudrive": "gpudrive",
           "argoverse2": "argoverse2/motion-forecasting/val", "interaction": "interaction"}  # fmt: skip
SMALLEST = 7

pytestmark = pytest.mark.interop


def asked(folder: Path, compared: list[Compared]) -> dict:
    """Answers of CommonRoad-CriMe and ad-rss."""
    if not PYTHON.exists():
        pytest.fail("no .venv-interop/criticality: run `make test-interop`")
    rng = np.random.default_rng(0)
    speeds = np.column_stack([rng.uniform(0, 40, (40, 2)), rng.uniform(-2, 2, (40, 2))]).round(3).tolist()
    write(folder, compared, speeds)
    done = subprocess.run(
        [PYTHON, "-W", "ignore", ROOT / "tests/interop/crime_answers.py", folder, folder / "answers.json"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads((folder / "answers.json").read_text())


def test_values_and_speed(tmp_path):
    compared = list(scenes())
    answers = asked(tmp_path, compared)
    found = compare(compared, answers["scenes"])
    assert len(compared) >= 20 and found.differences == []
    assert rss_differences(answers["rss"]) < 1e-6
    print(f"{found.ratio:,.0f} times as fast; {json.dumps(found.figures)}")
    assert found.ratio >= 1000


def test_values_of_recorded_scenes(recordings, tmp_path):
    for name, raw in SOURCES.items():
        convert(name, recordings / raw, tmp_path / "lake")
    met = sorted(recorded(Lake(tmp_path / "lake")), key=lambda each: len(each.scenario.map.feature_type))
    lists = [[each for each in met if (each.scenario.dataset == "interaction") is drone] for drone in (False, True)]
    compared = lists[0][:SMALLEST] + lists[1][::3]  # it copies the map for each measure
    found = compare(compared, asked(tmp_path, compared)["scenes"])
    assert len(compared) >= 20 and found.differences == []
    print(f"{found.ratio:,.0f} times as fast; {json.dumps(found.figures)}")
