"""What a conversion drops, assumes and passes over: in the report, and in the lake."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.building import MapBuilder
from scenarionet_data.conversion import plan_conversion
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.passed_over import PassedOver
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.maintenance.compaction import compact
from scenarionet_data.maintenance.fsck import fsck
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.snapshots.shard_record import read_defects
from scenarionet_data.storage.write.map_tiles import write_shared_map
from tests.fixtures.made import FEW, NAME, MadeOptions, ids, run, wanted, write_raw

DROPPED = ("tracks", "a.made", "rows 5, 6, 7, ...", "size", "dropped", "expected a size above 0 m, found 0")
ASSUMED = ("tracks", "a.made", "token", "type", "assumed", "expected a known type, found 'ufo'")


def test_dropped_and_assumed_rows_are_counted_by_file_and_reason(raw, root):
    write_raw(raw, {"a": [1, "2 defects 7", "3 defects 5"], "b": [4]})
    report = run(raw, root)
    assert (report.converted, report.dropped, report.assumed) == (4, 12, 2)
    assert report.is_clean
    found = {(d.table, d.file, d.location, d.field, d.action, d.reason): d.count for d in report.defects}
    assert found == {DROPPED: 12, ASSUMED: 2}
    lake = Lake(root)
    assert lake.sql("SELECT scenario_id, num_dropped_rows FROM metadata ORDER BY 1").rows() == [
        (name, number) for name, number in zip(wanted(1, 2, 3, 4), (0, 7, 5, 0), strict=True)
    ]
    rows = lake.sql("SELECT scenario_id, map_id, shard, action, count FROM defects ORDER BY ALL").rows()
    assert rows == [
        (name, None, "a", action, count)
        for name, number in zip(wanted(2, 3), (7, 5), strict=True)
        for action, count in (("assumed", 1), ("dropped", number))
    ]
    reasons = lake.named_query("defect_reasons")
    assert reasons.select("action", "expected", "rows", "scenarios").rows() == [
        ("dropped", "expected a size above 0 m", 12, 2),
        ("assumed", "expected a known type", 2, 2),
    ]
    assert reasons["example"][0] == "a.made, rows 5, 6, 7, ...: expected a size above 0 m, found 0"
    assert all(result.is_met for result in run_checks(lake).results if result.is_hard)


def test_defects_survive_compaction_and_a_second_run_reports_none(raw, root):
    write_raw(raw, {"a": ["2 defects 7"], "b": [4]})
    run(raw, root)
    compact(root, "analytics")
    assert Lake(root).sql("SELECT sum(count) AS n FROM defects")["n"].to_list() == [8]
    assert fsck(root, is_deep=True).is_whole
    assert run(raw, root).defects == ()


def test_scenario_with_too_many_unusable_rows_is_quarantined(raw, root):
    write_raw(raw, {"a": [1, "2 defects 100"]})
    report = run(raw, root)
    assert (report.converted, report.quarantined, report.dropped) == (1, 1, 0)
    (message,) = Lake(root).sql("SELECT message FROM quarantine")["message"]
    assert "expected at most 20% unusable rows (option max_bad_rows), found" in message
    assert "a.made, rows 5, 6, 7, ...: size: expected a size above 0 m, found 0" in message

    report = run(raw, root, options=MadeOptions(num_objects=2, max_bad_rows=0.9), replace=True)
    assert (report.converted, report.quarantined, report.dropped) == (2, 0, 100)
    assert ids(root) == wanted(1, 2)


def test_default_limit_does_not_change_the_identity_of_shards():
    shard = Shard("made", "v1", "train", "a", "raw", (), FEW)
    assert shard.options_text == '{"num_objects": 2}'
    strict = Shard("made", "v1", "train", "a", "raw", (), MadeOptions(num_objects=2, max_bad_rows=0.0))
    assert strict.options_text == '{"max_bad_rows": 0.0, "num_objects": 2}'


def test_rejected_scenarios_have_no_defects_in_the_lake(raw, root):
    write_raw(raw, {"a": [1, "1 defects 7"]})
    report = run(raw, root)
    assert (report.converted, report.quarantined, report.defects) == (1, 1, ())


def test_defects_of_a_shared_map_are_stored_beside_it(root):
    files = open_files(root)
    defects = Defects()
    defects.drop("maps", "map.json", ["lane 3"], "polyline", "expected finite metres, found nan, 0")
    features = MapBuilder()
    features.add("1", MapFeatureType.LANE_SURFACE_STREET, polyline=[[0, 0], [5, 5]])
    features.defects = defects.found()
    shard = Shard("made", "v1", "", "city", "raw", (RawItem("map.json", "0"),), Options())
    record = write_shared_map(files, shard, features, "1", "CC0")
    commits.commit(files, [record], "maps", frozenset())
    assert tuple(read_defects(files, record)) == defects.found()
    lake = Lake(root)
    assert lake.sql("SELECT split, shard, scenario_id, map_id, location FROM defects").rows() == [
        ("", "city", None, "city", "lane 3")
    ]
    assert lake.sql("SELECT count(*) AS n FROM maps")["n"].to_list() == [1]
    assert lake.shared_maps()["made", "v1", "city"].startswith("maps/")


def test_files_that_are_not_taken_are_listed_with_a_reason(raw, root):
    write_raw(raw, {"a": [1], "b": [2]})
    for name in ("a.made_.gstmp", "a.made.md5", "notes.txt", "more/other.txt"):
        path = raw / name
        path.parent.mkdir(exist_ok=True)
        path.write_text("")
    expected = (
        PassedOver("files *.gstmp: a.made_.gstmp", 1, "an unfinished download"),
        PassedOver("files *.md5: a.made.md5", 1, "a checksum"),
        PassedOver("files *.txt, for example notes.txt", 2, "not read by this converter"),
    )
    assert plan_conversion(NAME, raw, root, options=FEW).passed_over == expected
    assert run(raw, root).passed_over == expected


@pytest.mark.long
@pytest.mark.parametrize("name", ["content_hash", "num_states"])
def test_defects_are_not_part_of_the_content(raw, tmp_path, name):
    write_raw(raw, {"a": [2]})
    run(raw, tmp_path / "plain")
    write_raw(raw, {"a": ["2 defects 7"]})
    run(raw, tmp_path / "with")
    found = [Lake(tmp_path / lake).sql(f"SELECT {name} FROM metadata")[name].to_list() for lake in ("plain", "with")]
    assert found[0] == found[1]
    assert ScenarioLoader(tmp_path / "with")[0].defects == ()
    assert np.isfinite(ScenarioLoader(tmp_path / "with")[0].tracks.position).all()
