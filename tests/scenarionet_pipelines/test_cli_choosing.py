"""Verbs about the scenarios of a database take the first of them, and simulations drive kept moments."""

from __future__ import annotations

import pytest

from scenarionet_data import Lake
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
