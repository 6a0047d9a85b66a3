"""Recorded scenarios with curves, driven to success by processes without anything of ours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioDescription, ScenarioLoader, convert
from scenarionet_sim.evaluation.evaluation import evaluate
from tests.ros.test_ros2 import link_of, stack

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module")
def recorded(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Lake:
    root = tmp_path_factory.mktemp("recorded") / "lake"
    for number in (0, 1, 3, 4):
        convert("scenarionet", recordings / "scenarionet" / f"nuscenes_{number}", root)
    return Lake(root)


@pytest.mark.parametrize("wire", ["dds", "zenoh"])
def test_recorded_scenarios_are_driven_to_success(recorded: Lake, wire: str) -> None:
    link_of(wire)
    loader = ScenarioLoader(recorded)
    with stack(wire):
        report = evaluate(recorded, policy=f"ros2:{wire}", name=wire)
    assert not report.broken
    where = f"run = '{wire}' AND success"
    driven = set(Lake(recorded.root).sql(f"SELECT scenario_id FROM results WHERE {where}")["scenario_id"].to_list())
    names = {each.rpartition("-")[2] for each in driven}
    assert names >= {"0061", "0103", "0553", "0655", "0916", "1100"}  # traffic is no concern of this driver
    turns = dict(zip(loader.scenario_ids, map(turned, loader), strict=True))
    assert sum(turns[each] > 60.0 for each in driven) >= 2, turns


def turned(scenario: ScenarioDescription) -> float:
    """How far the ego turns [degrees]."""
    tracks, row = scenario.tracks, scenario.ego_index
    heading = np.unwrap(tracks.heading[row, tracks.valid[row]])
    return float(np.degrees(np.ptp(heading)))
