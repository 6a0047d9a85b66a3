"""Old and new policies on the same scenarios: verdicts, what is not simulated again, and bad input."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.errors import BadParameter, SourceNotFound
from scenarionet_data.storage import evaluation_runs
from scenarionet_sim import RegressionPlan, evaluate, regress
from scenarionet_sim.evaluation.evaluation import plan_evaluation
from scenarionet_sim.evaluation.receipts import trajectory_digests
from scenarionet_sim.regression.judgement import judge
from scenarionet_sim.regression.outcomes import determinism_of, find_outcomes
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration

LATE = "tests.fixtures.late:Late"
ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def cut_ins(tmp_path_factory):
    lake = tmp_path_factory.mktemp("regress") / "lake"
    convert("logical", "cut_in", lake, version="v", options={"number": 150})
    Lake(lake).filter("true", name="cut_ins")
    return lake


@pytest.fixture
def generated(tmp_path):
    convert("pg", "0:12", tmp_path / "lake", version="v1")
    Lake(tmp_path / "lake").filter("true", name="all_of_it")
    return tmp_path / "lake"


def test_a_planner_that_brakes_late_is_found_and_what_is_known_is_not_simulated_again(cut_ins, monkeypatch):
    monkeypatch.chdir(ROOT)
    plan = RegressionPlan("careful-human", LATE, tracker="perfect")
    found = regress(cut_ins, "cut_ins", plan)
    judgement = found.judgement
    assert judgement.verdict == "worse" and judgement.primary.p_value < 0.01
    assert "crashed" in judgement.sentence()
    worst = judgement.clusters[0]
    assert worst.kind == "collision with a vehicle, ahead" and worst.failures[0].change < 0
    assert (found.old.simulated, found.new.simulated) == (150, 150)
    evaluate(cut_ins, Lake(cut_ins).database("cut_ins").scenario_ids[:1], policy="constant", name="steady")
    assert Lake(cut_ins).named_query("runs")["run"][0] == "steady", "after it those that were made beside"
    again = regress(cut_ins, "cut_ins", plan)
    assert (again.old.simulated, again.new.simulated) == (0, 0) and again.judgement == judgement


def test_equal_code_on_equal_scenarios_drives_alike_and_only_others_are_simulated(generated):
    """Part by part known, in other companies, from another snapshot: the same trajectories, bit by bit."""
    ids = [row[0] for row in Lake(generated).sql("SELECT scenario_id FROM metadata ORDER BY scenario_id").rows()]
    few = find_outcomes(plan_evaluation(generated, ids[::3], "constant-planner"))
    assert (few.determinism, few.simulated, few.reused) == ("deterministic", 4, 0)
    convert("pg", "12:14", generated, version="v1")
    every = find_outcomes(plan_evaluation(generated, None, "constant-planner"))
    assert (every.simulated, every.reused) == (10, 4) and every.runs[:1] == few.runs
    fresh = find_outcomes(plan_evaluation(generated, None, "constant-planner"), fresh=True)

    def driven(runs):
        files, found = Lake(generated).files, {}
        for name in runs:
            found |= trajectory_digests(evaluation_runs.rows(files, name, "rollouts"))
        return found

    assert len(driven(fresh.runs)) == 14 and driven(every.runs) == driven(fresh.runs)
    other = find_outcomes(plan_evaluation(generated, None, "constant-planner", traffic="idm"))
    assert other.reused == 0, "other conditions"
    convert("pg", "12:14", generated, version="v1", options={"density": 3.0}, replace=True)
    changed = find_outcomes(plan_evaluation(generated, None, "constant-planner"))
    assert (changed.simulated, changed.reused) == (2, 12), "other content under the same id"


def test_a_random_policy_is_found_and_simulated_each_time(generated, monkeypatch):
    monkeypatch.chdir(ROOT)
    evaluation = plan_evaluation(generated, "all_of_it", "tests.fixtures.late:Lots")
    assert determinism_of(evaluation) == "random, by more than its seed"
    assert determinism_of(plan_evaluation(generated, "all_of_it", "random")) == "random, by its seed"
    assert [find_outcomes(evaluation).simulated for _ in range(2)] == [12, 12]


def test_errors_of_a_planner_are_counted_and_the_rest_goes_on(generated, monkeypatch):
    monkeypatch.chdir(ROOT)
    found = regress(generated, "all_of_it", RegressionPlan("constant-planner", "tests.fixtures.late:Raises"))
    old, new = found.judgement.broken
    raised = [each for each in Lake(generated).database("all_of_it").scenario_ids if each[-1] in "123"]
    assert old == 0 and new == len(raised) > 0
    (worst,) = (each for each in found.judgement.clusters if each.kind == "could not be simulated")
    assert len(worst.failures) == new and "no idea" in worst.failures[0].error
    assert found.judgement.primary.scenarios == 12 and found.judgement.primary.change < 0


def test_bad_input_is_a_sentence(generated, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadParameter, match="nowhere:Mine: No module named 'nowhere'"):
        regress(generated, "all_of_it", RegressionPlan("idm", "nowhere:Mine"))
    with pytest.raises(SourceNotFound, match="no commit 'v9'"):
        regress(generated, "all_of_it", RegressionPlan("git:v9:mine:Mine", "idm"))
    Lake(generated).filter("false", name="empty", allow_empty=True)
    with pytest.raises(BadParameter, match="no scenarios, nothing to compare"):
        regress(generated, "empty", RegressionPlan("idm", "replay"))
    with pytest.raises(BadParameter, match="primary='speed'; choose from success"):
        regress(generated, "all_of_it", RegressionPlan("idm", "replay", primary="speed"))


def test_the_command_exits_with_the_verdict(generated):
    def regressed(*words):
        return run("runs", "regress", generated, "all_of_it", "--quiet", *words)

    same = regressed("--policy", "constant", "constant")
    assert same.exit_code == 0 and "new is no worse" in same.output
    worse = regressed("--policy", "idm", "random", "--primary", "route_completion", "--json")
    told = json.loads(worse.stdout)
    assert worse.exit_code == 1 and told["judgement"]["verdict"] == "worse"
    assert told["sentence"].startswith("new is significantly worse")
    unknown = regressed("--policy", "idm", "constant", "--level", "0.0001")
    assert unknown.exit_code == 2 and "undecided, about" in unknown.output
    assert regressed("--policy", "idm").exit_code == 2, "one policy"


@pytest.mark.integration
def test_the_command_says_which_requirements_cannot_be_installed(generated, tmp_path, monkeypatch):
    """Nothing is simulated and nothing left, and what the lake knows of the old policy serves the next attempt."""
    monkeypatch.setenv("SCENARIONET_CACHE", str(tmp_path / "cache"))
    monkeypatch.chdir(ROOT)
    words = ["runs", "regress", generated, "all_of_it", "--quiet", "--policy", "constant", LATE]
    assert "constant, deterministic: 12 simulated" in run(*words).output
    before = Lake(generated).sql("SELECT count(*) FROM results").item()
    (tmp_path / "asked.txt").write_text("--no-index\nno-such-package-of-anybody==1\n")
    for option in ("--old-python", "--new-python"):
        told = run(*words, option, tmp_path / "asked.txt")
        assert told.exit_code == 2 and told.stdout == ""
        (sentence,) = told.stderr.splitlines()
        assert "asked.txt: no environment can be made of it: ERROR: No matching distribution" in sentence
    assert Lake(generated).sql("SELECT count(*) FROM results").item() == before
    assert not [path for path in (tmp_path / "cache").rglob("*") if path.is_file()]
    assert "constant, deterministic: 0 simulated, 12 known before" in run(*words).output


@pytest.mark.long
def test_a_random_policy_against_itself_with_other_seeds_gives_few_false_alarms(tmp_path):
    convert("pg", "0:30", tmp_path / "lake", version="v1")
    lake, alarms = Lake(tmp_path / "lake"), []
    ids = [row[0] for row in lake.sql("SELECT scenario_id FROM metadata").rows()]
    for k in range(100):
        for seed in (2 * k, 2 * k + 1):
            evaluate(lake, policy="idm-sampled", seed=seed, name=f"seed{seed}", rollouts=False)
        judgement = judge(lake, ids, [f"seed{2 * k}"], [f"seed{2 * k + 1}"])
        assert judgement.primary.differing > 0
        alarms.append(judgement.verdict)
    assert alarms.count("worse") <= 5, alarms
