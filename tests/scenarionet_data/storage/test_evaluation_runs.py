"""Evaluation runs in a lake: claimed once, published in parts, joined in SQL."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter, SchemaMismatch
from scenarionet_data.storage import evaluation_runs
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.integrity import seals
from tests.fixtures.lakes import write_lake
from tests.fixtures.scenarios import make_scenario

SCENARIOS = [make_scenario(seed, num_steps=11) for seed in range(3)]


@pytest.fixture
def lake(tmp_path) -> Lake:
    return write_lake(tmp_path / "lake", SCENARIOS)


def rollout(scenario_id: str) -> dict:
    facts = {"track_id": "t0", "object_type": "VEHICLE", "is_judged": True, "start": 0}
    return {"scenario_id": scenario_id} | facts | {name: [0.0, 1.0] for name in ("x", "y", "heading", "vx", "vy")}


def publish(run: evaluation_runs.EvaluationRun, part: int, scenario_id: str, cost: int) -> None:
    results = [{"scenario_id": scenario_id, "track_id": "t0", "cost": cost}]
    run.publish(part, {"rollouts": [rollout(scenario_id)], "results": results})


def test_results_join_with_metadata_and_rollouts(lake):
    run = evaluation_runs.claim(lake.files, "mine", ("rollouts", "results"), {"policy": "idm"})
    assert run.done() == set()
    for part, scenario in enumerate(SCENARIOS[:2]):
        publish(run, part, scenario.id, cost=part)
    assert run.done() == {0, 1}
    rows = lake.refresh().sql(
        "SELECT run, num_timesteps, cost, len(x) AS steps FROM results "
        "JOIN metadata USING (scenario_id) JOIN rollouts USING (run, scenario_id, track_id) ORDER BY cost"
    )
    assert rows.rows() == [("mine", 11, 0, 2), ("mine", 11, 1, 2)]


def test_views_are_empty_without_runs(lake):
    for table in evaluation_runs.RUN_TABLES:
        assert lake.sql(f"SELECT * FROM {table}").is_empty()
    assert evaluation_runs.names(lake.files) == []


def test_run_resumes_only_with_equal_parameters(lake):
    first = evaluation_runs.claim(lake.files, "mine", ("results",), {"policy": "idm", "backend": "Kinematic()"})
    assert evaluation_runs.claim(lake.files, "mine", ("results",), {"backend": "Kinematic()", "policy": "idm"}) == first
    with pytest.raises(BadParameter, match="'mine' exists with policy 'idm', not 'replay'; choose another name"):
        evaluation_runs.claim(lake.files, "mine", ("results",), {"policy": "replay", "backend": "Kinematic()"})
    with pytest.raises(BadParameter, match="not a valid name of a run"):
        evaluation_runs.claim(lake.files, "../mine", ("results",), {})


def test_part_is_done_once_its_last_table_is_published(lake):
    run = evaluation_runs.claim(lake.files, "mine", ("rollouts", "results"), {})
    run.publish(0, {"rollouts": [rollout(SCENARIOS[0].id)], "results": []})
    half = evaluation_runs.EvaluationRun(lake.files, "mine", ("rollouts",))
    half.publish(1, {"rollouts": [rollout(SCENARIOS[1].id)]})
    assert run.done() == {0}


def test_run_of_another_schema_is_named(tmp_path, lake):
    run = evaluation_runs.claim(lake.files, "old", ("results",), {})
    run.publish(0, {"results": []})
    description = tmp_path / "lake" / "results" / "old" / "run.json"
    place = lake.files.place("results/old/run.json")
    description.write_bytes(seals.seal_json({"tables": ["results/0"]}, place))
    with pytest.raises(SchemaMismatch, match=r"results/old: written under another version .* reads results/3"):
        Lake(tmp_path / "lake").sql("SELECT * FROM results")


def test_runs_written_before_rollouts_had_numbers_have_rollout_0(tmp_path):
    golden = Path(__file__).parents[2] / "golden" / "lakes" / "format-1" / "generated" / "lake"
    old = Lake(shutil.copytree(golden, tmp_path / "old"))
    for table in ("results", "rollouts"):
        assert old.sql(f"SELECT DISTINCT rollout FROM {table}")["rollout"].to_list() == [0]
    assert old.sql("SELECT DISTINCT crashed, nuplan_score FROM results").rows() == [(False, None)]


def test_runs_written_after_a_query_are_seen(lake):
    assert lake.sql("SELECT * FROM results").is_empty()
    publish(evaluation_runs.claim(lake.files, "late", ("rollouts", "results"), {}), 0, SCENARIOS[0].id, 0)
    assert lake.sql("SELECT run FROM results")["run"].to_list() == ["late"]


def test_runs_are_visible_from_every_snapshot(lake):
    run = evaluation_runs.claim(LocalLakeFiles(lake.root), "mine", ("rollouts", "results"), {})
    publish(run, 0, SCENARIOS[0].id, 0)
    older = Lake(lake.root, lake.snapshot.number)
    assert len(older.sql("SELECT * FROM results")) == 1
    assert older.snapshot == lake.snapshot
