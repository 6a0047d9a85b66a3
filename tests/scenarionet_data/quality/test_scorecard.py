"""The scorecard: violations by rule and split, and coverage of published splits."""

from __future__ import annotations

from dataclasses import replace

import pytest

from scenarionet_data import Lake, converters
from scenarionet_data.conversion import convert
from scenarionet_data.quality import releases
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.quality.releases import Coverage, Release
from scenarionet_data.quality.scorecard import make_scorecard
from scenarionet_data.scenario.description import ScenarioDescription
from tests.fixtures.lakes import write_lake, write_shard
from tests.fixtures.made import NAME, write_raw
from tests.fixtures.scenarios import make_scenario

RELEASE = Release(inputs=1000, unit="files", source="somewhere")


def sound(seed: int, split: str = "train") -> ScenarioDescription:
    return make_scenario(seed, num_objects=4, num_lanes=1, num_lights=1, split=split)


def dizzy(scenario: ScenarioDescription) -> ScenarioDescription:
    heading = scenario.tracks.heading.copy()
    heading[0, 3] = 4
    return replace(scenario, tracks=replace(scenario.tracks, heading=heading))


@pytest.fixture
def lake(tmp_path, monkeypatch) -> Lake:
    """Two splits; one of three scenarios in train violates a rule."""
    monkeypatch.setattr(ScenarioDescription, "validate", lambda scenario: None)
    write_lake(tmp_path, [dizzy(sound(1)), sound(2), sound(3)])
    return write_lake(tmp_path, [sound(4, "val")], "b")


def test_rules_are_counted_by_split(lake):
    card = make_scorecard(run_checks(lake))
    assert [(p.dataset, p.version, p.split, p.scenarios) for p in card.partitions] == [
        ("made", "v1", "train", 3),
        ("made", "v1", "val", 1),
    ]
    broken = {(p.split, mark.check): mark for p in card.partitions for mark in p.rules if mark.broken}
    assert set(broken) == {("train", "headings_are_wrapped"), ("train", "heading_is_direction")}
    mark = broken["train", "headings_are_wrapped"]
    assert (mark.broken, mark.is_met, mark.examples[0][0]) == (1, False, sound(1).id)
    assert mark.share == pytest.approx(1 / 3)
    assert card.partitions[0].budgets == converters.budgets("made")
    assert card.others == ()


def test_table_has_a_row_for_each_split_and_rule(lake):
    findings = run_checks(lake, names=["headings_are_wrapped", "ids_are_unique"])
    rows = make_scorecard(findings).rows
    assert [(row["split"], row["check"], row["broken"]) for row in rows] == [
        ("train", "headings_are_wrapped", 1),
        ("train", "ids_are_unique", 0),
        ("val", "headings_are_wrapped", 0),
        ("val", "ids_are_unique", 0),
    ]
    assert rows[0]["example"].startswith(f"{sound(1).id}: track t0 has a heading of")
    assert rows[0]["published"] is None


@pytest.mark.long
def test_violations_outside_scenarios_are_listed_separately(tmp_path):
    from scenarionet_data.storage.files.local import LocalLakeFiles
    from scenarionet_data.storage.snapshots import commit as commits

    record = replace(write_shard(tmp_path, [sound(1)]), num_quarantined=2)
    commits.commit(LocalLakeFiles(tmp_path), [record], "test")
    card = make_scorecard(run_checks(Lake(tmp_path)))
    assert card.others == (("shards_are_whole", "shard made/v1/train/a: 0 records in quarantine, 2 were put there"),)
    assert card.partitions[0].quarantined == 2


def test_quarantine_counts_add_up(tmp_path):
    """Records read equal converted plus quarantined ones, for each shard and in total."""
    raw = write_raw(tmp_path / "raw", {"a": ["1", "2 invalid", "3"], "b": ["4 bug", "5 invalid"]})
    convert(NAME, str(raw), tmp_path / "lake")
    findings = run_checks(Lake(tmp_path / "lake"), names=["shards_are_whole"])
    assert findings.rows.num_rows == 0
    assert [(p.scenarios, p.quarantined) for p in make_scorecard(findings).partitions] == [(2, 3)]


def test_missing_quarantine_file_is_reported(tmp_path):
    raw = write_raw(tmp_path / "raw", {"a": ["1", "2 invalid", "3"]})
    convert(NAME, str(raw), tmp_path / "lake")
    next((tmp_path / "lake").glob("quarantine/**/*.parquet")).unlink()
    (row,) = run_checks(Lake(tmp_path / "lake"), names=["shards_are_whole"]).rows.to_pylist()
    assert row["detail"] == "shard made/v1/train/a: 0 records in quarantine, 1 were put there"


@pytest.mark.long
def test_database_is_checked_without_the_rest(lake):
    lake.filter("split = 'val'", name="some")
    card = make_scorecard(run_checks(lake, "some"))
    assert [(p.split, p.scenarios, p.coverage) for p in card.partitions] == [("val", 1, None)]
    assert all(mark.is_met for mark in card.partitions[0].rules)


# --- published sizes --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("release", "inputs", "records", "is_as_published", "text"),
    [
        (RELEASE, 12, 5847, None, "incomplete: 12 of 1,000 files"),
        (RELEASE, 1000, 5847, True, "whole: 1,000 files; the number of scenarios is not published"),
        (RELEASE, 1001, 5847, False, "1,001 files, published are 1,000"),
        (replace(RELEASE, scenarios=5847), 1000, 5847, True, "whole: 5,847 scenarios read, as published"),
        (replace(RELEASE, scenarios=5848), 1000, 5847, False, "whole: 5,847 scenarios read, published are 5,848"),
    ],
)
def test_coverage(release, inputs, records, is_as_published, text):
    found = Coverage(release, inputs, records)
    assert (found.is_as_published, found.text) == (is_as_published, text)


def test_split_is_complete_when_every_input_is_present(tmp_path, monkeypatch):
    published = {("made", "v1", "train"): Release(2, "files", "the fixture", scenarios=3)}
    monkeypatch.setattr(releases, "load", lambda: published)
    raw = write_raw(tmp_path / "raw", {"a": ["1", "2 invalid"]})
    lake = tmp_path / "lake"

    def texts() -> list[str]:
        convert(NAME, str(raw), lake)
        return [p.coverage.text for p in make_scorecard(run_checks(Lake(lake), names=["shards_are_whole"])).partitions]

    assert texts() == ["incomplete: 1 of 2 files"]
    write_raw(raw, {"b": ["3"]})
    assert texts() == ["whole: 3 scenarios read, as published"]
    write_raw(raw, {"c": ["4"]})
    assert texts() == ["3 files, published are 2"]


def test_limited_conversion_is_not_a_complete_input(tmp_path, monkeypatch):
    monkeypatch.setattr(releases, "load", lambda: {("made", "v1", "train"): Release(1, "files", "the fixture")})
    raw = write_raw(tmp_path / "raw", {"a": ["1", "2", "3"]})
    convert(NAME, str(raw), tmp_path / "lake", limit=2)
    (partition,) = make_scorecard(run_checks(Lake(tmp_path / "lake"), names=["ids_are_unique"])).partitions
    assert partition.coverage.text == "incomplete: 0 of 1 files"


def test_only_matching_shards_count(tmp_path, monkeypatch):
    release = Release(1, "scenes", "the fixture", shards="*-scene-*")
    monkeypatch.setattr(releases, "load", lambda: {("made", "v1", "train"): release})
    records = [write_shard(tmp_path, [sound(seed)], name) for seed, name in ((1, "x-scene-0"), (2, "x-window-0"))]
    found = releases.coverage(("made", "v1", "train"), records)
    assert (found.inputs, found.records) == (1, 1)
    assert releases.coverage(("made", "v1", "train"), records[1:]) is None
    assert releases.coverage(("made", "v1", "val"), records) is None


def test_every_published_number_cites_its_source():
    known = releases.load()
    assert len(known) >= 12
    for (dataset, version, split), release in known.items():
        assert converters.get(dataset).release == version
        assert split in ("train", "val", "test", "mini", "mini_train", "mini_val")
        assert release.inputs > 0
        assert len(release.source) > 20
