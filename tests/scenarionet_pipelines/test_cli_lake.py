"""The verbs that query a lake, select from it, and export it."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import polars as pl
import pytest

from scenarionet_data import Lake
from scenarionet_pipelines.cli.output import cell, count, duration, print_json, size
from scenarionet_pipelines.messages import shorten
from tests.fixtures.made import NAME, write_raw
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


def test_list(lake, ok, as_json):
    ok("filter", lake, "--where", "num_objects > 2", "--name", "busy")
    text = ok("list", lake)
    assert "made     v1       train          9" in text
    assert "1 scenario in quarantine" in text
    assert "busy@1" in text
    assert "filter of the lake at snapshot 1" in text
    found = as_json("list", lake)
    assert found["splits"][0]["scenarios"] == 9
    assert found["quarantined"] == 1
    assert found["databases"][0]["reference"] == "busy@1"
    assert [snapshot["number"] for snapshot in found["snapshots"]] == [1]


def test_list_of_a_lake_without_scenarios(tmp_path, ok):
    raw = write_raw(tmp_path / "raw", {"a": ["1 invalid"]})
    assert run("convert", NAME, raw, tmp_path / "lake").exit_code == 1
    text = ok("list", tmp_path / "lake")
    assert "No scenarios yet" in text
    assert "1 scenario in quarantine" in text


def test_show(lake, ok, as_json):
    facts = as_json("show", lake, "made/v1/s000011")
    assert facts["scenario_id"] == "made/v1/s000011"
    assert "tracks_file" not in facts
    text = ok("show", lake, "s000011")  # the id in the source is accepted
    assert "ego_distance" in text
    assert "rad" in text
    several = run("show", lake, "s00000")
    assert "did you mean made/v1/s000001, made/v1/s000002" in several.stderr


def test_sql_as_table_json_and_csv(lake, ok, as_json):
    query = "SELECT scenario_id, num_objects, 'a, b' AS words, [1, 2] AS list, 0.0 / 0 AS nan FROM metadata ORDER BY 1"
    assert "made/v1/s000001" in ok("sql", lake, query)
    found = as_json("sql", lake, query)
    assert found["columns"] == ["scenario_id", "num_objects", "words", "list", "nan"]
    assert len(found["rows"]) == 9
    assert found["rows"][0]["list"] == [1, 2]
    assert found["rows"][0]["nan"] is None
    rows = list(csv.DictReader(io.StringIO(ok("sql", lake, query, "--csv"))))
    assert rows[0]["words"] == "a, b"
    assert json.loads(rows[0]["list"]) == [1, 2]


@pytest.mark.parametrize("suffix", ["parquet", "csv", "json"])
def test_sql_into_a_file(lake, suffix, tmp_path):
    path = tmp_path / f"rows.{suffix}"
    result = run("sql", lake, "SELECT scenario_id, num_objects FROM metadata", "-o", path)
    assert (result.exit_code, result.stdout) == (0, "")
    assert "9 rows" in result.stderr
    read = {"parquet": pl.read_parquet, "csv": pl.read_csv, "json": pl.read_json}[suffix]
    assert read(path).shape == (9, 2)


def test_sql_parameters_have_types(lake, as_json):
    query = "SELECT $number + 1 AS n, $text || '!' AS t"
    assert as_json("sql", lake, query, "-p", "number=41", "-p", "text=so")["rows"] == [{"n": 42, "t": "so!"}]


def test_sql_by_name(lake, ok, as_json):
    assert "quarantine_reasons" in ok("sql", lake)
    assert {"name", "doc", "parameters"} == set(as_json("sql", lake)["queries"][0])
    assert as_json("sql", lake, "summary")["rows"][0]["scenarios"] == 9
    assert len(as_json("sql", lake, "quarantine_reasons", "-p", "dataset=made")["rows"]) == 1
    assert as_json("sql", lake, "quarantine_reasons", "-p", "dataset=waymo")["rows"] == []


def test_sql_limits_printed_rows(lake):
    result = run("sql", lake, "SELECT * FROM range(250)")
    assert len(result.stdout.splitlines()) == 101
    assert "150 more rows" in result.stderr


def test_files(lake, ok, as_json):
    paths = ok("tables", "files", lake, "tracks").split()
    assert sum(pl.read_parquet(path).height for path in paths) == 9 * 5
    assert as_json("tables", "files", lake, "tracks")["files"] == paths


def test_filter(lake, ok, as_json):
    assert ok("filter", lake, "--where", "source_scenario_id < 's00001'", "--name", "few") == "few@1: 6 scenarios\n"
    text = ok("filter", lake, "--database", "few", "--filter", "object_count:min=2", "--filter", "speed", "--name", "x")
    assert text.startswith("x@1: ")
    assert text == "x@1: 6 scenarios\n"
    again = run("filter", lake, "--name", "few")
    assert again.exit_code == 1
    assert "--replace" in again.stderr
    found = as_json("filter", lake, "--name", "few", "--replace")
    assert (found["reference"], found["count"]) == ("few@2", 9)


def test_filters(ok, as_json):
    text = ok("info", "filters")
    assert "ego_distance:min=10,max=1e+09\n" in text
    assert {
        "name": "has_construction",
        "doc": "Scenarios with traffic cones or barriers.",
        "parameters": {},
    } in as_json("info", "filters")["filters"]
    columns = {column["name"] for column in as_json("info", "filters", "--columns")["columns"]}
    assert {"ego_distance", "objects_per_100m"} <= columns
    assert "tracks_file" not in columns
    assert "ego_distance [m]\n" in ok("info", "filters", "--columns")


@pytest.mark.parametrize(
    "words",
    [
        "--fractions train=0.5 val=0.5",
        "--fractions train=0.5 --fractions val=0.5",
        "--fractions=train=0.5 --fractions=val=0.5",
    ],
)
def test_split_with_every_spelling_of_fractions(words, lake, as_json):
    found = as_json("split", lake, "--seed", "3", *words.split(), "--by", "source_log", "--name", "p")
    assert [part["reference"] for part in found.values()] == ["p_train@1", "p_val@1"]
    assert sum(part["count"] for part in found.values()) == 9
    expected = Lake(lake).split(None, {"train": 0.5, "val": 0.5}, seed=3, by="source_log", name="again")
    assert {part: len(database) for part, database in expected.items()} == {
        part: facts["count"] for part, facts in found.items()
    }


@pytest.mark.filterwarnings("ignore:this split leaks")
def test_split_of_a_database(lake, ok):
    ok("filter", lake, "--name", "all")
    text = ok("split", lake, "all", "--fractions", "train=0.9", "val=0.1", "--replace")
    assert [line.split(":")[0] for line in text.splitlines()] == ["all_train@1", "all_val@1"]


def test_export_is_read_back(lake, tmp_path, ok, as_json):
    ok("filter", lake, "--where", "source_scenario_id < 's00001'", "--name", "few")
    assert ok("export", lake, "few", tmp_path / "pickles").startswith(f"{tmp_path / 'pickles'}: 6 scenarios, ")
    assert run("export", lake, "few", tmp_path / "pickles").exit_code == 1
    found = as_json("export", lake, "few", tmp_path / "pickles", "--replace", "--quiet")
    assert (found["scenarios"], found["format"], found["refused"]) == (6, "scenarionet", [])
    again = as_json("convert", "scenarionet", tmp_path / "pickles", tmp_path / "again", "--quiet")
    assert again["converted"] == 6


def test_check(lake, ok, as_json):
    ok("filter", lake, "--where", "source_scenario_id < 's00001'", "--name", "few")
    text = ok("maintain", "check", lake)  # the lanes of the fixture jump, which only --strict reports
    assert "ok        ids_are_unique" in text
    assert "successors_are_close: 9 scenarios, for example\n  made/v1/s000001" in text
    assert run("maintain", "check", lake, "--strict").exit_code == 1
    assert "successors_are_close: 6 scenarios" in ok("maintain", "check", lake, "few")
    (one,) = as_json("maintain", "check", lake, "--only", "ids_are_unique")["checks"]
    assert (one["is_met"], one["is_hard"]) == (True, True)
    assert run("maintain", "check", lake, "--only", "ids_are_uniqe").exit_code == 2


@pytest.mark.long
def test_scorecard(lake, ok, as_json, tmp_path):
    text = ok("maintain", "check", lake, "--scorecard", "-o", tmp_path / "card.csv")
    assert text.startswith("made/v1/train\n  holds    9 scenarios, 1 in quarantine\n")
    assert "no published counts for this split" in text
    assert "budgets  velocity_median 0.5, velocity_p99 5, " in text
    assert "doubtful  successors_are_close     9  100.00%  made/v1/s000001: " in text
    rows = pl.read_csv(tmp_path / "card.csv")
    assert rows.filter(pl.col("check") == "successors_are_close").select("broken", "share").row(0) == (9, 1.0)
    found = as_json("maintain", "check", lake, "--scorecard")
    (partition,) = found["scorecard"]["partitions"]
    assert (partition["scenarios"], partition["quarantined"], partition["budgets"]["outliers"]) == (9, 1, 0.01)
    assert {mark["check"] for mark in partition["rules"]} == {check["name"] for check in found["checks"]}
    assert run("maintain", "check", lake, "--scorecard", "--strict").exit_code == 1


@pytest.mark.parametrize(
    "suffix", ["parquet", pytest.param("csv", marks=pytest.mark.long), pytest.param("json", marks=pytest.mark.long)]
)
@pytest.mark.long
def test_check_separates_passing_and_failing_scenarios(lake, suffix, ok, tmp_path):
    ok("filter", lake, "--where", "source_scenario_id < 's00001'", "--name", "few")
    text = ok("maintain", "check", lake, "few", "--name", "good", "--broken", tmp_path / f"broken.{suffix}")
    assert text.endswith("good@1: 6 of 6 scenarios\n")
    read = {"parquet": pl.read_parquet, "csv": pl.read_csv, "json": pl.read_json}[suffix]
    rows = read(tmp_path / f"broken.{suffix}")
    assert rows["check"].unique().to_list() == ["successors_are_close"]
    assert rows["scenario_id"].to_list() == Lake(lake).database("few").scenario_ids
    assert run("maintain", "check", lake, "few", "--name", "good").exit_code == 1
    assert ok("maintain", "check", lake, "few", "--name", "good", "--replace").endswith("good@2: 6 of 6 scenarios\n")
    nothing = run("maintain", "check", lake, "few", "--name", "best", "--strict")
    assert nothing.exit_code == 2
    assert "no scenario is left of 6" in nothing.stderr


def test_check_rejects_unknown_file_formats(lake, tmp_path):
    for words in (("--scorecard", "-o", "card.txt"), ("--broken", "broken"), ("-o", "card.csv")):
        result = run("maintain", "check", lake, *words)
        assert result.exit_code == 2
        assert "--scorecard" in result.stderr or ".parquet, .csv, .json" in result.stderr


def test_check_names_missing_files(lake, ok):
    gone = Path(ok("tables", "files", lake, "tracks").split()[0])
    gone.unlink()
    result = run("maintain", "check", lake)
    assert result.exit_code == 1
    assert "FAILED    content_is_present" in result.stdout
    assert f"{gone.name} is gone" in result.stdout
    asked = run("sql", lake, "SELECT count(*) FROM tracks")
    assert asked.exit_code == 1
    assert "scenarionet maintain check" in asked.stderr


def test_converters(ok, as_json):
    assert "pg\n" in ok("info", "converters")
    found = {each["name"]: each for each in as_json("info", "converters")["converters"]}
    assert all({"raw", "licence", "release", "version"} <= set(each) for each in found.values()), found
    one = as_json("info", "converters", "tests.fixtures.made:Made")
    own = [option for option in one["options"] if option["name"] != "max_bad_rows"]
    assert own == [{"name": "num_objects", "type": "int", "default": 5, "doc": "Objects in each scenario."}]
    assert "Objects in each scenario." in ok("info", "converters", "tests.fixtures.made:Made")


def test_doctor(lake, tmp_path, ok, as_json):
    assert "snapshot 1, 9 scenarios" in ok("maintain", "doctor", lake)
    findings = as_json("maintain", "doctor", lake)["findings"]
    assert {finding["topic"] for finding in findings} == {"python", "packages", "converters", "machine", "lake"}
    file = tmp_path / "file"
    file.touch()
    assert run("maintain", "doctor", file).exit_code == 1


# --- output ---------------------------------------------------------------------------------------------------


def test_cells():
    assert [cell(v) for v in (None, 0.5, 1234567, 2.0, True, "a\n b", 10**15)] == [
        "-", "0.5", "1,234,567", "2", "True", "a b", "1000000000000000",
    ]  # fmt: skip
    assert shorten("abcdef", 4) == "abc…"


def test_quantities_are_formatted():
    assert [size(n) for n in (0, 999, 1_250_000, 3e15)] == ["0 B", "999 B", "1.25 MB", "3e+03 TB"]
    assert [duration(s) for s in (0.04, 59.6, 125, 7260)] == ["0.0 s", "59.6 s", "2 min 05 s", "2 h 01 min"]
    assert [count(n, "row") for n in (0, 1, 1000)] == ["0 rows", "1 row", "1,000 rows"]


def test_json_has_no_nan(capsys):
    print_json({"a": float("nan"), "b": [float("inf")], "c": {"d": {1}}})
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": [None], "c": {"d": [1]}}


def test_sql_asks_to_cast_what_cannot_be_printed(lake):
    result = run("sql", lake, "SELECT '2020-01-01 00:00:00.000000001'::TIMESTAMP_NS")
    assert result.exit_code == 2
    assert "cast it to VARCHAR" in result.stderr
