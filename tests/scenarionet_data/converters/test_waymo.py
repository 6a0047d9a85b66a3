"""The Waymo converter as a whole: conformance on written and recorded data, meaning of every part, bad input."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.converters.stretches import to_records
from scenarionet_data.converters.waymo import Waymo
from scenarionet_data.errors import CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.jsontext import from_json, to_json
from scenarionet_data.scenario import ScenarioDescription
from scenarionet_data.testing import ConverterConformance
from scenarionet_data.vocabulary import LightState, MapFeatureType, ObjectType
from tests.fixtures import waymo as fixture
from tests.fixtures.reading import scenarios, shards
from tests.fixtures.waymo import field, frame, points, renamed, scenario_bytes, write_tfrecord

CONVERTER = Waymo()
PAYLOAD = scenario_bytes(5)
NAME = "training.tfrecord-00000-of-01000"


class TestWritten(ConverterConformance):
    converter = CONVERTER

    @pytest.fixture
    def raw(self, tmp_path: Path) -> Path:
        write_tfrecord(tmp_path / "raw" / NAME, [scenario_bytes(seed) for seed in (1, 2)])
        write_tfrecord(tmp_path / "raw" / "more" / NAME, [scenario_bytes(3, packed=True)])
        return tmp_path / "raw"


class TestTwentySeconds(ConverterConformance):
    converter = CONVERTER

    @pytest.fixture
    def raw(self, tmp_path: Path) -> Path:
        payloads = [scenario_bytes(4, num_steps=198), scenario_bytes(5, num_steps=199)]
        write_tfrecord(tmp_path / "raw" / "training_20s.tfrecord-00000-of-01000", payloads)
        return tmp_path / "raw"


class TestRecorded(ConverterConformance):
    converter = CONVERTER

    @pytest.fixture
    def raw(self, recordings: Path) -> Path:
        return recordings / "waymo" / "training"


def convert(tmp_path: Path, *payloads: bytes) -> list[ScenarioDescription]:
    """The scenarios of a file of these messages."""
    write_tfrecord(tmp_path / NAME, payloads)
    return scenarios(CONVERTER, tmp_path)


def refused(tmp_path: Path, payload: bytes) -> InvalidScenario:
    """Why a message is not accepted."""
    with pytest.raises(InvalidScenario) as caught:
        convert(tmp_path, payload)[0].validate()
    return caught.value


# --- shards --------------------------------------------------------------------------------------------


def test_shards_of_a_tree(tmp_path: Path):
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


def test_a_single_file(tmp_path: Path):
    path = write_tfrecord(tmp_path / NAME, [PAYLOAD])
    (shard,) = shards(CONVERTER, path)
    assert (shard.name, shard.items[0].name, shard.root) == (NAME, NAME, str(tmp_path))
    (scenario,) = scenarios(CONVERTER, path)
    assert scenario.source.file == NAME


def test_nothing_of_waymo_is_there(tmp_path: Path):
    (tmp_path / "scenario_1.parquet").write_bytes(b"PAR1")
    with pytest.raises(SourceNotFound, match=r"nothing named \*\.tfrecord\*.*training\.tfrecord-00000-of-01000"):
        shards(CONVERTER, tmp_path)
    with pytest.raises(SourceNotFound, match="no such folder"):
        shards(CONVERTER, tmp_path / "missing")


# --- meaning -------------------------------------------------------------------------------------------


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


def test_no_lights_and_no_map(tmp_path: Path):
    parts = [field(1, 0.0), field(2, field(1, 8) + field(2, 1) + state(1.0)), field(5, "x"), field(6, 0)]
    (scenario,) = convert(tmp_path, b"".join(parts))
    scenario.validate()
    assert scenario.map is None
    assert len(scenario.lights) == 0


def state(x: float) -> bytes:
    numbers = [field(k, np.float32(1.0)) for k in range(5, 11)]
    return field(3, b"".join([field(2, x), field(3, 0.0), field(4, 0.0), *numbers, field(11, True)]))


def test_types_of_map_features(tmp_path: Path):
    features = convert(tmp_path, PAYLOAD)[0].map
    assert features is not None
    types = dict(zip(features.ids, (MapFeatureType(code).name for code in features.types), strict=True))
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


def test_detail_of_links_is_metadrives(tmp_path: Path):
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


# --- bad input -----------------------------------------------------------------------------------------


def test_a_damaged_record_leaves_the_others(tmp_path: Path):
    payloads = [renamed(PAYLOAD, letter) for letter in "abc"]
    path = write_tfrecord(tmp_path / NAME, payloads)
    data = bytearray(path.read_bytes())
    data[len(frame(payloads[0])) + 5000] ^= 0x10
    path.write_bytes(data)
    (shard,) = shards(CONVERTER, tmp_path)
    first, damaged, last = CONVERTER.records(shard)
    assert [CONVERTER.scenario(shard, record).source.scenario_id for record in (first, last)] == ["a", "c"]
    with pytest.raises(InvalidScenario, match="wrong checksum") as caught:
        CONVERTER.scenario(shard, damaged)
    assert caught.value.scenario_id == f"{NAME}@{len(frame(payloads[0]))}"


def test_a_record_of_another_message_leaves_the_others(tmp_path: Path):
    write_tfrecord(tmp_path / NAME, [b"not protobuf", PAYLOAD, field(1, field(1, b"tf.Example"))])
    (shard,) = shards(CONVERTER, tmp_path)
    first, sound, last = CONVERTER.records(shard)
    CONVERTER.scenario(shard, sound).validate()
    for record, reason in ((first, "no protobuf message"), (last, "tf_example")):
        with pytest.raises(InvalidScenario, match=reason):
            CONVERTER.scenario(shard, record)


@pytest.mark.parametrize("keep", [0, 3, 20, 40_000])
def test_truncated_file(tmp_path: Path, keep: int):
    path = write_tfrecord(tmp_path / NAME, [PAYLOAD])
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(CorruptSource, match=NAME):
        scenarios(CONVERTER, tmp_path)


@pytest.mark.parametrize(
    ("number", "wanted"),
    [(2, "origin"), (7, "tracks.size"), (8, "tracks.heading"), (9, "tracks.velocity")],
)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_numbers_that_are_none(tmp_path: Path, number: int, wanted: str, value: float):
    bad = field(number, value if number == 2 else np.float32(value))
    assert refused(tmp_path, single(state(1.0)[2:] + bad)).field == wanted


def single(content: bytes) -> bytes:
    """A scenario of one state of the ego."""
    return b"".join(
        [field(1, 0.0), field(2, field(1, 8) + field(2, 1) + field(3, content)), field(5, "x"), field(6, 0)]
    )


def test_coordinate_beyond_float32(tmp_path: Path):
    other = field(2, field(1, 9) + field(3, state(1.0)[2:] + field(2, 1e300)))
    assert refused(tmp_path, single(state(1.0)[2:]) + other).field == "tracks.position"


@pytest.mark.parametrize("index", [14, 99, -3])
def test_ego_out_of_range(tmp_path: Path, index: int):
    error = refused(tmp_path, PAYLOAD + field(6, index))
    assert (error.scenario_id, error.field) == ("waymo/v1.2/0000000000000005", "sdc_track_index")
    assert "wanted a track, 0 ... 13" in error.reason


def test_ego_missing(tmp_path: Path):
    error = refused(tmp_path, field(1, 0.0) + field(2, field(1, 8) + state(1.0)) + field(5, "x"))
    assert (error.field, error.reason) == ("sdc_track_index", "wanted a track, 0 ... 0, found none")


def test_ego_not_seen_now(tmp_path: Path):
    assert refused(tmp_path, single(field(4, 1.0) + field(11, False))).field == "ego_id"


def test_current_time_out_of_range(tmp_path: Path):
    assert refused(tmp_path, PAYLOAD + field(10, 91)).field == "current_timestep"


def test_prediction_out_of_range(tmp_path: Path):
    assert refused(tmp_path, PAYLOAD + field(11, field(1, 14))).field == "tracks_to_predict"


def test_times_that_stand_still(tmp_path: Path):
    assert (
        refused(tmp_path, scenario_bytes(6, num_steps=3).replace(field(1, 0.0), field(1, 7.0), 1)).field == "timestamps"
    )


# --- the real record -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def recorded(recordings: Path) -> ScenarioDescription:
    (scenario,) = scenarios(CONVERTER, recordings / "waymo" / "training")
    return scenario


def test_recorded_scenario(recorded: ScenarioDescription):
    assert recorded.id == "waymo/v1.2/637f20cafde22ff8"
    assert (recorded.num_timesteps, recorded.current_timestep, recorded.ego_index) == (91, 10, 82)
    assert recorded.timestamps[:3].tolist() == [0.0, 0.10002, 0.20004]
    ids = recorded.tracks.ids
    assert recorded.tracks_to_predict == ((ids[72], 1), (ids[43], 1), (ids[42], 2))
    assert recorded.objects_of_interest == ()


def test_recorded_tracks(recorded: ScenarioDescription):
    tracks = recorded.tracks
    assert Counter(tracks.object_type.tolist()) == {1: 70, 2: 10, 3: 3}
    assert (tracks.valid.size, tracks.valid.sum()) == (7553, 4596)
    first = tracks.position[0, 0].astype(np.float64) + recorded.origin
    assert np.abs(first - [-7792.00341796875, -6685.171875, -184.56889502760163]).max() < 1e-4
    assert tracks.size[0, 0].tolist() == [np.float32(v) for v in (4.77667904, 2.06968188, 1.53438318)]


def test_recorded_lights(recorded: ScenarioDescription):
    lights = recorded.lights
    assert (len(lights), lights.is_lane_in_map.all()) == (12, True)
    counts = Counter(lights.state.ravel().tolist())
    assert counts == {
        LightState.LANE_STATE_UNKNOWN: 540,
        LightState.LANE_STATE_STOP: 324,
        LightState.LANE_STATE_ARROW_STOP: 228,
    }
    wanted = [-7811.181793532099, -6717.757387275526, -185.15017390612329]
    assert np.abs(lights.stop_point[0] + recorded.origin - wanted).max() < 1e-4


def test_recorded_map(recorded: ScenarioDescription):
    features = recorded.map
    assert features is not None
    groups = Counter(MapFeatureType(code).name.split("_")[0] for code in features.types)
    assert groups == {"LANE": 199, "ROAD": 87, "STOP": 8, "CROSSWALK": 4, "SPEED": 3}
    assert len(features) == 301
    assert (len(features.polyline.values) + len(features.polygon.values)) == 19_636
    assert len(features.left_neighbors.values) + len(features.right_neighbors.values) == 382
    assert len(features.left_boundaries.values) + len(features.right_boundaries.values) == 364
    assert len(features.exit_lanes.values) + len(features.entry_lanes.values) == 386
    texts = [text for text in features.extras if text is not None]
    assert texts == [to_json(json.loads(text)) for text in texts]
    stop = features.controlled_lanes[features.ids.tolist().index("594")]
    assert stop.tolist() == ["213", "212", "211", "210"]
