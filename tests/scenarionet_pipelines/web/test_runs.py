"""Runs beside the recording, as the server sends them: motion, crashes, times off the road; histograms and clips."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from io import BytesIO
from urllib.parse import urlencode

import numpy as np
import pytest
from PIL import Image

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter, QueryError, UnsafeSql
from scenarionet_data.operations.moments import relation
from scenarionet_data.variations import MomentChoice, cut_moments
from scenarionet_pipelines.web import choices
from scenarionet_pipelines.web.choices import all_columns, moments_of, source
from scenarionet_pipelines.web.histograms import MAX_BINS, read_histogram
from scenarionet_pipelines.web.questions import TIMELINE_EVENTS, OpenLake
from scenarionet_pipelines.web.rows import PageQuery, columns, read_page
from scenarionet_pipelines.web.runs import runs_of
from scenarionet_sim.evaluation.specification import RULE
from tests.scenarionet_pipelines.web.test_packing import unpack
from tests.scenarionet_pipelines.web.test_server import request, said

pytestmark = pytest.mark.integration


def ask(address, what, **parameters):
    return request(address, f"/api/{what}?{urlencode(parameters)}")


def packed(address, scenario_id, run):
    status, _, body = ask(address, "run", id=scenario_id, run=run)
    assert status == 200, body
    return unpack(body)


def test_runs_of_a_scenario_have_their_results(driven, address):
    for scenario_id in driven.sql("SELECT DISTINCT scenario_id FROM results")["scenario_id"]:
        status, listed = said(ask(address, "runs", id=scenario_id))
        assert status == 200
        assert listed == json.loads(json.dumps(runs_of(driven, scenario_id)))
        wanted = driven.sql("SELECT count(*) AS n FROM results WHERE scenario_id = $id", {"id": scenario_id})
        assert len(listed) == wanted["n"].item()
        assert {each["rule"] for each in listed} == {RULE}


def test_motion_is_that_of_the_table(driven, address):
    rows = driven.sql("SELECT * FROM rollouts WHERE run = 'straight'")
    for row in rows.iter_rows(named=True):
        header, arrays = packed(address, row["scenario_id"], "straight")
        (place,) = [k for k, track in enumerate(driven_ids(driven, row["scenario_id"])) if track == row["track_id"]]
        np.testing.assert_array_equal(arrays["position"][place, :, 0], np.float32(row["x"]))
        np.testing.assert_array_equal(arrays["velocity"][place, :, 1], np.float32(row["vy"]))
        assert arrays["time"][0] == pytest.approx(0.1 * row["start"])
        assert (place in header["judged"]) == row["is_judged"]
        assert set(header["judged"]) <= set(header["driven"])


def driven_ids(lake, scenario_id):
    return [str(name) for name in lake.loader([scenario_id])[0].tracks.ids]


def test_first_crash_is_that_of_the_results(driven, address):
    rows = driven.sql("SELECT * FROM results WHERE run = 'straight'")
    assert rows["cost"].sum() > 0, "something is hit"
    for row in rows.iter_rows(named=True):
        header, arrays = packed(address, row["scenario_id"], "straight")
        crashes = [event["first"] for event in header["events"] if event["kind"] == "crash"]
        assert bool(crashes) == (row["cost"] > 0)
        if crashes:
            assert crashes[0] - arrays["time"][0] == pytest.approx(row["first_collision"], abs=0.11)


def test_time_off_the_road_is_that_of_the_results(driven, address):
    rows = driven.sql("SELECT * FROM results WHERE run = 'straight' AND off_road_time > 0")
    assert len(rows), "something leaves the road"
    for row in rows.iter_rows(named=True):
        header, _ = packed(address, row["scenario_id"], "straight")
        away = [event for event in header["events"] if event["kind"] == "off_road"]
        seconds = sum(event["last"] - event["first"] + 0.1 for event in away)
        assert seconds >= row["off_road_time"] - 0.05, "the results end with the recording, the run may not"


def test_log_replay_drives_nothing_else(driven, address):
    """Replayed traffic moves as recorded; only the evaluated vehicle counts as driven."""
    for scenario_id in driven.sql("SELECT DISTINCT scenario_id FROM results")["scenario_id"]:
        header, _ = packed(address, scenario_id, "straight")
        assert header["driven"] == header["judged"]


@pytest.mark.parametrize("run", ["nothing", "straight:7", "straight:x", "", "'; DROP TABLE results;--"])
def test_unknown_runs_are_an_error(driven, address, run):
    scenario_id = driven.sql("SELECT scenario_id FROM results LIMIT 1")["scenario_id"].item()
    status, answer = said(ask(address, "run", id=scenario_id, run=run))
    assert status == 400
    assert "no rollout" in answer["error"] or "expected a number" in answer["error"]


def test_events_are_those_that_are_mined(driven, address):
    scenario_id = driven.sql("SELECT scenario_id FROM metadata ORDER BY num_objects DESC")["scenario_id"][0]
    for event in ("turn_left", "hard_braking", "stationary_lead"):
        status, found = said(ask(address, "events", id=scenario_id, event=event))
        wanted = driven.mine(event).filter(scenario_id=scenario_id)
        assert status == 200
        assert [row["first_timestep"] for row in found] == wanted["first_timestep"].to_list()
    assert "turn_left" in TIMELINE_EVENTS
    assert ask(address, "events", id=scenario_id, event="closest_approach")[0] == 400


def clip_of(address, **parameters):
    """The bytes of a clip, after the messages about its progress."""
    status, _, body = ask(address, "clip", **parameters)
    assert status == 200
    messages = []
    while "size" not in (messages[-1] if messages else {}):
        line, _, body = body.partition(b"\n")
        messages.append(json.loads(line))
    assert [message["done"] for message in messages[:-1]] == list(range(messages[0]["of"]))
    assert len(body) == messages[-1]["size"]
    return body


def test_clip_shows_progress_and_then_the_file(driven, address):
    scenario_id = driven.sql("SELECT scenario_id FROM results ORDER BY steps LIMIT 1")["scenario_id"].item()
    with Image.open(BytesIO(clip_of(address, id=scenario_id, kind="gif", runs="straight"))) as clip:
        assert clip.format == "GIF"
        assert clip.size == (2 * 480, 480 + 28), "recording and run side by side"
        assert clip.n_frames > 1


def test_clip_as_a_video(driven, address):
    av = pytest.importorskip("av", reason="the extra `video` is not installed")
    scenario_id = driven.sql("SELECT scenario_id FROM results ORDER BY steps LIMIT 1")["scenario_id"].item()
    with av.open(BytesIO(clip_of(address, id=scenario_id, kind="mp4", runs="straight"))) as clip:
        frames = [frame.to_ndarray(format="rgb24") for frame in clip.decode(video=0)]
    assert {frame.shape for frame in frames} == {(480 + 28, 2 * 480, 3)}
    assert len(frames) > 1
    assert not (frames[0] == frames[-1]).all()


def test_clips_that_cannot_be_made_are_an_error(driven, address):
    scenario_id = driven.sql("SELECT scenario_id FROM results LIMIT 1")["scenario_id"].item()
    assert "kind" in said(ask(address, "clip", id=scenario_id, kind="avi"))[1]["error"]
    assert "at most 3" in said(ask(address, "clip", id=scenario_id, kind="gif", runs="a,b,c,d"))[1]["error"]
    _, _, body = ask(address, "clip", id=scenario_id, kind="gif", runs="nothing")
    assert "no rollout" in json.loads(body)["error"]


def test_histogram_counts_every_scenario(driven):
    known = {column.name: column for column in columns(driven)}
    values = driven.sql("SELECT ego_distance FROM metadata")["ego_distance"].to_numpy()
    found = read_histogram(driven, "ego_distance", "true", known)
    wanted, edges = np.histogram(values, len(found.counts), (found.low, found.high))
    assert sum(found.counts) == len(values)
    assert np.abs(np.array(found.counts) - wanted).sum() <= 2, "a value on the edge of a bin may be in either"
    width = edges[1] - edges[0]
    assert MAX_BINS / 3 < len(found.counts) <= MAX_BINS
    assert f"{width:.3e}"[:5] in ("1.000", "2.000", "5.000"), "bins are labelled by round numbers"
    assert found.low / width == pytest.approx(round(found.low / width))
    part = read_histogram(driven, "ego_distance", "num_objects > 2", known)
    assert (part.low, part.high) == (found.low, found.high)
    assert sum(part.counts) == driven.sql("SELECT count(*) AS n FROM metadata WHERE num_objects > 2")["n"].item()


def test_histogram_of_one_value_and_of_none(driven):
    known = {column.name: column for column in columns(driven)}
    found = read_histogram(driven, "dt", "true", known)
    assert found.counts[0] == sum(found.counts) == len(Lake(driven.root))
    empty = read_histogram(driven, "dt", "false", known)
    assert sum(empty.counts) == 0


def test_histograms_that_cannot_be_made_are_an_error(driven):
    known = {column.name: column for column in columns(driven)}
    with pytest.raises(BadParameter, match="no numeric column 'dataset'"):
        read_histogram(driven, "dataset", "true", known)
    with pytest.raises(QueryError, match="similar: ego_distance"):
        read_histogram(driven, "ego_distance", "ego_distanc > 1", known)


def test_the_table_of_a_run_has_its_worst_results_and_failures_first(driven):
    known = {column.name: column for column in all_columns(driven)}
    wanted = ("success", "cost", "nuplan_score", "status")
    query = PageQuery("true", "success", False, 0, 10, wanted, source("straight"))
    rows = read_page(driven, query, known).rows
    found = driven.sql(
        "SELECT scenario_id, bool_and(success) AS success, max(cost) AS cost FROM results WHERE run = 'straight' "
        "GROUP BY scenario_id"
    )
    assert {row["scenario_id"]: (row["success"], row["cost"]) for row in rows} == {
        name: (success, cost) for name, success, cost in found.rows()
    }
    assert [row["success"] for row in rows] == sorted(row["success"] for row in rows)
    assert rows[0]["success"] is False
    failed = read_page(driven, replace(query, where="success IS NOT TRUE"), known)
    assert failed.total == sum(not row["success"] for row in rows)
    assert known["success"].of_run and not known["duration"].of_run


def test_scenarios_that_a_run_failed_are_saved_as_a_database(driven, tmp_path, monkeypatch):
    monkeypatch.setattr("resource.setrlimit", lambda *_: None)  # of a worker's process
    lake = Lake(shutil.copytree(driven.root, tmp_path / "lake"))
    opened = OpenLake(lake, {column.name: column for column in all_columns(lake)}, 10**9)
    reference, count = opened.save("failed", "success IS NOT TRUE", "", "straight")
    wanted = lake.sql("SELECT DISTINCT scenario_id FROM results WHERE run = 'straight' AND success IS NOT TRUE")
    assert sorted(lake.refresh().database(reference).scenario_ids) == sorted(wanted["scenario_id"])
    assert count == len(wanted) > 0
    with pytest.raises(UnsafeSql):
        opened.save("other", "true) UNION (SELECT 'x'", "", "straight")


def test_kept_moments_are_told_of_a_scenario_and_of_its_parts(driven, tmp_path):
    lake = Lake(shutil.copytree(driven.root, tmp_path / "lake"))
    lake.keep_moments("close", {"near": relation("near_objects", {"distance_thresh": 8.0}).lasting()})
    kept = lake.sql("SELECT scenario_id, track_id, other_id, first_timestep, last_timestep FROM moments ORDER BY ALL")
    for (scenario_id,), rows in kept.group_by("scenario_id"):
        told = [tuple(each.values()) for each in moments_of(lake, str(scenario_id))]
        assert sorted(told) == sorted(("close", "near", *row[1:], None) for row in rows.rows())
    assert choices.moments(lake) == [{"name": "close", "definition": "near", "moments": len(kept)}]
    part = cut_moments(lake, "close", MomentChoice(limit=1), name="parts").database
    lake = lake.refresh()
    (own,) = moments_of(lake, part.scenario_ids[0])
    now = lake.sql("SELECT current_timestep FROM metadata WHERE dataset = 'moment'").item()
    in_time = kept.sort("scenario_id", "first_timestep", "last_timestep", "track_id", "other_id")
    _, track, other, first, last = in_time.rows()[0]
    assert tuple(own.values()) == ("close", "near", track, other, now, now + last - first, None)
