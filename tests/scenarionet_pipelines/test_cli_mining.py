"""The verbs that mine events, compare databases and add columns."""

from __future__ import annotations

import json

import pytest

from scenarionet_data import Lake
from scenarionet_data.operations.moments import event, relation
from scenarionet_data.query.named_sql import EVENTS
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


def test_mine(lake, ok, as_json):
    found = as_json("mine", lake, "closest_approach", "-p", "max=30", "--limit", "2")
    assert (found["event"], len(found["rows"])) == ("closest_approach", 2)
    assert found["hits"] > 2
    assert set(found["rows"][0]) == {
        "scenario_id", "track_id", "other_id", "first_timestep", "last_timestep", "value",
    }  # fmt: skip
    result = run("mine", lake, "closest_approach", "--limit", "3")
    assert len(result.stdout.splitlines()) == 4
    assert " occurrences in " in result.stderr
    ok("filter", lake, "--where", "source_scenario_id < 's00001'", "--name", "few")
    few = as_json("mine", lake, "closest_approach", "--database", "few")
    assert 0 < few["scenarios"] <= 6
    assert run("mine", lake, "near_mis").exit_code == 2
    assert "near_miss" in run("mine", lake, "near_mis").stderr
    assert "has no parameter 'far'" in run("mine", lake, "near_miss", "-p", "far=1").stderr


def test_mine_says_how_often(lake, as_json, ok):
    found = as_json("mine", lake, "closest_approach", "-p", "max=30")
    meters, seconds = Lake(lake).sql("SELECT sum(ego_distance), sum(duration) FROM metadata").row(0)
    assert found["per_1000_km"]["rate"] == pytest.approx(found["hits"] / meters * 1e6)
    assert found["per_hour"]["low"] < found["hits"] / seconds * 3600 < found["per_hour"]["high"]
    assert "per 1,000 km of the egos (95 %: " in run("mine", lake, "closest_approach").stderr


def test_mine_moments_of_a_file(lake, tmp_path, ok, as_json):
    path = tmp_path / "moments.toml"
    path.write_text("[close]\ndoc = 'Near each other.'\nwhen = 'near_objects(distance_thresh=8.0).lasting(0.5)'\n")
    moments = relation("near_objects", {"distance_thresh": 8.0}).lasting(0.5)
    assert as_json("mine", lake, "close", "--definitions", path)["rows"] == Lake(lake).moments(moments).to_dicts()
    assert ok("mine", lake, "close", "--definitions", path, "--explain").strip() == moments.sql
    assert ok("mine", lake, "hard_braking", "--explain").strip() == event("hard_braking").sql
    assert "Near each other." in ok("mine", lake, "--definitions", path)
    assert "it defines close" in run("mine", lake, "far", "--definitions", path).stderr


def test_mine_keeps_moments(lake, tmp_path, ok, as_json):
    path = tmp_path / "moments.toml"
    path.write_text("[close]\nwhen = 'near_objects(distance_thresh=8.0).lasting(0.5)'\n")
    first = as_json("mine", lake, "close", "--definitions", path, "--name", "mine")["definitions"]
    hits = len(Lake(lake).moments(relation("near_objects", {"distance_thresh": 8.0}).lasting(0.5)))
    scenarios = len(Lake(lake))
    assert first == [{"definition": "close", "version": 1, "scenarios": scenarios, "moments": hits}]
    assert (
        "SELECT * FROM moments WHERE name = 'mine'"
        in run("mine", lake, "hard_braking", "stationary", "--name", "mine").stderr
    )
    again = as_json("mine", lake, "--name", "mine")["definitions"]
    assert [(each["definition"], each["scenarios"]) for each in again] == [
        ("close", 0),
        ("hard_braking", 0),
        ("stationary", 0),
    ]
    kept = dict(Lake(lake).sql("SELECT DISTINCT definition, parameters FROM moments_rows").rows())
    assert kept["close"] == "{}"
    assert json.loads(kept["hard_braking"]) == EVENTS.load("hard_braking").defaults
    assert "mine close and far one by one" in run("mine", lake, "close", "far").stderr
    assert "-p is for one event" in run("mine", lake, "near_miss", "stationary", "-p", "a=1", "--name", "x").stderr
    assert "no moments are kept under the name 'none'; there are: mine" in run("mine", lake, "--name", "none").stderr


def test_mine_without_an_event_lists_them(lake, ok, as_json):
    text = ok("mine", lake)
    assert "cut_in:max_gap=30,min_speed=2,within=4" in text
    assert "Source: Hayward 1972" in " ".join(text.split())
    listed = as_json("mine", lake)["events"]
    assert [event["name"] for event in listed] == EVENTS.names()


def test_filter_by_event(lake, ok):
    hits = json.loads(ok("mine", lake, "closest_approach", "-p", "max=15", "--json"))
    text = ok("filter", lake, "--event", "closest_approach:max=15", "--name", "close")
    assert text == f"close@1: {hits['scenarios']} scenarios\n"


def test_tag_adds_lists_and_drops_user_columns(lake, ok, as_json, tmp_path):
    assert "no user columns" in ok("db", "tag", lake)
    assert ok("db", "tag", lake, "crowded", "--where", "num_objects > 3") == "crowded@1: bool for 9 of 9 scenarios\n"
    ok("db", "tag", lake, "approaches", "--event", "closest_approach")
    ok("db", "tag", lake, "tracks_seen", "--sql", "SELECT scenario_id, count(*) FROM tracks GROUP BY 1")
    (tmp_path / "scores.csv").write_text("scenario_id,score\nmade/v1/s000001,0.5\n")
    made = as_json("db", "tag", lake, "score", "--file", tmp_path / "scores.csv", "--column", "score")
    assert (made["reference"], made["type"], made["count"]) == ("score@1", "double", 1)
    listed = as_json("db", "tag", lake)["user_columns"]
    assert {layer["name"] for layer in listed} == {"crowded", "approaches", "tracks_seen", "score"}
    assert "scores.csv" in ok("db", "tag", lake)
    assert ok("filter", lake, "--where", "score > 0.1", "--name", "scored") == "scored@1: 1 scenario\n"
    assert ok("db", "tag", lake, "--drop", "crowded") == "dropped crowded\n"
    refused = run("db", "tag", lake, "--drop", "score")
    assert (refused.exit_code, "scored@1 uses score@1; drop those first" in refused.stderr) == (1, True)
    assert as_json("db", "tag", lake, "--drop", "score@1", "--force") == {"dropped": "score@1"}
    assert {layer["name"] for layer in as_json("db", "tag", lake)["user_columns"]} == {"approaches", "tracks_seen"}


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["x"], 2, "expected one of --where"),
        (["--where", "true"], 2, "the column needs a NAME"),
        (["x", "--drop", "y"], 2, "--drop NAME takes no other option"),
        (["x", "--where", "true", "--force"], 2, "--drop NAME takes no other option"),
        (["--drop", "y"], 2, "no user column 'y'; user columns: none yet"),
        (["x", "--where", "true", "--sql", "SELECT 1"], 2, "expected one of --where"),
        (["x", "--where", "true", "--column", "y"], 2, "--column requires --file"),
        (["ego_id", "--where", "true"], 2, "choose another name"),
        (["x", "--file", "gone.csv"], 2, "no such file"),
        (["x", "--sql", "SELECT 'nobody' AS scenario_id, 1 AS v"], 1, "ids look like made/v1/"),
        (["x", "--sql", "DROP VIEW metadata"], 2, "only reads"),
    ],
)
def test_invalid_user_columns_are_rejected(lake, words, code, message):
    result = run("db", "tag", lake, *words)
    assert result.exit_code == code
    assert message in result.stderr


def test_stats(lake, ok, as_json, tmp_path):
    ok("filter", lake, "--where", "source_scenario_id < 's00001'", "--name", "few")
    lines = ok("db", "stats", lake, "few").splitlines()
    assert lines[0].split() == ["few@1"]
    assert lines[1].split() == ["scenarios", "6"]
    assert any(line.startswith("track length [m]") and "±" in line for line in lines)
    (whole,) = as_json("db", "stats", lake)["databases"]
    assert (whole["name"], whole["count"], whole["measures"][0]["measure"]) == ("lake", 9, "track length")
    pytest.importorskip("matplotlib", reason="the extra `plots` is not installed")
    result = run("db", "stats", lake, "few", "-o", tmp_path / "stats.png")
    assert (result.exit_code, result.stdout) == (0, "")
    assert (tmp_path / "stats.png").stat().st_size > 1000
