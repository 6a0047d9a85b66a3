"""Verbs on a lake in an object store: the same as on one in a folder."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner

from scenarionet_pipelines.cli import cli

pytestmark = pytest.mark.long


def run(*words, code=0):
    result = CliRunner().invoke(cli, [str(word) for word in words])
    assert result.exit_code == code, result.output
    return result.output


@pytest.fixture
def lake(url):
    run("convert", "pg", "0:8", url, "--split", "train", "--workers", 2, "--quiet")
    run("filter", url, "--where", "num_objects > 1", "--name", "busy")
    return url


def test_databases_from_end_to_end(lake, tmp_path):
    assert json.loads(run("list", lake, "--json"))["lake"] == lake
    assert run("tables", "files", lake, "tracks").startswith(f"{lake}/tracks/dataset=pg/")
    assert "snapshot 1, 8 scenarios" in run("maintain", "doctor", lake)
    run("split", lake, "busy", "--fractions", "train=0.5", "val=0.5")
    run("db", "tag", lake, "crowded", "--where", "num_objects > 3")
    assert "crowded" in run("show", lake, "pg/v2/3")
    run("db", "rename", lake, "busy_val", "held_out")
    assert {d["name"] for d in json.loads(run("list", lake, "--json"))["databases"]} == {
        "busy",
        "busy_train",
        "held_out",
    }
    run("maintain", "check", lake, "busy")
    run("export", lake, "busy_train", tmp_path / "pickles")
    assert list((tmp_path / "pickles").rglob("sd_*.pkl"))
    run("pack", lake, "busy_train", tmp_path / "pack")
    run("pack", "--verify", tmp_path / "pack")


def test_simulation_stores_its_results_in_the_bucket(lake):
    run("sim", lake, "busy", "--policy", "idm", "--backend", "kinematic", "--quiet")
    found = json.loads(run("sql", lake, "SELECT count(*) AS n, count(DISTINCT run) AS runs FROM results", "--json"))
    assert "8" in json.dumps(found)
    again = run("sim", lake, "busy", "--policy", "idm", "--backend", "kinematic", "--quiet")
    assert "busy-idm" in again  # the existing results are reused


def test_dry_run_prints_the_plan(lake):
    assert "1 shard already in the lake" in run("convert", "pg", "0:8", lake, "--split", "train", "--dry-run")


def test_messages_name_the_url(url):
    assert f"no lake there; make one with `scenarionet convert DATASET RAW {url}`" in run("list", url, code=1)
