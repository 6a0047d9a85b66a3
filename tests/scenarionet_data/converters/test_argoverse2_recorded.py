"""Reference values of the recorded Argoverse 2 data."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute
import pyarrow.feather
import pyarrow.parquet
import pytest

from scenarionet_data.building.polylines import midlines
from scenarionet_data.converters.argoverse2 import Argoverse2
from scenarionet_data.converters.argoverse2.map_features import read_map
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane, is_road_line
from tests.fixtures.reading import scenarios

CONVERTER = Argoverse2()


def counts(words: Any) -> dict[str, int]:
    return dict(zip(*(part.tolist() for part in np.unique(words, return_counts=True)), strict=True))


@pytest.fixture(scope="module")
def recorded(recordings: Path) -> tuple[ScenarioDescription, ScenarioDescription]:
    forecasting, sensor = scenarios(CONVERTER, recordings / "argoverse2", "val")
    return forecasting, sensor


def test_recorded_forecasting_tracks(recorded: tuple[ScenarioDescription, ScenarioDescription]) -> None:
    scenario, _ = recorded
    assert scenario.id == "argoverse2/v2/0a1e6f0a-1817-4a98-b02e-db8c9327d151"
    assert len(scenario.tracks) == 58
    assert scenario.tracks.valid.sum() == 2434
    types = {"vehicle": 32, "pedestrian": 12, "static": 8, "riderless_bicycle": 4, "background": 2}
    assert counts(scenario.tracks.source_type.astype(str)) == types
    assert scenario.num_timesteps == 110
    assert scenario.current_timestep == 49
    np.testing.assert_allclose(np.diff(scenario.timestamps), 0.1, atol=1e-12)
    assert scenario.objects_of_interest == ("139344",)
    assert scenario.tracks_to_predict == (("138951", 0),)
    assert scenario.source.city == "austin"
    assert scenario.source.log == "7bef7e1f-8c90-4ba5-b39e-b3f134aa5bbe"


def test_recorded_forecasting_positions_match_the_file(
    recorded: tuple[ScenarioDescription, ScenarioDescription], recordings: Path
) -> None:
    scenario, _ = recorded
    table = pa.parquet.read_table(recordings / "argoverse2" / scenario.source.file)
    rows = [scenario.tracks.index(track) for track in table["track_id"].to_pylist()]
    steps = table["timestep"].to_numpy()
    wanted = np.stack([table["position_x"].to_numpy(), table["position_y"].to_numpy()], axis=-1)
    found = scenario.tracks.position[rows, steps, :2].astype(np.float64) + scenario.origin[:2]
    assert np.abs(found - wanted).max() < 1e-4
    assert np.abs(scenario.tracks.heading[rows, steps] - table["heading"].to_numpy()).max() < 1e-6


def test_recorded_forecasting_map(recorded: tuple[ScenarioDescription, ScenarioDescription]) -> None:
    features = recorded[0].map
    assert features is not None
    names = counts([MapFeatureType(code).name for code in features.feature_type])
    assert names["LANE_BIKE_LANE"] == 37
    assert names["LANE_SURFACE_STREET"] == 34
    assert names["DRIVABLE_AREA"] == 2
    assert names["CROSSWALK"] == 6
    assert (features.is_intersection == 1).sum() == 32
    # Of 142 sides, 92 carry no paint; the 50 others are 37 lines, 13 of which bound two lanes.
    assert is_road_line(features.feature_type).sum() == 37
    sides = features.left_boundaries.lengths.sum() + features.right_boundaries.lengths.sum()
    assert sides == 50
    known = set(features.ids)
    assert all(line in known for line in [*features.left_boundaries.values, *features.right_boundaries.values])
    assert recorded[0].extras["num_completed_links"] == 0


def test_recorded_sensor_log(recorded: tuple[ScenarioDescription, ScenarioDescription]) -> None:
    _, scenario = recorded
    assert scenario.id == "argoverse2/v2/adcf7d18-0510-35b0-a2fa-b4cea13a6d76@315973157959879000"
    assert len(scenario.tracks) == 146 + 1
    assert scenario.tracks.valid[:-1].sum() == 12_078
    assert scenario.num_timesteps == 156
    assert scenario.timestamps[-1] == pytest.approx(15.499874)
    assert scenario.map is not None
    assert is_lane(scenario.map.feature_type).sum() == 199
    assert scenario.source.city == "PIT"
    assert scenario.extras["num_interpolated_poses"] == 0
    assert scenario.extras["num_completed_links"] == 107


def test_recorded_sensor_boxes_are_on_the_ground(
    recorded: tuple[ScenarioDescription, ScenarioDescription],
) -> None:
    """Boxes, poses and map agree: the undersides of the ego and of a bus are at the height of the lanes beneath."""
    _, scenario = recorded
    tracks, features = scenario.tracks, scenario.map
    assert features is not None
    lanes = features.polyline.values[np.repeat(is_lane(features.feature_type), features.polyline.lengths)]
    bottom = tracks.position[..., 2] - tracks.size[..., 2] / 2.0
    for row in [scenario.ego_index, *np.flatnonzero(tracks.source_type == "BUS")]:
        for step in np.flatnonzero(tracks.valid[row])[::10]:
            away = np.hypot(*(lanes[:, :2] - tracks.position[row, step, :2]).T)
            if away.min() < 3.0:
                assert abs(bottom[row, step] - lanes[away.argmin(), 2]) < 0.25


def test_derived_centerlines_match_the_given_ones(recordings: Path) -> None:
    """Centerlines derived for sensor maps agree with those given in the forecasting map."""

    (path,) = (recordings / "argoverse2").rglob("motion-forecasting/*/*/log_map_archive_*.json")
    roads = read_map(path, path.name)
    derived = midlines(roads.left, roads.right)
    np.testing.assert_array_equal(derived.lengths, roads.centers.lengths)
    distance = np.hypot(*(derived.values - roads.centers.values)[:, :2].T)
    assert np.median(distance) < 0.01
    assert distance.max() < 0.12
