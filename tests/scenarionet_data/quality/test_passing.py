"""Passing scenarios saved as a database, violations as a table."""

from __future__ import annotations

import pytest

from scenarionet_data.errors import DatabaseExists, EmptyResult
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.quality.passing import save_passing
from tests.fixtures.lakes import write_lake
from tests.fixtures.violations import changed, jump, sound


@pytest.fixture
def mixed(tmp_path, lenient):
    """Three valid scenarios, one that violates a hard rule, one that violates a soft one."""
    broken, doubtful = changed("tracks", heading=((0, 3), -4))(sound(1)), jump(sound(2))
    return write_lake(tmp_path, [broken, doubtful, *(sound(seed) for seed in (3, 4, 5))])


@pytest.mark.long
@pytest.mark.parametrize(("is_strict", "left"), [(False, [2, 3, 4, 5]), (True, [3, 4, 5])])
def test_passing_scenarios_become_a_database(is_strict, left, mixed):
    findings = run_checks(mixed)
    made = save_passing(findings, "good", strict=is_strict)
    assert made.scenario_ids == [sound(seed).id for seed in left]
    assert (made.lineage.operation, made.lineage.count, made.lineage.parents) == ("check", len(left), [])
    assert made.lineage.parameters["is_strict"] is is_strict
    again = mixed.sql(made.lineage.sql)
    assert again["scenario_id"].to_list() == made.scenario_ids
    assert again["content_hash"].to_list() == made.members["content_hash"].to_pylist()
    with pytest.raises(DatabaseExists):
        save_passing(findings, "good")
    assert save_passing(findings, "good", replace=True).version == 2


def test_without_hard_rules_every_scenario_passes(mixed):
    made = save_passing(run_checks(mixed, names=["nobody_teleports"]), "good")
    assert len(made) == 5
    assert mixed.sql(made.lineage.sql)["scenario_id"].to_list() == made.scenario_ids


@pytest.mark.long
def test_passing_members_of_a_database_keep_its_order(mixed):
    mixed.filter("NOT ends_with(scenario_id, '5')", name="some")
    made = save_passing(run_checks(mixed, "some"), "good")
    assert made.scenario_ids == [sound(seed).id for seed in (2, 3, 4)]
    assert made.lineage.parents == ["some@1"]


def test_empty_result_is_refused(mixed):
    mixed.filter("ends_with(scenario_id, '1')", name="bad")
    with pytest.raises(EmptyResult):
        save_passing(run_checks(mixed, "bad"), "good")
    assert mixed.databases == ["bad"]


def test_violations_are_returned_as_a_table(mixed):
    findings = run_checks(mixed, names=["headings_are_wrapped", "nobody_teleports"])
    assert [(row["check"], row["is_hard"], row["scenario_id"], row["split"]) for row in findings.rows.to_pylist()] == [
        ("headings_are_wrapped", True, sound(1).id, "train"),
        ("nobody_teleports", False, sound(2).id, "train"),
    ]
    assert findings.failing_ids().to_pylist() == [sound(1).id]
    assert sorted(findings.failing_ids(strict=True).to_pylist()) == [sound(1).id, sound(2).id]
    assert findings.totals.to_pylist() == [{"dataset": "made", "version": "v1", "split": "train", "scenarios": 5}]


def test_progress_is_reported(mixed):
    told = []
    run_checks(mixed, names=["ids_are_unique", "nobody_teleports"], on_progress=lambda *numbers: told.append(numbers))
    assert told == [(0, 2, 0), (1, 2, 0), (2, 2, 0)]
