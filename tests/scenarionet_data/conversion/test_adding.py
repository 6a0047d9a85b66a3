"""Scenarios made in Python come into a lake in one commit, checked; what cannot be goes to quarantine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data import Lake, add_scenarios, convert
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.quality.checks import run_checks
from scenarionet_data.testing import differences
from tests.fixtures import made_city
from tests.fixtures.scenarios import make_scenario


def test_scenarios_come_back_as_they_were_added(tmp_path):
    made = [make_scenario(seed) for seed in range(70)]
    report = add_scenarios(tmp_path / "lake", iter(made))
    assert (report.converted, report.quarantined, report.shards, report.is_clean) == (70, 0, 2, True)
    lake = Lake(tmp_path / "lake")
    assert lake.snapshot.number == report.snapshot
    found = {scenario.id: scenario for scenario in lake.loader()}
    assert all(differences(scenario, found[scenario.id]) == [] for scenario in made)
    broken = [result.name for result in run_checks(tmp_path / "lake").results if not result.is_met]
    assert broken == ["successors_are_close"]  # in these scenarios lanes lie anywhere


def test_adding_again_skips_and_one_commit_has_all_parts(tmp_path):
    first = make_scenario(0)
    before = add_scenarios(tmp_path / "lake", [first])
    other = [replace(make_scenario(seed), split=split) for seed, split in ((1, "val"), (2, "test"))]
    report = Lake(tmp_path / "lake").add([first, *other])
    assert (report.converted, report.skipped) == (2, 1)
    assert {split for *_, split in report.partitions} == {"val", "test"}
    counts = [len(Lake(tmp_path / "lake", number)) for number in range(before.snapshot, report.snapshot + 1)]
    assert set(counts) == {1, 3}  # never only one of them
    assert Lake(tmp_path / "lake").add(other).converted == 0


def test_bad_ones_go_to_quarantine_and_the_others_are_added(tmp_path):
    good = make_scenario(0)
    nan = make_scenario(1)
    position = nan.tracks.position.copy()
    position[0, 0, 0] = np.nan
    nan = replace(nan, tracks=replace(nan.tracks, position=position))
    changed = replace(make_scenario(0), extras={"changed": True})
    assert add_scenarios(tmp_path / "lake", [good, nan, good]).quarantined == 2
    report = add_scenarios(tmp_path / "lake", [changed, make_scenario(2)])
    assert (report.converted, report.duplicates) == (1, 1)
    lake = Lake(tmp_path / "lake")
    assert len(lake) == 2
    assert set(lake.sql("SELECT field FROM quarantine")["field"].to_list()) >= {"id", "tracks.position"}


def test_a_part_of_a_shared_map_becomes_its_own(tmp_path):
    (tmp_path / "raw").mkdir()
    (tmp_path / "raw" / "a.made").write_text("1")
    convert(made_city.NAME, tmp_path / "raw", tmp_path / "lake")
    (scenario, *_) = Lake(tmp_path / "lake").loader()
    assert scenario.map_id is not None
    add_scenarios(tmp_path / "other", [scenario])
    (found,) = Lake(tmp_path / "other").loader()
    assert (found.map_id, found.map_crop) == (None, None)
    assert differences(found.map, scenario.map) == []


def test_a_name_that_is_no_folder_is_refused(tmp_path):
    with pytest.raises(InvalidScenario, match="split"):
        add_scenarios(tmp_path / "lake", [replace(make_scenario(0), split="../val")])
