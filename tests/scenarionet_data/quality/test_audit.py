"""Hard rules during conversion: violating scenarios are quarantined, the rest is converted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.building import MapBuilder
from scenarionet_data.conversion import convert
from scenarionet_data.errors import BrokenContract, LakeError
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.scenario.description import Lights, ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_data.storage.files.local import LocalLakeFiles
from scenarionet_data.storage.write import shard_writer
from tests.fixtures.made import Made, write_raw
from tests.fixtures.made_city import MadeCity

LANE = MapFeatureType.LANE_SURFACE_STREET
NAME = "tests.scenarionet_data.quality.test_audit:OneWay"
CITY = "tests.scenarionet_data.quality.test_audit:OneWayCity"


def one_way() -> MapBuilder:
    """Two lanes; only the first lists the link between them."""
    builder = MapBuilder()
    builder.add("a", LANE, polyline=[[0, 0, 0], [5, 0, 0]], exit_lanes=["b"])
    builder.add("b", LANE, polyline=[[5, 0, 0], [9, 0, 0]])
    return builder


class OneWay(Made):
    """``12 oneway`` has a map with a one-way link, which validation does not check."""

    def scenario(self, shard: Shard, record: str) -> ScenarioDescription:
        scenario = super().scenario(shard, record.replace(" oneway", ""))
        if "oneway" not in record:
            return scenario
        return replace(scenario, map=one_way().build(np.zeros(3)), lights=Lights.empty(scenario.num_timesteps))


class OneWayCity(MadeCity):
    """Shares a city map with such a link."""

    def map_features(self, shard: Shard) -> MapBuilder:
        return one_way()


@pytest.fixture
def raw(tmp_path):
    return write_raw(tmp_path / "raw", {"a": ["1", "2 oneway", "3 invalid", "4"], "b": ["5", "6 oneway"]})


def test_hard_rule_violations_are_quarantined(raw, tmp_path):
    report = convert(NAME, str(raw), tmp_path / "lake")
    assert (report.converted, report.quarantined, report.is_clean, report.failed) == (3, 3, False, [])
    lake = Lake(tmp_path / "lake")
    rows = lake.sql("SELECT shard, position, scenario_id, field, message FROM quarantine ORDER BY ALL").to_dicts()
    assert [(row["shard"], row["position"], row["field"]) for row in rows] == [
        ("a", 1, "lane_links_are_mutual"),
        ("a", 2, "dt"),
        ("b", 1, "lane_links_are_mutual"),
    ]
    assert rows[0]["scenario_id"] == "made/v1/s000002"
    assert rows[0]["message"] == "1 links are one-way, for example a -> b"
    assert [result.name for result in run_checks(lake).results if result.is_hard and not result.is_met] == []


def test_without_checks_violations_are_stored_and_found_later(raw, tmp_path):
    report = convert(NAME, str(raw), tmp_path / "lake", check=False)
    assert (report.converted, report.quarantined) == (5, 1)
    (result,) = run_checks(Lake(tmp_path / "lake"), names=["lane_links_are_mutual"]).results
    assert (result.num_scenarios, result.is_met) == (2, False)


@pytest.mark.long
@pytest.mark.parametrize(("name", "value"), [("_MAX_WAITING", 256), ("_MAX_WAITING", 2), ("_MAX_WAITING_BYTES", 0)])
def test_refused_scenario_leaves_no_gap(name, value, tmp_path, monkeypatch):
    """Files still hold three scenarios each, in order, whether or not scenarios are written in batches."""
    monkeypatch.setattr(shard_writer, "SCENARIOS_PER_FILE", 3)
    monkeypatch.setattr(shard_writer, name, value)
    lines = ["0 oneway", "1", "2", "3 oneway", "4", "5", "6 oneway", "7"]
    convert(NAME, str(write_raw(tmp_path / "raw", {"a": lines})), tmp_path / "lake")
    rows = Lake(tmp_path / "lake").sql("SELECT scenario_id, tracks_file, tracks_row_group FROM metadata ORDER BY ALL")
    assert [name[-1] for name in rows["scenario_id"]] == ["1", "2", "4", "5", "7"]
    assert rows["tracks_row_group"].to_list() == [0, 1, 2, 0, 1]
    assert [name.split("-")[-2] for name in rows["tracks_file"]] == ["000"] * 3 + ["001"] * 2
    positions = Lake(tmp_path / "lake").sql("SELECT position FROM quarantine")["position"]
    assert positions.to_list() == [0, 3, 6]


def test_checked_and_unchecked_lakes_hold_the_same_files(tmp_path):
    raw = write_raw(tmp_path / "raw", {"a": list(range(5))})
    for name, check in (("with", True), ("without", False)):
        convert(NAME, str(raw), tmp_path / name, check=check)
    assert (
        Lake(tmp_path / "with").paths("tracks")[0].rpartition("/")[2]
        == (Lake(tmp_path / "without").paths("tracks")[0].rpartition("/")[2])
    )


def test_shared_map_that_breaks_a_rule_ends_the_run(tmp_path):
    raw = write_raw(tmp_path / "raw", {"a": ["1", "2"]})
    with pytest.raises(
        BrokenContract, match=r"map made/v1/city: 1 links are one-way.*lane_links_are_mutual.*check=False"
    ):
        convert(CITY, str(raw), tmp_path / "lake")
    assert not LocalLakeFiles(tmp_path / "lake").names("snapshots")
    assert convert(CITY, str(raw), tmp_path / "lake", check=False).converted == 2


def test_record_neither_stored_nor_rejected_raises_error(tmp_path, monkeypatch):
    """Records read must equal the sum of converted and quarantined ones."""
    monkeypatch.setattr(shard_writer.ShardWriter, "reject", lambda writer, position, error: None)
    raw = write_raw(tmp_path / "raw", {"a": ["1", "2 invalid"]})
    with pytest.raises(LakeError, match="a: read 2 records, but kept 1 scenarios and 0 in quarantine"):
        convert(NAME, str(raw), tmp_path / "lake")
