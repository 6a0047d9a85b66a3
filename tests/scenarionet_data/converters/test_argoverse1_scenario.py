"""Content of an Argoverse 1 scenario, on written and recorded data."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.csv
import pytest

from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.converters.argoverse1 import Argoverse1, Argoverse1Options
from scenarionet_data.converters.argoverse1.map_features import read_city
from scenarionet_data.scenario.canonical_json import from_json
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from scenarionet_data.testing import ConverterConformance, differences
from tests.fixtures import argoverse1 as fixture
from tests.fixtures.argoverse1 import branch_id, lane_id
from tests.fixtures.reading import scenarios

CONVERTER = Argoverse1()


class TestRecordings(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "*.csv"
    options = {"has_map": False}  # noqa: RUF012

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, recordings: Path) -> Path:
        return recordings / "argoverse1"


@pytest.fixture(scope="module")
def city(tmp_path_factory: pytest.TempPathFactory) -> MapFeatures:
    raw = tmp_path_factory.mktemp("city")
    fixture.write_map(raw, has_heights=True)
    (shard,) = CONVERTER.maps(str(raw), "v1.1", Argoverse1Options())
    return CONVERTER.map_features(shard).build(np.append(fixture.CENTER["PIT"], 0.0))


@pytest.fixture
def scenario(tmp_path: Path) -> ScenarioDescription:
    rng = np.random.default_rng(5)
    fixture.write_map(tmp_path)
    rows = fixture.rows_of(fixture.movers(rng), fixture.frame_times(rng), "PIT", rng)
    fixture.write_csv(tmp_path / "7.csv", rows)
    (only,) = scenarios(CONVERTER, tmp_path)
    return only


# --- objects --------------------------------------------------------------------------------------------


def test_values_missing_in_the_source_are_assumed_and_flagged(scenario: ScenarioDescription) -> None:
    tracks = scenario.tracks
    assert scenario.id == "argoverse1/v1.1/train-7"
    assert (scenario.source.city, scenario.source.crs) == ("PIT", "argoverse1 city frame PIT")
    assert (scenario.num_timesteps, scenario.current_timestep, scenario.has_z) == (50, 19, False)
    assert scenario.ego_id == "00000000-0000-0000-0000-000000000000"
    (focal,) = scenario.objects_of_interest
    assert scenario.tracks_to_predict == ((focal, 0),)
    assert tracks.source_type[tracks.index(focal)] == "AGENT"
    assert (tracks.object_type == ObjectType.VEHICLE).all()
    assert (tracks.is_type_assumed == (tracks.source_type == "OTHERS")).all()
    assert tracks.is_size_assumed.all()
    assert tracks.is_velocity_estimated.all()
    assert tracks.size[scenario.ego_index, 0].tolist() == pytest.approx([4.877, 2.0, 1.473])
    assert scenario.extras["start_timestamp"] == fixture.FIRST_TIME


def test_headings_come_from_motion_or_from_the_lane(scenario: ScenarioDescription) -> None:
    tracks = scenario.tracks
    agent, oncoming, parked = 1, 2, 3
    for row, heading in ((agent, fixture.HEADING), (oncoming, fixture.HEADING + np.pi)):
        assert np.abs(wrap_angle(tracks.heading[row] - heading)).max() < 0.1
        assert tracks.extras[row] is None
    # parked on the left side of the road, next to oncoming lanes
    assert np.abs(wrap_angle(tracks.heading[parked] - fixture.HEADING - np.pi)).max() < 0.01
    assert from_json(tracks.extras[parked]) == {"heading_from": "lane"}


def test_stationary_objects_without_a_map_have_no_heading(tmp_path: Path) -> None:
    fixture.write_recordings(tmp_path, 1)
    (found,) = scenarios(CONVERTER, tmp_path, has_map=False)
    assert found.map is None
    assert found.map_id is None
    standing = [row for row, extras in enumerate(found.tracks.extras) if extras]
    assert standing
    for row in standing:
        assert from_json(found.tracks.extras[row]) == {"heading_from": "nothing"}
        assert not found.tracks.heading[row].any()


# --- the map --------------------------------------------------------------------------------------------


def row_of(features: MapFeatures, lane: int) -> int:
    return features.ids.tolist().index(str(lane))


def test_lanes_match_the_source(city: MapFeatures) -> None:
    assert len(city) == 2 * 8 * 2 + 2
    assert (city.feature_type == MapFeatureType.LANE_SURFACE_STREET).all()
    assert (city.polyline.lengths == 10).all()
    assert not city.polyline.values[:, 2].any()
    np.testing.assert_allclose(city.width.values, 1.9, atol=1e-4)
    assert (city.is_intersection == 1).sum() == 2 * 3
    start = city.polyline[row_of(city, lane_id(0, 1, 0, 0))][0, :2]
    np.testing.assert_allclose(start, fixture.road(-160.0, -1.9), atol=1e-3)
    branch = from_json(city.extras[row_of(city, branch_id(0, 1))])
    assert branch == {"is_width_assumed": True, "has_traffic_control": True, "turn_direction": "RIGHT"}


@pytest.mark.parametrize("way", [1, -1])
@pytest.mark.parametrize("segment", [0, 1, 5])
def test_neighbors_are_on_the_correct_side(city: MapFeatures, way: int, segment: int) -> None:
    """Also in segment 1, where the source lists them on the wrong side."""
    inner, outer = (lane_id(0, way, segment, lane) for lane in (0, 1))
    opposite = lane_id(0, -way, 7 - segment, 0)
    left, right = row_of(city, inner), row_of(city, outer)
    assert city.left_neighbors[left].tolist() == [str(opposite)]
    assert city.right_neighbors[left].tolist() == [str(outer)]
    assert city.left_neighbors[right].tolist() == [str(inner)]
    assert city.right_neighbors[right].tolist() == []
    extras = from_json(city.extras[left])
    assert extras["opposite_neighbors"] == [str(opposite)]
    assert sorted(extras.get("neighbors_of_other_side", [])) == (
        sorted([str(opposite), str(outer)]) if segment == 1 else []
    )


def test_links_are_mutual_and_external_lanes_are_flagged(city: MapFeatures) -> None:
    first, second = (row_of(city, lane_id(0, 1, segment, 0)) for segment in (1, 2))
    assert city.exit_lanes[first].tolist() == [str(lane_id(0, 1, 2, 0))]
    assert city.entry_lanes[second].tolist() == [str(lane_id(0, 1, 1, 0))]  # not stated by the source
    fork = row_of(city, lane_id(0, 1, 3, 1))
    assert sorted(city.exit_lanes[fork]) == sorted([str(lane_id(0, 1, 4, 1)), str(branch_id(0, 1))])
    last = row_of(city, lane_id(0, 1, 7, 0))
    outside = str(lane_id(0, 1, 8, 0))
    assert city.exit_lanes[last].tolist() == [outside]
    assert from_json(city.extras[last])["lanes_outside_map"] == [outside]


def test_crop_holds_features_near_the_ego(tmp_path: Path) -> None:
    fixture.write_map(tmp_path, num_roads=5)
    fixture.write_recordings(tmp_path / "data", 1)
    (small,) = scenarios(CONVERTER, tmp_path, radius=10.0)
    (large,) = scenarios(CONVERTER, tmp_path, radius=100.0)
    assert small.map is not None
    assert large.map is not None
    assert 0 < len(small.map) < len(large.map) < 5 * (2 * 8 * 2 + 2)
    assert set(small.map.ids) < set(large.map.ids)
    assert large.map_crop is not None
    lower, upper = large.map.polyline.bounds()
    min_x, min_y, max_x, max_y = large.map_crop
    assert ((lower[:, 0] <= max_x) & (upper[:, 0] >= min_x) & (lower[:, 1] <= max_y) & (upper[:, 1] >= min_y)).all()


def test_crop_matches_the_map_builder(tmp_path: Path) -> None:
    city = read_city(fixture.write_map(tmp_path, "MIA", num_roads=3))
    origin = np.append(np.round(fixture.CENTER["MIA"]), 0.0)
    for size in (5.0, 60.0, 1e4, -1e4):
        window = (*(origin[:2] - size), *(origin[:2] + size))
        assert differences(city.crop(window, origin), city.features.crop(window).build(origin, has_z=False)) == []


# --- recordings -----------------------------------------------------------------------------------------


def test_recorded_properties(recordings: Path) -> None:
    found = {
        s.source.scenario_id: s
        for s in scenarios(CONVERTER, recordings / "argoverse1", has_map=False, frames="resampled")
    }
    assert len(found) == 40
    assert sum(len(s.tracks) for s in found.values()) == 1568
    assert sum(s.source.city == "MIA" for s in found.values()) == 16
    steps = [s.num_timesteps for s in found.values()]
    assert (min(steps), sorted(steps)[20], max(steps)) == (50, 50, 138)
    assert sum(s.current_timestep == 19 for s in found.values()) == 27
    assert found["1649"].extras["longest_step"] == pytest.approx(0.4697, abs=1e-4)
    for scenario in found.values():
        assert scenario.tracks.valid.any(axis=1).all()
        assert scenario.tracks.valid[scenario.ego_index].all()


def rows_of(scenario: ScenarioDescription, recordings: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time [s], track and position of each row of a scenario's file."""
    rows = pyarrow.csv.read_csv(recordings / "argoverse1" / scenario.source.file)
    times = rows["TIMESTAMP"].to_numpy() - rows["TIMESTAMP"].to_numpy().min()
    track = np.array([scenario.tracks.index(name) for name in rows["TRACK_ID"].to_pylist()])
    return times, track, np.column_stack([rows["X"].to_numpy(), rows["Y"].to_numpy()])


def test_recorded_frames_are_the_rows_of_the_file(recordings: Path) -> None:
    """All of them, where the file puts them."""
    for scenario in scenarios(CONVERTER, recordings / "argoverse1", has_map=False):
        times, track, wanted = rows_of(scenario, recordings)
        step = np.searchsorted(scenario.timestamps, times)
        assert scenario.timestamps[step].tolist() == times.tolist()
        found = scenario.tracks.position[track, step, :2] + scenario.origin[:2]
        assert np.abs(found - wanted).max() < 2e-4
        assert scenario.tracks.valid.sum() == len(times)
        assert (scenario.num_timesteps, scenario.current_timestep) == (50, 19)
        assert not scenario.tracks.is_interpolated.any()


def test_resampled_positions_match_the_file(recordings: Path) -> None:
    """At timesteps within 2 ms of a recorded time, up to the distance that objects move in that time."""
    for scenario in scenarios(CONVERTER, recordings / "argoverse1", has_map=False, frames="resampled")[:5]:
        times, track, wanted = rows_of(scenario, recordings)
        step = np.rint(times * 10).astype(int)
        near = np.abs(times - step * 0.1) < 0.002
        found = scenario.tracks.position[track, step, :2] + scenario.origin[:2]
        assert near.sum() > 10
        assert scenario.tracks.valid[track, step].all()
        assert np.abs(found - wanted)[near].max() < 0.15
        is_recorded = np.abs(scenario.timestamps[:, None] - times).min(axis=1) < 1e-6
        assert not scenario.tracks.is_interpolated[:, is_recorded].any()
        assert (scenario.tracks.is_interpolated == scenario.tracks.valid)[:, ~is_recorded].all()
