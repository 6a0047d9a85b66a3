"""The contents of a report agree with queries on the lake."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from scenarionet_data.errors import DatabaseNotFound
from scenarionet_pipelines.report import gather
from scenarionet_pipelines.report.contents import PICTURE_SIZE
from scenarionet_pipelines.report.measures import COLUMNS, ScenarioMeasures, read_measures, select_examples

pytestmark = pytest.mark.integration


def measured(**columns):
    size = len(next(iter(columns.values())))
    values = {name: np.array(columns.get(name, np.zeros(size)), np.float64) for name in COLUMNS}
    return ScenarioMeasures(np.array([f"s{k}" for k in range(size)], dtype=object), values)


@pytest.mark.long
def test_the_whole_lake(lake, contents):
    (section,) = contents.sections
    assert section.name == "lake"
    assert section.statistics == lake.compare()[0]
    assert contents.summary == lake.summary().to_dicts()
    assert section.missing["date"] == 12
    assert section.missing["map_id"] == 1
    assert "tracks_file" not in section.missing
    assert sum(mark.broken for mark in section.scorecard.partitions[0].rules) > 0


def test_examples_are_typical_extreme_and_random(lake, contents):
    (section,) = contents.sections
    assert list(section.pictures) == ["typical", "extreme", "random"]
    for group in section.pictures.values():
        ids = [picture.scenario_id for picture in group]
        assert 0 < len(ids) == len(set(ids)) <= 8
        for picture in group:
            assert Image.open(io.BytesIO(picture.png)).size == PICTURE_SIZE
            assert picture.facts["num_objects"] == lake.describe(picture.scenario_id)["num_objects"]
    most = lake.sql("SELECT arg_max(scenario_id, num_objects) AS id FROM metadata")["id"].item()
    (found,) = [each for each in section.pictures["extreme"] if "most objects" in each.reason]
    assert lake.describe(found.scenario_id)["num_objects"] == lake.describe(most)["num_objects"]


@pytest.mark.long
def test_databases_side_by_side(lake):
    contents = gather(lake, ["busy", "calm@1"], is_checked=False)
    assert [section.name for section in contents.sections] == ["busy@1", "calm@1"]
    assert [section.origin for section in contents.sections] == ["filter of the lake at snapshot 1"] * 2
    assert [section.scorecard for section in contents.sections] == [None, None]
    for section in contents.sections:
        members = set(lake.database(section.name).scenario_ids)
        assert {each.scenario_id for group in section.pictures.values() for each in group} <= members


def test_measures_that_differ_are_drawn_and_the_others_are_said(lake):
    contents = gather(lake, ["busy", "calm@1"], is_checked=False)
    rows = lake.sql("SELECT * FROM metadata")
    for name, title in COLUMNS.items():
        values = {value for value in rows[name] if value is not None and np.isfinite(value)}
        assert (title in contents.distributions) == (len(values) > 1)
        assert contents.constants.get(title) == (values.pop() if len(values) == 1 else None)
    assert "Objects" in contents.distributions
    for png in contents.distributions.values():
        assert Image.open(io.BytesIO(png)).format == "PNG"


def test_missing_database(lake):
    with pytest.raises(DatabaseNotFound, match="busy, calm"):
        gather(lake, ["nobody"])


@pytest.mark.long
def test_progress_increases_to_the_end(lake):
    shown = []
    gather(lake, ["busy", "calm"], on_progress=lambda done, total, _: shown.append((done, total)))
    assert shown == sorted(shown)
    assert shown[-1] == (100, 100)
    assert len({done for done, _ in shown}) > 20


def test_typical_scenario_is_the_median():
    found = select_examples(measured(ego_distance=[1, 2, 3, 4, 500], num_objects=[9, 8, 5, 2, 1]))
    assert found["typical"][0] == ("s2", "")
    assert found["extreme"] == [("s4", "longest route"), ("s0", "most objects")]


def test_duplicates_are_not_chosen_twice_as_typical():
    found = select_examples(measured(ego_distance=[1, 2, 2, 2, 3]))
    assert len(found["typical"]) == 2  # the distances from the median are 0 and 1


def test_missing_values_are_neither_typical_nor_extreme():
    found = select_examples(measured(ego_distance=[np.nan, 2, 3, 4], min_ego_gap=[np.nan] * 4))
    assert [why for _, why in found["extreme"]] == ["longest route"]
    assert select_examples(measured(ego_distance=[np.nan, np.nan]))["extreme"] == []
    assert select_examples(measured(ego_distance=np.zeros(0))) == {}


def test_measures_are_in_order_of_id(lake):
    found = read_measures(lake)
    assert list(found.ids) == sorted(found.ids)
    assert np.isnan(found.values["min_ego_gap"]).sum() == 1  # the one without other objects
