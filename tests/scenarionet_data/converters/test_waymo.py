"""The Waymo converter as a whole: conformance on written and recorded data, and every part of a scenario."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.converters.boundary_segments import to_records
from scenarionet_data.converters.waymo import Waymo
from scenarionet_data.errors import SourceNotFound
from scenarionet_data.scenario.canonical_json import from_json, to_json
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType
from scenarionet_data.testing import ConverterConformance
from tests.fixtures import waymo as fixture
from tests.fixtures.reading import scenarios, shards
from tests.fixtures.waymo import field, points, scenario_bytes, state, write_tfrecord

CONVERTER = Waymo()
PAYLOAD = scenario_bytes(5)
NAME = "training.tfrecord-00000-of-01000"


class TestWritten(ConverterConformance):
    converter = CONVERTER

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        write_tfrecord(folder / "raw" / NAME, [scenario_bytes(seed) for seed in (1, 2)])
        write_tfrecord(folder / "raw" / "more" / NAME, [scenario_bytes(3, packed=True)])
        return folder / "raw"


@pytest.mark.long
class TestTwentySeconds(ConverterConformance):
    converter = CONVERTER

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("raw")
        payloads = [scenario_bytes(4, num_steps=198), scenario_bytes(5, num_steps=199)]
        write_tfrecord(folder / "raw" / "training_20s.tfrecord-00000-of-01000", payloads)
        return folder / "raw"


class TestRecorded(ConverterConformance):
    converter = CONVERTER

    @pytest.fixture(scope="class")
    @classmethod
    def raw(cls, recordings: Path) -> Path:
        return recordings / "waymo" / "training"


def convert(tmp_path: Path, *payloads: bytes) -> list[ScenarioDescription]:
    """Convert a file of the given messages."""
    write_tfrecord(tmp_path / NAME, payloads)
    return scenarios(CONVERTER, tmp_path)


# --- shards --------------------------------------------------------------------------------------------


def test_shards_of_a_folder_tree(tmp_path: Path):
    for name in (
        "a.tfrecord",
        "x/a.tfrecord",
        "x_a.tfrecord",
        "y z/validation.tfrecord-00001-of-00150",
        "notes.txt",
    ):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"")
    found = {shard.items[0].name: shard for shard in shards(CONVERTER, tmp_path)}
    assert set(found) == {"a.tfrecord", "x/a.tfrecord", "x_a.tfrecord", "y z/validation.tfrecord-00001-of-00150"}
    names = [shard.name for shard in found.values()]
    assert len(set(names)) == len(names)
    assert found["a.tfrecord"].name == "a.tfrecord"
    assert all(shard.paths[0].is_file() for shard in found.values())
    assert all(set(name) <= set("abcdefghijklmnopqrstuvwxyz_-.0123456789") for name in names)


def test_sidecars_are_not_listed_as_shards(tmp_path: Path):
    path = write_tfrecord(tmp_path / NAME, [PAYLOAD])
    for ending in ("_.gstmp", ".crc", ".md5", ".json"):
        (tmp_path / f"{NAME}{ending}").write_bytes(b"x")
    assert [shard.name for shard in shards(CONVERTER, tmp_path)] == [NAME]
    path.unlink()
    with pytest.raises(SourceNotFound, match=r"nothing named \*\.tfrecord\*"):
        shards(CONVERTER, tmp_path)
    with pytest.raises(SourceNotFound, match="give the folder with files like"):
        shards(CONVERTER, tmp_path / f"{NAME}.md5")


def test_single_file_as_raw_path(tmp_path: Path):
    path = write_tfrecord(tmp_path / NAME, [PAYLOAD])
    (shard,) = shards(CONVERTER, path)
    assert (shard.name, shard.items[0].name, shard.root) == (NAME, NAME, str(tmp_path))
    (scenario,) = scenarios(CONVERTER, path)
    assert scenario.source.file == NAME


def test_folder_without_waymo_files_is_refused(tmp_path: Path):
    (tmp_path / "scenario_1.parquet").write_bytes(b"PAR1")
    with pytest.raises(SourceNotFound, match=r"nothing named \*\.tfrecord\*.*training\.tfrecord-00000-of-01000"):
        shards(CONVERTER, tmp_path)
    with pytest.raises(SourceNotFound, match="no such folder"):
        shards(CONVERTER, tmp_path / "missing")


# --- content -------------------------------------------------------------------------------------------


def test_scenario(tmp_path: Path):
    (scenario,) = convert(tmp_path, PAYLOAD)
    scenario.validate()
    assert scenario.id == "waymo/v1.2/0000000000000005"
    assert (scenario.split, scenario.version, scenario.dt, scenario.current_timestep) == ("train", "v1.2", 0.1, 10)
    assert (scenario.num_timesteps, scenario.timestamps[0], scenario.has_z) == (91, 0.0, True)
    assert scenario.timestamps[1] != 0.1
    assert scenario.source.licence == "Waymo Dataset License Agreement for Non-Commercial Use"
    assert scenario.source.log is None
    ids = scenario.tracks.ids.tolist()
    assert scenario.ego_id == ids[-1] == "191"
    assert scenario.objects_of_interest == ("100", "191")
    assert scenario.tracks_to_predict == (("191", 1), ("100", 2), ("107", 0))
    assert scenario.extras == {}


def test_tracks(tmp_path: Path):
    (scenario,) = convert(tmp_path, PAYLOAD)
    tracks = scenario.tracks
    kinds = [ObjectType.PEDESTRIAN, ObjectType.CYCLIST, ObjectType.OTHER] * 2 + [ObjectType.VEHICLE] * 8
    assert tracks.object_type.tolist() == kinds
    assert tracks.valid[-1].all()
    assert not tracks.valid.all()
    first = tracks.position[-1, 0] + scenario.origin
    assert np.abs(tracks.position[-1, 0]).max() <= 0.5
    assert np.allclose(first[2], fixture.PLACE[2], atol=2.0)
    assert np.array_equal(scenario.origin, np.round(scenario.origin))


def test_times_start_at_zero(tmp_path: Path):
    late = scenario_bytes(6, num_steps=3)
    late = late.replace(field(1, 0.0), field(1, -0.5), 1)
    (scenario,) = convert(tmp_path, late)
    assert scenario.timestamps[0] == 0.0
    assert scenario.timestamps[1] > 0.59


def test_lights(tmp_path: Path):
    (scenario,) = convert(tmp_path, PAYLOAD)
    lights = scenario.lights
    assert lights.ids.tolist() == lights.lane_ids.tolist() == ["3", "103", "9000"]
    assert lights.is_lane_in_map.tolist() == [True, True, False]
    assert lights.state[0, ::10].tolist() == [
        *range(LightState.LANE_STATE_UNKNOWN, 10),
        LightState.LANE_STATE_UNKNOWN,
    ]
    assert lights.state[1, :4].tolist() == [LightState.ABSENT, LightState.LANE_STATE_STOP] * 2
    assert set(lights.state[2, :45]) == {LightState.ABSENT}
    assert set(lights.state[2, 45:]) == {LightState.LANE_STATE_GO}
    assert np.isnan(lights.stop_point[1]).all()
    assert np.isfinite(lights.stop_point[[0, 2]]).all()


def test_scenario_without_lights_and_map(tmp_path: Path):
    parts = [field(1, 0.0), field(2, field(1, 8) + field(2, 1) + state(1.0)), field(5, "x"), field(6, 0)]
    (scenario,) = convert(tmp_path, b"".join(parts))
    scenario.validate()
    assert scenario.map is None
    assert len(scenario.lights) == 0


def test_types_of_map_features(tmp_path: Path):
    features = convert(tmp_path, PAYLOAD)[0].map
    assert features is not None
    types = dict(zip(features.ids, (MapFeatureType(code).name for code in features.feature_type), strict=True))
    lanes = [types[str(100 * row)] for row in range(4)]
    assert lanes == ["LANE_SURFACE_STREET", "LANE_BIKE_LANE", "LANE_UNKNOWN", "LANE_FREEWAY"]
    assert [types[str(2000 + k)] for k in range(9)] == [MapFeatureType(16 + k).name for k in range(9)]
    assert [types[str(2100 + k)] for k in range(3)] == ["UNKNOWN", "ROAD_EDGE_BOUNDARY", "ROAD_EDGE_MEDIAN"]
    assert types["2200"] == "STOP_SIGN"
    assert [types[str(2300 + k)] for k in range(3)] == ["CROSSWALK", "SPEED_BUMP", "DRIVEWAY"]


def test_geometry_of_map_features(tmp_path: Path):
    (scenario,) = convert(tmp_path, PAYLOAD)
    features = scenario.map
    assert features is not None
    row = {name: index for index, name in enumerate(features.ids)}
    lane = features.polyline[row["0"]] + scenario.origin
    assert lane.shape == (101, 3)
    assert np.abs(lane[0] - fixture.PLACE).max() < 1e-4
    assert features.polyline[row["2200"]].shape == (1, 3)
    assert features.polygon[row["2300"]].shape == (4, 3)
    assert len(features.polyline[row["2300"]]) == len(features.polygon[row["0"]]) == 0


def test_links_of_map_features(tmp_path: Path):
    features = convert(tmp_path, PAYLOAD)[0].map
    assert features is not None
    row = {name: index for index, name in enumerate(features.ids)}
    assert features.entry_lanes[row["101"]].tolist() == ["100"]
    assert features.exit_lanes[row["101"]].tolist() == ["102"]
    assert features.exit_lanes[row["103"]].tolist() == ["9000"]
    assert features.left_neighbors[row["101"]].tolist() == ["201"]
    assert features.right_neighbors[row["101"]].tolist() == ["1"]
    assert features.left_boundaries[row["101"]].tolist() == ["2001", "2001"]
    assert features.right_boundaries[row["1"]].tolist() == ["2101"]
    assert features.controlled_lanes[row["2200"]].tolist() == ["3", "9000"]
    limits = features.speed_limit[[row[name] for name in ("0", "100", "200", "2000")]]
    assert np.allclose(limits[[0, 2]], [25 * 0.44704, 35 * 0.44704])
    assert np.isnan(limits[[1, 3]]).all()  # a bike lane's limit of 0, and no limit at all


def test_link_details_match_metadrive(tmp_path: Path):
    features = convert(tmp_path, PAYLOAD)[0].map
    assert features is not None
    row = {name: index for index, name in enumerate(features.ids)}
    detail = to_records(from_json(features.extras[row["101"]]))
    assert detail["interpolating"] is True
    assert detail["left_boundaries"] == [segment(0, 50, 2001), segment(50, 100, 2001)]
    assert detail["right_boundaries"] == [segment(0, 100, 2000)]
    indices = {
        "self_start_index": "0",
        "self_end_index": "100",
        "neighbor_start_index": "1",
        "neighbor_end_index": "99",
    }
    boundaries = [segment(0, 33, 2001), segment(33, 100, 2001)]
    assert detail["left_neighbor"] == [{"feature_id": "201", **indices, "boundaries": boundaries}]
    edge = to_records(from_json(features.extras[row["0"]]))["right_boundaries"]
    assert edge == [{**segment(0, 100, 2101), "boundary_type": "UNKNOWN"}]
    assert features.extras[row["2000"]] is None


def segment(start: int, end: int, line: int) -> dict[str, str]:
    kind = MapFeatureType(16 + line % 9).name
    indices = {"lane_start_index": str(start), "lane_end_index": str(end)}
    return {**indices, "boundary_type": kind, "boundary_feature_id": str(line)}


def test_extras_are_canonical_json(tmp_path: Path):
    features = convert(tmp_path, PAYLOAD)[0].map
    assert features is not None
    texts = [text for text in features.extras if text is not None]
    assert len(texts) == 16
    assert texts == [to_json(json.loads(text)) for text in texts]


def test_unknown_features_are_counted(tmp_path: Path):
    later = field(8, field(1, 77) + field(15, points(1, np.zeros((2, 3)))))
    assert convert(tmp_path, PAYLOAD + later)[0].extras == {"num_unknown_map_features": 1}
