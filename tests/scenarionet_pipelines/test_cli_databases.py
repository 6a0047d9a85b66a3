"""The verbs that create, compare and manage databases."""

from __future__ import annotations

import json

import pytest

from scenarionet_data import Lake
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


@pytest.fixture
def two(lake, ok):
    """Databases low (s000001 to s000004, @2 of them) and high (s000003 and above)."""
    ok("filter", lake, "--where", "true", "--name", "low")
    ok("filter", lake, "--where", "source_scenario_id <= 's000004'", "--name", "low", "--replace")
    ok("filter", lake, "--where", "source_scenario_id >= 's000003'", "--name", "high")
    return lake


def test_filter_by_ids(lake, tmp_path, ok, as_json):
    (tmp_path / "ids.txt").write_text("made/v1/s000001\ns000002\n")
    words = ("--ids", tmp_path / "ids.txt", "--id", "made/v1/s000003")
    assert ok("filter", lake, *words, "--name", "three") == "three@1: 3 scenarios\n"
    unknown = run("filter", lake, "--id", "s00000", "--name", "x")
    assert unknown.exit_code == 1
    assert "1 of 1 ids are not in snapshot 1, for example s00000" in unknown.stderr
    assert run("filter", lake, "--ids", tmp_path / "none.txt", "--name", "x").exit_code == 1
    empty = run("filter", lake, "--where", "false", "--name", "x")
    assert empty.exit_code == 2
    assert "--allow-empty" in empty.stderr
    assert as_json("filter", lake, "--where", "false", "--name", "x", "--allow-empty")["count"] == 0


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_split_strategies(lake, ok, as_json):
    assert len(as_json("split", lake, "--levels", "3", "--name", "l")) == 3
    assert set(as_json("split", lake, "--each", "num_objects", "--name", "n")) == {"4", "5"}
    assert "(50.0%)" not in ok("split", lake, "--fractions", "a=0.7", "b=0.3", "--stratify", "has_z", "--name", "s")
    strict = run("split", lake, "--fractions", "a=0.5", "b=0.5", "--strict")
    assert strict.exit_code == 1
    assert "this split leaks" in strict.stderr
    assert run("split", lake, "--levels", "2", "--each", "city").exit_code == 2


@pytest.mark.filterwarnings("always")
def test_leak_is_a_one_line_warning(lake):
    result = run("split", lake, "--fractions", "a=0.5", "b=0.5")
    assert result.exit_code == 0
    (line,) = result.stderr.splitlines()
    assert line.startswith("warning: this split leaks: ")
    assert "--by source_log" in line
    assert Lake(lake).databases == ["all_a", "all_b"]


def test_sample(two, ok, as_json):
    assert ok("sample", two, "-n", "4", "--name", "few") == "few@1: 4 scenarios\n"
    found = as_json(
        "sample", two, "low", "--fraction", "0.5", "--seed", "3", "--weights", "num_objects", "--name", "half"
    )
    assert (found["count"], found["parameters"]["seed"]) == (2, 3)
    assert "only 4 can be drawn" in run("sample", two, "low", "-n", "5", "--name", "x").stderr


def test_sets(two, ok, as_json):
    text = ok("merge", two, "low", "high", "--name", "both")
    assert text == "both@1: 9 scenarios\nleft out: 2 repeated scenarios\n"
    assert as_json("merge", two, "low", "high", "--name", "both", "--replace")["repeated"] == 2
    assert ok("db", "intersect", two, "low", "high", "--name", "shared") == "shared@1: 2 scenarios\n"
    assert ok("db", "subtract", two, "low", "high", "--name", "rest") == "rest@1: 2 scenarios\n"
    assert as_json("db", "subtract", two, "low", "low", "--name", "none", "--allow-empty")["count"] == 0
    assert run("merge", two, "low", "--name", "x").exit_code == 2


def test_diff(two, ok, as_json):
    text = ok("db", "diff", two, "low@1", "low")
    assert text.startswith("low@1 -> low@2: 0 scenarios came, 5 scenarios went, 0 scenarios changed; 9 -> 4\n")
    assert "  went  made/v1/s000011\n" in text
    assert len(as_json("db", "diff", two, "low", "@1")["came"]) == 5
    assert as_json("db", "diff", two, "low", "low")["columns"] == []


@pytest.mark.long
def test_overlap(two, ok, as_json):
    text = ok("db", "overlap", two, "low", "high")
    assert "low@2 / high@1  same_scenario" in text
    assert as_json("db", "overlap", two, "low", "high", "--only", "same_scenario")["overlaps"][0]["num_first"] == 2
    assert run("db", "overlap", two, "low", "high", "--strict").exit_code == 1
    ok("db", "subtract", two, "low", "high", "--name", "rest")
    assert as_json("db", "overlap", two, "rest", "high", "--only", "same_scenario", "--strict")["is_clean"]


def test_lineage_is_a_tree(two, ok, as_json):
    ok("sample", two, "low", "-n", "2", "--seed", "7", "--name", "few")
    text = ok("db", "lineage", two, "few")
    assert text.startswith("few@1: 2 scenarios by sample, seed 7, snapshot 1, ")
    assert "\n    low@2: 4 scenarios by filter, snapshot 1, " in text
    assert "\n        versions 1, 2\n        used by few@1\n" in text
    detailed = ok("db", "lineage", two, "few", "--sql")
    assert "    $seed = 7\n" in detailed
    assert "source_scenario_id <= 's000004'" in detailed
    tree = as_json("db", "lineage", two, "few")
    assert tree["parents"][0]["lineage"]["operation"] == "filter"
    ok("db", "drop", two, "low", "--force")
    assert "    low@2: no longer in the lake\n" in ok("db", "lineage", two, "few")


def test_rebuild_and_rebase(two, ok, as_json):
    assert ok("db", "rebuild", two, "low") == "low@2: the same 4 scenarios in the same order\n"
    assert as_json("db", "rebuild", two, "low@1")["is_same"]
    assert ok("db", "rebase", two, "low") == "low is already on the newest snapshot\n"
    text = ok("db", "rebase", two, "low", "--keep-members")
    assert text == "low@2 -> low@3: 0 scenarios came, 0 scenarios went, 0 scenarios changed; 4 -> 4\n"
    assert as_json("db", "rebase", two, "low")["moved"] == []


def test_rename_copy_and_drop(two, ok, as_json):
    assert ok("db", "copy", two, "low@1", "everything") == "everything@1: 9 scenarios\n"
    assert run("db", "copy", two, "low", "everything").exit_code == 1
    assert run("db", "rename", two, "low", "high").exit_code == 1
    assert "scenarionet db copy" in run("db", "rename", two, "low", "deep").stderr  # all others depend on it
    assert ok("db", "rename", two, "high", "top") == "high -> top\n"
    assert as_json("db", "drop", two, "low@2") == {"dropped": "low@2"}
    assert "--force" in run("db", "drop", two, "low").stderr
    assert ok("db", "drop", two, "low", "--force") == "dropped low\n"
    assert Lake(two).databases == ["everything", "top"]


def test_checkout(two, ok):
    assert ok("db", "checkout", two, "low@1") == "low@3: 9 scenarios\n"
    assert run("db", "checkout", two, "low").exit_code == 2


def test_vary_from_a_file_and_options(lake, ok, as_json, tmp_path):
    file = tmp_path / "variation.toml"
    file.write_text('number = 3\nmethod = "sobol"\n[parameters]\n"ego.start" = [-0.1, 0.1]\n')
    ok("filter", lake, "--where", "source_scenario_id < 's00002'", "--name", "few")
    few = len(Lake(lake).database("few"))
    made = as_json("vary", lake, "few", "--name", "v", "--file", file, "-p", "ego.offset=0.5", "--quiet")
    assert made["converted"] + made["quarantined"] == 3 * few
    assert made["partitions"] == ["variation/v/train"]
    again = as_json("vary", lake, "few", "--name", "v", "--file", file, "-p", "ego.offset=0.5", "--quiet")
    assert again["converted"] + again["quarantined"] == 0
    fast = run("vary", lake, "few", "--name", "fast", "-p", "ego.speed=100", "--number", "2", "--json", "--quiet")
    assert fast.exit_code == 1 and json.loads(fast.stdout)["quarantined"] == 2 * few
    refused = run("vary", lake, "few", "--name", "w", "-p", "ego.speed=2:1")
    assert refused.exit_code == 2 and "ego.speed=2:1: wanted LOW:HIGH with LOW at most HIGH" in refused.stderr
    file.write_text("count = 3\n")
    assert "'count' = 3; wanted parameters, number" in run("vary", lake, "few", "--name", "w", "--file", file).stderr
