"""Verbs about the scenarios of a database take the first of them, and simulations drive kept moments."""

from __future__ import annotations

import pytest

from scenarionet_data import Lake, ScenarioLoader
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


def first(lake, count):
    rows = Lake(lake).sql(f"SELECT scenario_id FROM metadata ORDER BY num_states DESC, scenario_id LIMIT {count}")
    return rows["scenario_id"].to_list()


def test_the_largest_are_simulated(lake, ok, as_json):
    wanted = first(lake, 2)
    given = ("--policy", "constant", "--no-references", "--workers", "1", "--metrics-only")
    made = as_json("sim", lake, "--order-by", "num_states DESC", "--limit", "2", *given)
    assert made["run"].startswith("all-first2-constant")
    found = Lake(lake).sql("SELECT scenario_id FROM results WHERE run = $run", {"run": made["run"]})
    assert sorted(found["scenario_id"]) == sorted(wanted)
    assert (
        "no column" in (bad := run("sim", lake, "--order-by", "nothing", *given)).stderr.lower() or bad.exit_code == 2
    )


def test_the_largest_are_exported(lake, ok, as_json, tmp_path):
    ok("filter", lake, "--name", "every")
    assert (
        as_json("export", lake, "every", tmp_path / "out", "--order-by", "num_states DESC", "--limit", "3")["scenarios"]
        == 3
    )
    names = "".join(path.name for path in (tmp_path / "out").rglob("*.pkl"))
    assert all(each.rpartition("/")[2] in names for each in first(lake, 3))


def test_kept_moments_are_driven_by_their_actor(lake, as_json):
    as_json("mine", lake, "closest_approach", "-p", "max=30", "--name", "near")
    given = ("--policy", "constant", "--no-references", "--workers", "1", "--metrics-only")
    made = as_json("sim", lake, "--from", "near", "--ego", "actor", "--order-by", "value", "--limit", "2", *given)
    sql = (
        "SELECT ego_id, extras ->> '$.moment.actor' AS actor FROM results JOIN metadata USING (scenario_id) "
        "WHERE run = $run"
    )
    rows = Lake(lake).sql(sql, {"run": made["run"]}).rows()
    assert len(rows) == 2
    assert all(ego == actor for ego, actor in rows)
    again = as_json("sim", lake, "--from", "near", "--ego", "actor", "--order-by", "value", "--limit", "2", *given)
    assert again["run"] == made["run"]


LARGEST = ("--order-by", "num_states DESC", "--limit", "3")


def test_the_largest_are_packed_sampled_split_and_embedded(lake, ok, as_json, tmp_path):
    wanted = first(lake, 3)
    packed = (
        as_json("pack", lake, "every", tmp_path / "pack", *LARGEST) if ok("filter", lake, "--name", "every") else {}
    )
    assert packed["reference"] == "every-first3-by-num_states-DESC@1"
    assert [each.id for each in ScenarioLoader(tmp_path / "pack", packed["reference"])] == wanted
    again = as_json("pack", lake, "every", tmp_path / "again", *LARGEST)
    assert again["reference"] == packed["reference"]  # the same scenarios in the same order are one database
    as_json("sample", lake, *LARGEST, "-n", "2", "--name", "two")
    assert set(Lake(lake).database("two").scenario_ids) < set(wanted)
    parts = as_json("split", lake, *LARGEST, "--fractions", "a=0.5", "b=0.5", "--name", "part", "--allow-empty")
    split = [each for part in parts.values() for each in Lake(lake).database(part["reference"]).scenario_ids]
    assert sorted(split) == sorted(wanted)
    as_json("db", "embed", lake, *LARGEST, "--name", "v")
    found = Lake(lake).sql("SELECT scenario_id FROM metadata WHERE v IS NOT NULL")
    assert sorted(found["scenario_id"]) == sorted(wanted)
    assert "--order-by and --limit" in run("vary", lake, "moments:near", "--name", "v", *LARGEST).stderr
    assert "--model" in run("forecast", "score", lake, tmp_path / "x.parquet", *LARGEST).stderr


def test_an_order_changes_which_database_is_packed(lake, ok, as_json, tmp_path):
    ok("filter", lake, "--name", "every")
    for direction in ("ASC", "DESC"):
        given = ("--order-by", f"num_states {direction}", "--limit", "2")
        reference = as_json("pack", lake, "every", tmp_path / direction, *given)["reference"]
        assert reference == f"every-first2-by-num_states-{direction}@1"


def test_occurrences_are_listed_in_an_order(lake, as_json):
    given = ("mine", lake, "closest_approach", "-p", "max=30")
    values = [row["value"] for row in as_json(*given)["rows"]]
    listed = as_json(*given, "--order-by", "value DESC", "--limit", "4")
    assert [row["value"] for row in listed["rows"]] == sorted(values, reverse=True)[:4]
    assert listed["hits"] == len(values)
    by_scenario = as_json(*given, "--order-by", "num_states DESC")["rows"]
    assert by_scenario[0]["scenario_id"] in first(lake, len(values))
    assert "no_such" in run(*given, "--order-by", "no_such").stderr
