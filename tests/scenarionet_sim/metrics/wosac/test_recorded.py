"""Scores and features equal the owner's, on the scenario and submission that come with the owner's code."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.errors import SourceError
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_sim.metrics import wosac
from scenarionet_sim.metrics.wosac import scoring
from scenarionet_sim.metrics.wosac.features import Features, Surroundings, compute_features
from scenarionet_sim.metrics.wosac.likelihood import ScoredFeature, histogram

OWNERS_TEST = {
    "linear_speed": histogram(0.0, 30.0, 10, 1.0),
    "linear_acceleration": histogram(0.0, 5.0, 10, 1.0),
    "angular_speed": histogram(0.0, 1.0, 10, 1.0),
    "angular_acceleration": histogram(0.0, 0.3, 10, 1.0),
    "distance_to_nearest_object": histogram(-5.0, 100.0, 10, 1.0),
    "collision": ScoredFeature(1.0),
    "time_to_collision": histogram(0.0, 5.0, 10, 1.0),
    "distance_to_road_edge": histogram(-5.0, 15.0, 10, 1.0),
    "offroad": ScoredFeature(1.0),
    "traffic_light_violation": ScoredFeature(1.0),
}
CONFIGURATIONS = {
    "challenge_2025": wosac.SIM_AGENTS_2025,
    "challenge_2024": wosac.SIM_AGENTS_2024,
    "test_config": OWNERS_TEST,
}
NAMES = {"collision": "collision_indication", "offroad": "offroad_indication"}
PER_STEP = {name: f"{name}_per_step" for name in ("collision", "offroad", "traffic_light_violation")}


@pytest.fixture(scope="module")
def lake(recordings: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    lake = tmp_path_factory.mktemp("wosac") / "lake"
    convert("waymo", recordings / "waymo" / "training", lake)
    return lake


@pytest.fixture(scope="module")
def scenario(lake: Path) -> ScenarioDescription:
    return Lake(lake).loader()[0]


@pytest.fixture(scope="module")
def submission(recordings: Path) -> wosac.ScenarioRollouts:
    (rollouts,) = wosac.read_submission(recordings / "wosac" / "test_submission.binproto")
    return rollouts


@pytest.fixture(scope="module")
def golden(recordings: Path) -> dict[str, Any]:
    return json.loads((recordings / "wosac" / "golden.json").read_text())


@pytest.mark.parametrize("configuration", CONFIGURATIONS)
@pytest.mark.parametrize("source", ["test_submission", "log_replay_x32"])
def test_scores(
    scenario: ScenarioDescription,
    submission: wosac.ScenarioRollouts,
    golden: dict[str, Any],
    source: str,
    configuration: str,
):
    rollouts = submission if source == "test_submission" else wosac.log_rollouts(scenario)
    found = wosac.score(scenario, rollouts, CONFIGURATIONS[configuration])
    expected, groups = golden[source][configuration], golden[source][f"{configuration}_buckets"]
    assert found.realism == pytest.approx(expected["metametric"], abs=1e-4)
    for name, value in found.likelihoods.items():
        assert value == pytest.approx(expected[f"{NAMES.get(name, name)}_likelihood"], abs=1e-4), name
    for name, value in found.groups.items():
        assert value == pytest.approx(groups[f"{name}_metrics"], abs=1e-4), name
    assert found.ade == pytest.approx(expected["average_displacement_error"], abs=1e-4)
    assert found.min_ade == pytest.approx(expected["min_average_displacement_error"], abs=1e-4)
    for name, value in found.rates.items():
        assert value == expected[f"simulated_{name}_rate"], name


# Coordinates of 8 km are exact to 0.5 mm as float32, which the owner's code computes in.
TOLERANCE = {"linear_acceleration": 0.05, "linear_speed": 0.005, "distance_to_road_edge": 0.006}


@pytest.mark.parametrize("which", ["log", "sim"])
def test_features(recordings: Path, scenario: ScenarioDescription, submission: wosac.ScenarioRollouts, which: str):
    rows = scoring._simulated_rows(scenario, submission)
    motions = dict(zip(("log", "sim"), scoring._motions(scenario, submission, rows, 11), strict=True))
    ids = [scenario.ego_id, *(name for name, _ in scenario.tracks_to_predict)]
    evaluated = np.flatnonzero(np.isin(scenario.tracks.ids[rows].tolist(), ids))
    found = compute_features(motions[which], evaluated, Surroundings.of(scenario), 0.1).since(11)
    expected = np.load(recordings / "wosac" / "features_test_submission.npz")
    valid = expected[f"{which}_valid"]
    for name in Features._fields:
        wanted, values = expected[f"{which}_{PER_STEP.get(name, name)}"], getattr(found, name)
        if values.dtype == np.bool_:
            assert (values == wanted).all(), name
        else:
            assert (np.isnan(values) == np.isnan(wanted))[valid].all(), name
            assert values[valid] == pytest.approx(wanted[valid], abs=TOLERANCE.get(name, 1e-3), nan_ok=True), name


def test_the_recording_itself_is_no_perfect_score(scenario: ScenarioDescription):
    ceiling = wosac.score(scenario, wosac.log_rollouts(scenario))
    floor = wosac.score(scenario, wosac.constant_velocity_rollouts(scenario))
    assert floor.realism < ceiling.realism < 0.6
    assert wosac.mean_score([ceiling, floor]).realism == pytest.approx((ceiling.realism + floor.realism) / 2)


def test_submissions_round_trip(submission: wosac.ScenarioRollouts, tmp_path: Path):
    wosac.write_submission(tmp_path / "ours.binproto", [submission, submission])
    for again in wosac.read_submission(tmp_path / "ours.binproto"):
        assert again.scenario_id == submission.scenario_id
        assert (again.object_ids == submission.object_ids).all()
        assert (again.position == submission.position).all()
        assert (again.heading == submission.heading).all()


def test_report_of_a_submission(
    recordings: Path, scenario: ScenarioDescription, submission: wosac.ScenarioRollouts, lake: Path, tmp_path: Path
):
    unknown = replace(submission, scenario_id="0")
    wosac.write_submission(tmp_path / "two.binproto", [unknown, submission])
    seen: list[tuple[int, int, int]] = []
    report = wosac.score_submission(lake, tmp_path / "two.binproto", on_progress=lambda *steps: seen.append(steps))
    assert seen == [(1, 2, 1), (2, 2, 2)]
    assert [each.scenario_id for each in report.scenarios] == ["0", scenario.id]
    assert report.broken == (("0", "the lake has no scenario 0; convert the recordings that hold it"),)
    assert report.submitted == wosac.score(scenario, submission)
    assert report.floor.realism < report.submitted.realism < report.ceiling.realism


def test_generated_scenarios_are_scored_whole(scenario: ScenarioDescription, lake: Path, tmp_path: Path):
    wosac.write_submission(tmp_path / "log.binproto", [wosac.log_rollouts(scenario, 4, generated=True)])
    report = wosac.score_submission(lake, tmp_path / "log.binproto", "scenario-generation-2025")
    assert report.submitted == report.ceiling
    assert report.floor.realism < report.ceiling.realism
    with pytest.raises(SourceError, match="expected 80 steps, found 91"):
        wosac.score_submission(lake, tmp_path / "log.binproto")
