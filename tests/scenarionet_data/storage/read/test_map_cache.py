"""A map shared by many scenarios is stored once and cropped at load."""

from __future__ import annotations

import pickle
from dataclasses import fields

import numpy as np
import pyarrow.parquet as pq
import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import meets
from scenarionet_data.conversion import convert
from scenarionet_data.storage.write.map_tiles import TILE
from tests.fixtures.made import write_raw
from tests.fixtures.made_city import NAME, MadeCity, city


@pytest.fixture(scope="module")
def lake(tmp_path_factory) -> Lake:
    root = tmp_path_factory.mktemp("city")
    raw = write_raw(root / "raw", {"a": list(range(6)), "b": list(range(10, 14))})
    report = convert(NAME, str(raw), root / "lake")
    assert report.is_clean
    assert report.converted == 10
    return Lake(root / "lake")


def test_city_map_is_stored_once(lake):
    (path,) = lake.paths("maps")
    assert pq.ParquetFile(path).metadata.num_rows == len(city())
    assert set(lake.sql("SELECT map_id FROM metadata")["map_id"]) == {"city"}


def test_crop_matches_converted_map(lake):
    loader = ScenarioLoader(lake)
    for index, scenario in enumerate(loader):
        seed = int(scenario.source.scenario_id[1:])
        shard = next(iter(MadeCity().shards(str(lake.root.parent / "raw"), "train", "v1", MadeCity.Options())))
        expected = MadeCity().scenario(shard, str(seed)).map
        found = loader[index].map
        assert list(found.ids) == list(expected.ids)
        assert len(found) >= 5
        assert np.array_equal(found.polyline.offsets, expected.polyline.offsets)
        for name in ("polyline", "polygon"):
            assert np.abs(getattr(found, name).values - getattr(expected, name).values).max() <= 1e-4
        for name in (field.name for field in fields(expected) if field.name not in ("polyline", "polygon")):
            ours, theirs = getattr(found, name), getattr(expected, name)
            if isinstance(ours, Ragged):
                assert ours.is_equal(theirs), name
            else:
                np.testing.assert_array_equal(ours, theirs, name)


def test_map_statistics_cover_the_crop(lake):
    loader = ScenarioLoader(lake)
    counts = lake.sql("SELECT num_map_features FROM metadata ORDER BY scenario_id")["num_map_features"]
    assert [len(scenario.map) for scenario in loader] == counts.to_list()


def test_utm_coordinates_keep_their_precision(lake):
    scenario = ScenarioLoader(lake)[0]
    truth = {feature["id"]: feature["polyline"] for feature in city()._rows}
    for row, feature_id in enumerate(scenario.map.ids):
        if len(scenario.map.polyline[row]):
            source = scenario.map.polyline[row].astype(np.float64) + scenario.origin
            near = np.abs(source[:, :2] - scenario.origin[:2]).max() < 1000
            if near:
                assert np.abs(source - truth[str(feature_id)]).max() <= 1e-4


def test_tiles_are_row_groups_with_small_offsets(lake):
    file = pq.ParquetFile(lake.paths("maps")[0])
    assert file.metadata.num_row_groups > 50
    for group in range(file.metadata.num_row_groups):
        rows = file.read_row_group(group).to_pylist()
        assert len({row["tile"] for row in rows}) == 1
        if "river" not in {row["feature_id"] for row in rows}:
            assert all(abs(x) < 2 * TILE for row in rows for x in row["x"])


def test_second_run_skips_map_and_loader_is_picklable(lake):
    raw = str(lake.root.parent / "raw")
    assert convert(NAME, raw, lake.root).converted == 0
    copy = pickle.loads(pickle.dumps(ScenarioLoader(lake)))
    assert len(copy[3].map) == len(ScenarioLoader(lake)[3].map)


def test_window_intersects_touching_boxes():
    boxes = np.array([[0, 0, 1, 1], [2, 0, 3, 1], [1, 1, 2, 2], [np.nan] * 4])
    assert meets(boxes, (1.0, 0.0, 1.5, 1.0)).tolist() == [True, False, True, False]
