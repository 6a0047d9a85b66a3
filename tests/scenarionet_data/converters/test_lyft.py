"""Lyft recordings: conformance, windows, tracks, and refused input."""

from __future__ import annotations

import json
import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.conversion import convert
from scenarionet_data.converters.lyft import Lyft, LyftOptions
from scenarionet_data.errors import BadParameter, CorruptSource, InvalidScenario, MissingDependency, SourceNotFound
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.storage.write.shard_writer import check_share_of_bad_rows
from scenarionet_data.testing import ConverterConformance, differences
from tests.fixtures import lyft as fixture
from tests.fixtures import lyft_world as world
from tests.fixtures.reading import scenarios, shards

CONVERTER = Lyft()


class TestFormat2(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "0"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        return fixture.write_dataset(folder / "lyft", num_scenes=3, num_frames=30)


@pytest.mark.long
class TestFormat1(ConverterConformance):
    converter = CONVERTER
    options: dict[str, Any] = {"window": 2.0, "stride": 1.0}  # noqa: RUF012
    damaged_glob = ".zarray"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        return fixture.write_dataset(folder / "lyft", num_scenes=2, num_frames=30, version=1)


@pytest.mark.long
class TestDamagedMap(ConverterConformance):
    converter = CONVERTER
    damaged_glob = "semantic_map.pb"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        return fixture.write_dataset(folder / "lyft", num_scenes=1, num_frames=20)


class TestRecorded(ConverterConformance):
    converter = CONVERTER
    options: dict[str, Any] = {"has_map": False}  # noqa: RUF012
    damaged_glob = "0"

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, recordings: Path) -> Path:
        return recordings / "lyft"


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    return fixture.write_dataset(tmp_path / "lyft")


def recording(dataset: Path) -> Path:
    return dataset / "scenes" / "sample.zarr"


# --- scenes and windows ---------------------------------------------------------------------------------


def test_scene_matches_written_data(dataset: Path) -> None:
    found = scenarios(CONVERTER, dataset)
    tables = fixture.recording(5, 45)
    assert [scenario.num_timesteps for scenario in found] == [45, 44, 43, 42, 41]
    for scenario, row in zip(found, tables["scenes"], strict=True):
        first, last = row["frame_index_interval"]
        frames = tables["frames"][first:last]
        assert scenario.source.log == f"{row['host']}-{row['start_time']}"
        assert scenario.id == f"lyft/v1.0/{scenario.source.log}@{frames['timestamp'][0]}"
        np.testing.assert_array_equal(scenario.timestamps, (frames["timestamp"] - frames["timestamp"][0]) * 1e-9)
        agents = tables["agents"][frames["agent_index_interval"][0, 0] : frames["agent_index_interval"][-1, 1]]
        steps = np.repeat(np.arange(len(frames)), np.diff(frames["agent_index_interval"])[:, 0])
        assert scenario.tracks.valid[:-1].sum() == len(agents)
        rows = [scenario.tracks.index(str(track)) for track in agents["track_id"]]
        place = scenario.tracks.position[rows, steps, :2] + scenario.origin[:2]
        assert np.abs(place - agents["centroid"]).max() < 1e-4
        np.testing.assert_array_equal(scenario.tracks.size[rows, steps], agents["extent"])


def test_windows_share_a_scene(dataset: Path) -> None:
    whole = scenarios(CONVERTER, dataset)[0]
    cut = [s for s in scenarios(CONVERTER, dataset, window=2.0) if s.source.log == whole.source.log]
    assert [s.num_timesteps for s in cut] == [20, 20]  # the 5 remaining frames have nothing after their history
    overlapping = [s for s in scenarios(CONVERTER, dataset, window=2.0, stride=1.0) if s.source.log == whole.source.log]
    assert [s.num_timesteps for s in overlapping] == [20, 20, 20, 15]
    starts = [s.extras["start_timestamp_ns"] for s in overlapping]
    np.testing.assert_allclose(np.diff(starts) * 1e-9, 1.0, atol=1e-3)
    second = overlapping[1]
    ego = [s.tracks.position[s.ego_index, :, :2] + s.origin[:2] for s in (whole, second)]
    np.testing.assert_allclose(ego[0][10:30], ego[1], atol=1e-3)
    assert second.lights.state.shape[1] == 20


def test_format_1_has_no_lights(tmp_path: Path) -> None:
    old = scenarios(CONVERTER, fixture.write_dataset(tmp_path / "old", version=1))
    new = scenarios(CONVERTER, fixture.write_dataset(tmp_path / "new", version=2))
    for first, second in zip(old, new, strict=True):
        assert not len(first.lights)
        assert len(second.lights) == 3
        np.testing.assert_allclose(first.tracks.position, second.tracks.position, atol=1e-4)


def test_shards_are_blocks_of_scenes(tmp_path: Path) -> None:
    dataset = fixture.write_dataset(tmp_path / "lyft", num_scenes=40, num_frames=42)
    found = shards(CONVERTER, dataset)
    assert [(shard.name, len(shard.items)) for shard in found] == [
        ("scenes-sample-00000", 32),
        ("scenes-sample-00001", 8),
    ]
    assert found[1].items[0].name == "scenes/sample.zarr:32"
    (first, *_) = CONVERTER.records(found[1])
    assert first.scene.index == 32


def test_recording_as_raw_path(dataset: Path) -> None:
    whole = shards(CONVERTER, dataset)
    assert shards(CONVERTER, recording(dataset)) == whole


def test_recordings_of_other_splits_are_excluded(tmp_path: Path) -> None:
    dataset = fixture.write_dataset(tmp_path / "lyft", name="train", num_scenes=1)
    fixture.write_recording(dataset / "scenes" / "validate.zarr", num_scenes=2, seed=1)
    assert {s.name for s in shards(CONVERTER, dataset, "val")} == {"scenes-validate-00000"}
    assert {s.name for s in shards(CONVERTER, dataset, "train")} == {"scenes-train-00000"}
    assert len(shards(CONVERTER, dataset, "everything")) == 2
    with pytest.raises(SourceNotFound, match=r"of another split are train\.zarr, validate\.zarr"):
        shards(CONVERTER, dataset, "test")


def test_changed_frames_or_map_change_the_shard(dataset: Path) -> None:
    before = {shard.key("1") for shard in shards(CONVERTER, dataset)}
    world.write_map(dataset / "semantic_map" / "semantic_map.pb", is_backward_stored_along=True)
    changed = {shard.key("1") for shard in shards(CONVERTER, dataset)}
    assert before != changed
    shutil.rmtree(recording(dataset))
    fixture.write_recording(recording(dataset), seed=7)
    assert changed != {shard.key("1") for shard in shards(CONVERTER, dataset)}


def test_only_requested_chunks_are_read(dataset: Path) -> None:
    (shard,) = shards(CONVERTER, dataset)
    (recording(dataset) / "agents" / "0").unlink()
    window = list(CONVERTER.records(shard))[-1]
    assert CONVERTER.scenario(shard, window).num_timesteps == 41
    with pytest.raises(CorruptSource, match="missing"):
        CONVERTER.scenario(shard, next(CONVERTER.records(shard)))


# --- tracks ---------------------------------------------------------------------------------------------


def test_labels_and_types(dataset: Path) -> None:
    tracks = scenarios(CONVERTER, dataset)[0].tracks
    words = [word.removeprefix("PERCEPTION_LABEL_") for word in tracks.source_type]
    assert words == [*["CAR"] * 4, *["VAN"] * 2, "CAR", "PEDESTRIAN", "CYCLIST", "BICYCLE", "UNKNOWN", "EGO"]
    types = dict(zip(words, tracks.object_type, strict=True))
    assert types == {
        "CAR": ObjectType.VEHICLE,
        "VAN": ObjectType.VEHICLE,
        "PEDESTRIAN": ObjectType.PEDESTRIAN,
        "CYCLIST": ObjectType.CYCLIST,
        "BICYCLE": ObjectType.OTHER,
        "UNKNOWN": ObjectType.OTHER,
        "EGO": ObjectType.VEHICLE,
    }
    assert not tracks.is_type_assumed.any()


def test_changing_label_is_an_assumption(tmp_path: Path) -> None:
    tables = fixture.recording(1, 30)
    mine = np.flatnonzero(tables["agents"]["track_id"] == 2)
    tables["agents"]["label_probabilities"][mine[:5]] = np.eye(17)[fixture.UNKNOWN]
    fixture.write_tables(tmp_path / "a.zarr", tables)
    (scenario,) = scenarios(CONVERTER, tmp_path, has_map=False)
    row = scenario.tracks.index("2")
    assert scenario.tracks.source_type[row] == "PERCEPTION_LABEL_CAR"
    assert np.flatnonzero(scenario.tracks.is_type_assumed).tolist() == [row]


def test_unknown_objects_can_be_excluded(dataset: Path) -> None:
    kept, dropped = (scenarios(CONVERTER, dataset, keep_unknown=keep)[0].tracks for keep in (True, False))
    assert len(kept) - len(dropped) == 1
    assert "PERCEPTION_LABEL_UNKNOWN" not in dropped.source_type


def test_velocity_of_moving_cars_with_exact_zero_is_estimated(dataset: Path) -> None:
    scenario = scenarios(CONVERTER, dataset)[0]
    tracks = scenario.tracks
    moving = [row for row in range(len(tracks) - 1) if np.ptp(tracks.position[row][tracks.valid[row], 0]) > 1.0]
    assert len(moving) == 8
    for row in moving:
        vx = tracks.velocity[row][tracks.valid[row], 0]
        np.testing.assert_allclose(vx, vx[5], rtol=1e-3)
    assert scenario.extras["num_repaired_velocities"] == 3 * len(moving)
    assert np.flatnonzero(tracks.is_velocity_estimated).tolist() == [*moving, scenario.ego_index]
    parked = np.setdiff1d(np.arange(len(tracks) - 1), moving)
    assert not tracks.velocity[parked].any()


def test_ego_is_added(dataset: Path) -> None:
    scenario = scenarios(CONVERTER, dataset)[0]
    tracks, row = scenario.tracks, scenario.ego_index
    assert scenario.ego_id == "ego"
    assert tracks.valid[row].all()
    np.testing.assert_array_equal(tracks.size[row, 0], np.array([4.87, 1.85, 1.8], np.float32))
    assert np.flatnonzero(tracks.is_size_assumed).tolist() == [row]
    np.testing.assert_allclose(tracks.velocity[row, :, 0], fixture.EGO_SPEED, atol=1e-2)
    assert not scenario.has_z
    assert scenario.origin.tolist() == [-120.0, -2.0, 0.0]


# --- a whole conversion ---------------------------------------------------------------------------------


def test_conversion_stores_the_map_once(dataset: Path, tmp_path: Path) -> None:
    report = convert("lyft", str(dataset), tmp_path / "lake", split="train")
    assert report.is_clean
    assert report.converted == 5
    lake = Lake(tmp_path / "lake")
    assert set(lake.sql("SELECT map_id FROM metadata")["map_id"]) == {"semantic-map"}
    loader = ScenarioLoader(lake)
    loaded = {scenario.id: scenario for scenario in loader}
    for scenario in scenarios(CONVERTER, dataset):
        assert scenario.map is not None
        found = loaded[scenario.id].map
        assert found is not None
        assert list(found.ids) == list(scenario.map.ids)
        assert np.abs(found.polyline.values - scenario.map.polyline.values).max() < 1e-3
    assert convert("lyft", str(dataset), tmp_path / "lake", split="train").converted == 0


# --- invalid input --------------------------------------------------------------------------------------


def test_missing_map_error_names_remedy(dataset: Path) -> None:
    (dataset / "semantic_map" / "semantic_map.pb").unlink()
    with pytest.raises(SourceNotFound, match=r"one semantic_map\.pb .* option has_map to false"):
        shards(CONVERTER, dataset)
    with pytest.raises(SourceNotFound, match="semantic_map"):
        list(CONVERTER.maps(str(dataset), "v1.0", LyftOptions()))
    assert list(CONVERTER.maps(str(dataset), "v1.0", LyftOptions(has_map=False))) == []
    found = scenarios(CONVERTER, dataset, has_map=False)
    assert all(scenario.map is None and scenario.map_id is None for scenario in found)
    assert set(found[0].lights.lane_ids) == set(fixture.SHOWN)


def test_map_folder_option(dataset: Path, tmp_path: Path) -> None:
    wanted, elsewhere = scenarios(CONVERTER, dataset), tmp_path / "elsewhere"
    elsewhere.mkdir()
    for path in (dataset / "semantic_map" / "semantic_map.pb", dataset / "meta.json"):
        path.rename(elsewhere / path.name)
    found = scenarios(CONVERTER, dataset, maps=str(elsewhere))
    assert [differences(a, b) for a, b in zip(found, wanted, strict=True)] == [[]] * len(wanted)
    (shared,) = CONVERTER.maps(str(dataset), "v1.0", LyftOptions(maps=str(elsewhere)))
    assert (shared.root, [item.name for item in shared.items]) == (str(elsewhere), ["semantic_map.pb", "meta.json"])


def test_missing_meta_error_names_remedy(dataset: Path) -> None:
    (dataset / "meta.json").unlink()
    with pytest.raises(SourceNotFound, match=r"one meta\.json"):
        shards(CONVERTER, dataset)


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"world_to_ecef": [[1, 2], [3, 4]]}', '{"world_to_ecef": "x"}'])
def test_damaged_meta_fails_the_map(dataset: Path, text: str) -> None:
    (dataset / "meta.json").write_text(text)
    with pytest.raises(CorruptSource, match=r"meta\.json.*world_to_ecef"):
        scenarios(CONVERTER, dataset)


@pytest.mark.parametrize("make", ["nothing", "empty", "foreign"])
def test_folders_of_other_datasets(tmp_path: Path, make: str) -> None:
    raw = tmp_path / "raw"
    if make != "nothing":
        raw.mkdir()
    if make == "foreign":
        (raw / "scenario.tfrecord").write_bytes(b"x" * 100)
    with pytest.raises(SourceNotFound, match=r"no recordings \(\*\.zarr\)"):
        shards(CONVERTER, raw, has_map=False)


def test_zarr_of_another_dataset_is_named(tmp_path: Path) -> None:
    (tmp_path / "weather.zarr").mkdir()
    (tmp_path / "weather.zarr" / ".zattrs").write_text("{}")
    with pytest.raises(CorruptSource, match=r"weather\.zarr/scenes/\.zarray"):
        scenarios(CONVERTER, tmp_path, has_map=False)


def test_missing_column_is_named(tmp_path: Path) -> None:
    tables = fixture.recording(1, 20)
    tables["frames"] = tables["frames"][["timestamp", "agent_index_interval"]].copy()
    fixture.write_tables(tmp_path / "a.zarr", tables)
    with pytest.raises(CorruptSource, match="is this a Lyft recording"):
        scenarios(CONVERTER, tmp_path, has_map=False)


def test_damaged_recording_fails_alone(tmp_path: Path) -> None:
    dataset = fixture.write_dataset(tmp_path / "lyft", name="a", num_scenes=2)
    fixture.write_recording(dataset / "scenes" / "b.zarr", num_scenes=2, seed=1, num_frames=30)
    (dataset / "scenes" / "a.zarr" / "scenes" / "0").write_bytes(b"")
    report = convert("lyft", str(dataset), tmp_path / "lake", split="train")
    assert report.converted == 2
    ((shard, reason),) = report.failed
    assert shard == "scenes-a-00000"
    assert "scenes/0" in reason


def _break(tables: dict[str, np.ndarray], what: str) -> None:
    scenes, frames, agents = tables["scenes"], tables["frames"], tables["agents"]
    first = int(scenes["frame_index_interval"][1, 0])
    row = int(frames["agent_index_interval"][first, 0])
    if what == "frames that do not exist":
        scenes["frame_index_interval"][1] = (first, 10_000)
    elif what == "no frames":
        scenes["frame_index_interval"][1] = (first, first)
    elif what == "agents that do not exist":
        frames["agent_index_interval"][first + 3] = (9_000, 9_100)
    elif what == "faces that do not exist":
        frames["traffic_light_faces_index_interval"][first] = (-4, 2)
    elif what == "many boxes without a size":
        agents["extent"][row : row + len(agents) // 6] = 0.0
    elif what == "time that stands still":
        frames["timestamp"][first + 4] = frames["timestamp"][first + 3]
    elif what == "an ego nowhere at the current time":
        frames["ego_translation"][first + 7 : first + 14] = np.nan


@pytest.mark.parametrize(
    "what",
    [
        "frames that do not exist",
        "no frames",
        "agents that do not exist",
        "faces that do not exist",
        "many boxes without a size",
        "time that stands still",
        "an ego nowhere at the current time",
    ],
)
def test_inconsistent_scene_is_quarantined(tmp_path: Path, what: str) -> None:
    tables = fixture.recording(3, 30)
    _break(tables, what)
    fixture.write_tables(tmp_path / "raw" / "a.zarr", tables)
    options = LyftOptions(has_map=False)
    (shard,) = CONVERTER.shards(str(tmp_path / "raw"), "train", "v1.0", options)
    refused = 0
    for record in CONVERTER.records(shard):
        try:
            scenario = CONVERTER.scenario(shard, record)
            scenario.validate()
            check_share_of_bad_rows(scenario, options.max_bad_rows)
        except InvalidScenario as error:
            refused += 1
            assert record.scene.index == 1
            assert record.scene.name in str(error)
    assert refused == 1
    report = convert("lyft", str(tmp_path / "raw"), tmp_path / "lake", split="train", options=options)
    assert (report.converted, report.quarantined, report.failed) == (2, 1, [])


@pytest.mark.parametrize("options", [{"window": 0.0}, {"stride": 0.05}, {"radius": -1.0}, {"radius": np.inf}])
def test_options_out_of_range_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(BadParameter):
        LyftOptions(**options)


def test_missing_numcodecs_names_the_extra(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "numcodecs", None)
    with pytest.raises(MissingDependency, match=r"scenarionet-lake\[lyft\]"):
        shards(CONVERTER, dataset)


def test_labels_without_probabilities_are_named(dataset: Path) -> None:
    attributes = recording(dataset) / ".zattrs"
    attributes.write_text(json.dumps({"labels": ["CAR"]}))
    with pytest.raises(CorruptSource, match="a probability for each of 1 labels"):
        scenarios(CONVERTER, dataset)
