"""Runs side by side, with hand-computed shares and differences."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter, QueryError
from scenarionet_data.schema import tables
from scenarionet_data.storage import evaluation_runs
from scenarionet_sim.evaluation.comparison import LOWER_IS_BETTER, METRICS, RunComparison, compare_runs, runs_in_words
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.evaluation.specification import RULE
from tests.fixtures.drives import make_drive
from tests.fixtures.lakes import write_lake

SCENARIOS = [make_drive(f"d{k}", speed=5.0 + k) for k in range(4)]
IDS = [scenario.id for scenario in SCENARIOS]


def publish(lake: Lake, run: str, rows: list[dict], **description) -> None:
    claimed = evaluation_runs.claim(lake.files, run, ("results",), description)
    claimed.publish(0, {"results": [{"rollout": 0} | row for row in rows]})


def row(number: int, score: float, cost: int = 0, **more) -> dict:
    done = {"scenario_id": IDS[number], "nuplan_score": score, "cost": cost, "success": cost == 0}
    return done | more


@pytest.fixture(scope="module")
def lake(tmp_path_factory) -> Lake:
    made = write_lake(tmp_path_factory.mktemp("runs") / "lake", SCENARIOS)
    publish(made, "before", [row(0, 0.5), row(1, 0.5), row(2, 1.0), row(3, 0.0, 2)])
    after = [row(0, 1.0), row(1, 0.0, 1), row(2, 0.0, rollout=0), row(2, 1.0, rollout=1)]
    publish(made, "after", [*after, {"scenario_id": IDS[3], "error": "lost"}])
    publish(made, "empty", [{"scenario_id": IDS[3], "error": "lost"}])
    return made


@pytest.fixture(scope="module")
def found(lake) -> RunComparison:
    return compare_runs(lake, "before", "after", "empty")


def test_means_have_their_number_of_scenarios_and_changes_are_paired(found):
    score = next(each for each in found.metrics if each.metric == "nuplan_score")
    assert score.means == (0.5, pytest.approx(0.5), None) and score.scenarios == (4, 3, 0)
    assert score.changes[0] is None and score.changes[2] is None
    assert (score.changes[1].mean, score.changes[1].scenarios) == (pytest.approx(-0.5 / 3), 3), "two rollouts are one"
    crashed = next(each for each in found.metrics if each.metric == "crashed")
    assert crashed.means == (0.25, pytest.approx(1 / 3), None)


def test_the_interval_is_students_over_the_scenarios(found):
    """Differences +0.5, -0.5, -0.5: mean -1/6, deviation 0.5774, and 4.3027 for two degrees of freedom."""
    score = next(each for each in found.metrics if each.metric == "nuplan_score")
    reach = 4.3027 * np.sqrt(1 / 3) / np.sqrt(3)
    change = score.changes[1]
    assert (change.low, change.high) == pytest.approx((-1 / 6 - reach, -1 / 6 + reach), abs=1e-4)


def test_scenarios_that_changed(lake):
    found = compare_runs(lake, "before", "after")
    assert found.better == ((IDS[0], 0.5),) and found.worse == ((IDS[1], -0.5), (IDS[2], -0.5))
    assert compare_runs(lake, "before", "after", judged_by="-cost").worse == ((IDS[1], -1.0),)


def test_the_verdict_counts_intervals_on_one_side_of_zero(tmp_path):
    """Crashes rise and scores fall in all scenarios; the completion of one route falls by far, of the others not."""
    lake = write_lake(tmp_path / "lake", SCENARIOS)
    publish(lake, "before", [row(k, 0.8, route_completion=1.0, average_displacement=2.0) for k in range(4)])
    after = [row(k, 0.5 + 0.01 * k, 1, route_completion=float(k > 0), average_displacement=1.0) for k in range(4)]
    publish(lake, "after", after)
    found = compare_runs(lake, "before", "after")
    assert found.verdict()[:2] == (("success", "crashed", "nuplan_score"), ("average_displacement",))
    assert found.verdict()[2] == sum(each.changes[1] is not None for each in found.metrics)
    assert compare_runs(lake, "after", "before").verdict()[0] == ("average_displacement",)


def test_which_way_is_better_agrees_with_the_schema():
    declared = {column.name: column.better for column in tables.load("results").columns if column.better}
    assert {name for name in METRICS if declared.get(name) == "lower"} <= LOWER_IS_BETTER
    assert not {name for name in METRICS if declared.get(name) == "higher"} & LOWER_IS_BETTER


def test_groups_by_expression_and_by_event(lake):
    by = compare_runs(lake, "before", "after", by="ego_mean_speed > 6.5")
    groups = {each.group: each.scenarios for each in by.metrics if each.metric == "success"}
    assert groups == {"all": (4, 3), "false": (2, 2), "true": (2, 1)}
    event = compare_runs(lake, "before", "after", event="hard_braking")
    assert {each.group for each in event.metrics} == {"all", "without hard_braking"}
    only = compare_runs(lake, "before", "after", where="ego_mean_speed > 7.5")
    assert only.metrics[0].scenarios == (1, 0)


def test_conditions_on_the_last_run(lake):
    found = compare_runs(lake, "before", "after")
    assert found.holds("crashed > 0.3 AND success_change < 0", lake)
    assert not found.holds("crashed > 0.34", lake)
    with pytest.raises(QueryError, match="crush"):
        found.holds("crush > 0", lake)
    with pytest.raises(BadParameter, match="'off_road > 0' is None, not true or false"):
        found.holds("off_road > 0", lake)


@pytest.mark.parametrize(
    ("runs", "words", "message"),
    [
        (("before",), {}, "1 runs to compare; give two or more different ones"),
        (("before", "before"), {}, "give two or more different ones"),
        (("before", "later"), {}, "the lake has no run 'later'; it has after, before, empty"),
        (("before", "after"), {"by": "dataset", "event": "cut_in"}, "not by both; leave one out"),
    ],
)
def test_what_cannot_be_compared(lake, runs, words, message):
    with pytest.raises(BadParameter, match=message):
        compare_runs(lake, *runs, **words)


def test_runs_of_an_older_rule_or_another_vehicle_model_are_not_compared_without_a_word(tmp_path):
    lake = write_lake(tmp_path / "lake", SCENARIOS)
    conditions = {"traffic": "idm", "episode": "log", "backend": "kinematic"}
    publish(lake, "older", [row(0, 0.5)], **conditions)
    publish(lake, "new", [row(0, 0.5)], **conditions, rule=RULE)
    publish(lake, "bullet", [row(0, 0.5)], **conditions | {"backend": "bullet"}, rule=RULE)
    (note,) = compare_runs(lake, "older", "new").notes
    assert "what is scored differs: older as in older versions" in note and f"new {RULE}" in note
    assert compare_runs(lake, "new", "bullet").notes == ("the vehicle model differs: new kinematic, bullet bullet",)


@pytest.mark.integration
@pytest.mark.parametrize(
    ("written", "rule"),
    [
        ("format-1", "as in older versions, see the guide"),
        ("format-3", "to the end of the episode, off the road only where the recording is on it"),
    ],
)
def test_a_run_that_an_earlier_version_wrote_is_compared_with_its_rule(tmp_path, written, rule):
    golden = Path(__file__).parents[2] / "golden" / "lakes" / written / "generated" / "lake"
    lake = Lake(shutil.copytree(golden, tmp_path / "lake"))
    evaluate(lake, policy="idm", name="now")
    noted = [note for note in compare_runs(lake, "driven", "now").notes if note.startswith("what is scored differs: ")]
    assert noted == [f"what is scored differs: driven {rule}, now {RULE}"]


def test_runs_that_were_made_beside_others_are_counted_and_listed_last():
    made = ["reference-idm-0123456789ab", "regression-0123456789ab-0000-01234567"]
    assert runs_in_words(["a", *made, "z"]) == "a, z, and 2 made by the software"
    assert runs_in_words(["a"]) == "a" and runs_in_words(made) == "and 2 made by the software"
    assert runs_in_words([]) == "none"
