"""A lane keeper that has comma's msgq, opendbc and nothing of ours drives generated bends by its frames."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.building.resampling import cut_steps
from scenarionet_sim.bridges import stacks
from scenarionet_sim.evaluation.evaluation import evaluate
from tests.fixtures.lakes import write_lake
from tests.openpilot.conftest import needs_openpilot

pytestmark = [pytest.mark.openpilot, needs_openpilot]

STEPS = 51
BENDS = 3


@contextmanager
def keeper(fault: str = "") -> Iterator[None]:
    """The lane keeper, as long as it is needed."""
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    process = subprocess.Popen([sys.executable, str(Path(__file__).parent / "stack_keeper.py"), fault], env=environment)
    try:
        yield
    finally:
        process.kill()
        process.wait()


@pytest.fixture(scope="module")
def bends(tmp_path_factory: pytest.TempPathFactory, queues: None) -> Iterator[Lake]:
    """Drives of 5 s, each through the sharpest bend of a generated road of one lane."""
    root = tmp_path_factory.mktemp("openpilot")
    road = {"sequence": "SCSC", "density": 0.0, "min_lanes": 1, "max_lanes": 1}
    convert("pg", f"0:{BENDS}", root / "roads", options=road)
    cut = []
    for scenario in ScenarioLoader(root / "roads"):
        heading = np.unwrap(scenario.tracks.heading[scenario.ego_index])
        first = int(np.argmax(np.abs(heading[STEPS:] - heading[:-STEPS])))
        assert abs(heading[first + STEPS] - heading[first]) > 0.4
        cut.append(cut_steps(replace(scenario, current_timestep=first), slice(first, first + STEPS)))
    write_lake(root / "bends", cut)
    yield Lake(root / "bends")
    stacks.link(stacks.Stack.parse("openpilot:msgq")).transport.close()
    stacks.link.cache_clear()


def test_it_drives_bends_to_success(bends: Lake) -> None:
    with keeper():
        report = evaluate(bends, policy="openpilot:msgq", name="keeper")
    assert not report.broken
    ends = Lake(bends.root).sql("SELECT success FROM results WHERE run = 'keeper'")["success"].to_list()
    assert ends == [True] * BENDS


def test_without_its_steering_it_leaves_the_road(bends: Lake) -> None:
    """The bends are what the test above says."""
    evaluate(bends, policy="constant-planner", name="straight")
    ends = Lake(bends.root).sql("SELECT success FROM results WHERE run = 'straight'")["success"].to_list()
    assert ends == [False] * BENDS


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("dies", "did not answer"),
        ("silent", "did not answer"),
        ("nan", "expected finite numbers"),
        ("old", "messages had other stamps"),
        ("disengages", "has disengaged"),
        ("half", "are no message of it"),
    ],
)
def test_a_fault_is_a_sentence(bends: Lake, monkeypatch: pytest.MonkeyPatch, fault: str, reason: str) -> None:
    monkeypatch.setattr(stacks.link(stacks.Stack.parse("openpilot:msgq")), "limit", 3.0)
    one = next(iter(ScenarioLoader(bends.root))).id
    with keeper(fault):
        report = evaluate(bends, (one,), policy="openpilot:msgq", name=f"fault-{fault}")
    assert [error for _, error in report.broken if reason in error], report.broken


def test_a_flood_of_old_commands_hides_no_new_one(bends: Lake) -> None:
    one = next(iter(ScenarioLoader(bends.root))).id
    with keeper("flood"):
        assert not evaluate(bends, (one,), policy="openpilot:msgq", name="flood").broken
