"""Runs of ``scenarionet sim`` in the format of the challenge, read back."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter, InvalidScenario
from scenarionet_data.scenario.description import ScenarioDescription, make_scenario_id, strings
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.metrics.wosac import (
    log_rollouts,
    read_submission,
    rollouts_of_run,
    score_submission,
    write_submission,
)
from scenarionet_sim.metrics.wosac.scoring import challenge_steps
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake


@pytest.fixture(scope="module")
def scenario() -> ScenarioDescription:
    """Two cars, of which the second is last seen at timestep 20, and one that comes too late to be simulated."""
    others = Other(30.0, vx=5.0, last=20), Other(60.0, 3.5, first=30)
    made = make_drive("abc", num_steps=91, others=others)
    tracks = replace(made.tracks, ids=strings(["12", "7", "9"]))
    name = make_scenario_id("waymo", "v1", "abc")
    origin = np.array([1000.0, -200.0, 30.0])
    return replace(made, id=name, dataset="waymo", origin=origin, tracks=tracks, ego_id="12", current_timestep=10)


@pytest.fixture(scope="module")
def lake(scenario: ScenarioDescription, tmp_path_factory: pytest.TempPathFactory) -> Lake:
    made = write_lake(tmp_path_factory.mktemp("run") / "lake", [scenario])
    evaluate(made, policy="constant-noisy", episode="wosac", num_rollouts=3, name="ours")
    evaluate(made, policy="replay", name="whole")
    return made


def test_submission_of_a_run_is_read_back_and_scored(lake: Lake, scenario: ScenarioDescription, tmp_path: Path):
    (ours,) = rollouts_of_run(lake, "ours")
    assert ours.scenario_id == "abc" and ours.object_ids.tolist() == [7, 12]
    assert ours.position.shape == (3, 2, 80, 3)
    ends = lake.sql("SELECT x[-1] AS x FROM rollouts WHERE run = 'ours' AND is_judged ORDER BY rollout")["x"]
    assert ours.position[:, 1, -1, 0] == pytest.approx(ends.to_numpy() + 1000.0)
    assert len(set(ends)) == 3, "the rollouts differ"
    seen = scenario.tracks.position[1, 20] + scenario.origin
    assert ours.position[:, 0, 9:] == pytest.approx(np.full((3, 71, 3), seen)), "held where it was last seen"
    write_submission(tmp_path / "ours.binproto", [ours])
    (again,) = read_submission(tmp_path / "ours.binproto")
    assert (again.position == ours.position).all() and (again.heading == ours.heading).all()
    report = score_submission(lake.root, tmp_path / "ours.binproto")
    assert report.broken == () and 0.0 < report.submitted.realism < 1.0
    assert report.note.startswith("1 of 1 scenarios have other than 32 rollouts, for example") and " 3: " in report.note
    whole = replace(report, scenarios=tuple(replace(each, num_rollouts=32) for each in report.scenarios))
    assert whole.note is None


def test_the_recording_as_rollouts_begins_a_step_after_the_present(scenario: ScenarioDescription):
    for now in (10, 11):
        found = log_rollouts(replace(scenario, current_timestep=now), 2)
        assert found.position.shape == (2, 2, 90 - now, 3)
        assert found.position[0, 1, 0, 0] == pytest.approx(1000.0 + now + 1.0), "the ego at 10 m/s"


def test_other_recordings_are_cut_and_drive_on(scenario: ScenarioDescription, tmp_path: Path):
    """The second car drives on at 5 m/s from where it is last seen, in the rollouts and in the recording as such."""
    ids = strings(["12", "P7", "9"])
    name = make_scenario_id("interaction", "v1", "abc")
    other = replace(scenario, id=name, dataset="interaction", tracks=replace(scenario.tracks, ids=ids))
    longer = replace(other, current_timestep=5)
    lake = write_lake(tmp_path / "lake", [longer])
    evaluate(lake, policy="replay", episode="wosac", name="ours")
    (ours,) = rollouts_of_run(lake, "ours")
    assert ours.scenario_id == name and ours.object_ids.tolist() == [-2, 12] and ours.position.shape[2] == 80
    recording = log_rollouts(challenge_steps(longer), 1)
    assert recording.position == pytest.approx(ours.position, abs=1e-3)
    assert ours.position[0, 0, -1, 0] == pytest.approx(other.tracks.position[1, 20, 0] + 1000.0 + 6.5 * 5.0, abs=1e-3)
    write_submission(tmp_path / "ours.binproto", [ours])
    (scored,) = score_submission(lake.root, tmp_path / "ours.binproto").scenarios
    assert scored.error is None and scored.submitted == scored.ceiling
    assert scored.submitted.rates["collision"] == 0.5, "the ego drives into the other one: both are scored"


def test_run_without_the_episode_of_the_challenge_is_refused(lake: Lake):
    with pytest.raises(InvalidScenario, match="expected 80 steps from timestep 10, found 90 from 0; simulate with the"):
        next(rollouts_of_run(lake, "whole"))
    with pytest.raises(BadParameter, match="run 'none' has no trajectories; simulate"):
        next(rollouts_of_run(lake, "none"))
