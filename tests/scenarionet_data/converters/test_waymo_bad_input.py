"""Damaged Waymo files, and messages with inconsistent values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.converters.waymo import Waymo
from scenarionet_data.errors import CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightState
from tests.fixtures.reading import scenarios, shards
from tests.fixtures.waymo import field, frame, renamed, scenario_bytes, state, write_tfrecord

CONVERTER = Waymo()
PAYLOAD = scenario_bytes(5)
NAME = "training.tfrecord-00000-of-01000"


def refused(tmp_path: Path, payload: bytes) -> InvalidScenario:
    """Message of the error with which a scenario is refused."""
    with pytest.raises(InvalidScenario) as caught:
        write_tfrecord(tmp_path / NAME, [payload])
        scenarios(CONVERTER, tmp_path)[0].validate()
    return caught.value


def test_damaged_record_does_not_affect_the_others(tmp_path: Path):
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


def test_damaged_length_costs_that_record(tmp_path: Path) -> None:
    payloads = [renamed(PAYLOAD, letter) for letter in "abc"]
    path = write_tfrecord(tmp_path / NAME, payloads)
    data = bytearray(path.read_bytes())
    data[len(frame(payloads[0])) + 2] ^= 0x10
    path.write_bytes(data)
    (shard,) = shards(CONVERTER, tmp_path)
    records = list(CONVERTER.records(shard))
    assert [record.damage for record in records] == [None, "damaged record length", None]
    assert CONVERTER.scenario(shard, records[2]).source.scenario_id == "c"


def test_files_without_scenarios_are_passed_over(tmp_path: Path) -> None:
    laser = renamed(PAYLOAD, "a") + field(12, b"laser") * 2  # of which the fixture has one, and one camera token
    write_tfrecord(tmp_path / "scenario" / "training" / NAME, [laser])
    write_tfrecord(tmp_path / "tf_example" / "training" / "training_tfexample.tfrecord-00000-of-01000", [b""])
    write_tfrecord(tmp_path / "lidar_and_camera" / "training" / "637f20cafde22ff8.tfrecord", [b""])
    (tmp_path / "scenario" / "training" / f"{NAME[:-1]}1_.gstmp").write_bytes(b"half")
    found = shards(CONVERTER, tmp_path)
    assert [item.name for shard in found for item in shard.items] == [f"scenario/training/{NAME}"]
    listed = list(CONVERTER.passed_over(str(tmp_path), "train", CONVERTER.Options(), found))
    assert [(each.count, each.reason) for each in listed] == [
        (1, "an unfinished download"),
        (1, "not read by this converter"),
        (1, "not read by this converter"),
        (3, "sensor data is not stored"),
        (1, "sensor data is not stored"),
    ]
    with pytest.raises(SourceNotFound, match="belongs to another part of the dataset"):
        shards(CONVERTER, tmp_path / "tf_example")


def test_other_message_type_does_not_affect_the_others(tmp_path: Path):
    write_tfrecord(tmp_path / NAME, [b"not protobuf", PAYLOAD, field(1, field(1, b"tf.Example"))])
    (shard,) = shards(CONVERTER, tmp_path)
    first, sound, last = CONVERTER.records(shard)
    CONVERTER.scenario(shard, sound).validate()
    for record, reason in ((first, "a protobuf message, found invalid data"), (last, "tf_example")):
        with pytest.raises(InvalidScenario, match=reason):
            CONVERTER.scenario(shard, record)


@pytest.mark.parametrize("keep", [0, 3, 20, 40_000])
def test_truncated_file(tmp_path: Path, keep: int):
    path = write_tfrecord(tmp_path / NAME, [PAYLOAD])
    path.write_bytes(path.read_bytes()[:keep])
    with pytest.raises(CorruptSource, match=NAME):
        scenarios(CONVERTER, tmp_path)


@pytest.mark.parametrize("cut", [3, 20, 40_000])
def test_records_before_a_truncation_are_converted(tmp_path: Path, cut: int):
    """The last record and all after it are missing: that is one record in quarantine, with the remedy."""
    path = write_tfrecord(tmp_path / NAME, [PAYLOAD, PAYLOAD])
    path.write_bytes(path.read_bytes()[:-cut] if cut > 3 else frame(PAYLOAD) + b"abc")
    (shard,) = shards(CONVERTER, tmp_path)
    whole, rest = CONVERTER.records(shard)
    CONVERTER.scenario(shard, whole).validate()
    with pytest.raises(InvalidScenario, match=r"truncated.*download the file again"):
        CONVERTER.scenario(shard, rest)


def single(content: bytes) -> bytes:
    """A scenario with a single state of the ego."""
    return b"".join(
        [field(1, 0.0), field(2, field(1, 8) + field(2, 1) + field(3, content)), field(5, "x"), field(6, 0)]
    )


def found(tmp_path: Path, payload: bytes) -> ScenarioDescription:
    """The scenario of a message; it is valid."""
    write_tfrecord(tmp_path / NAME, [payload])
    (scenario,) = scenarios(CONVERTER, tmp_path)
    scenario.validate()
    return scenario


SIGN = field(8, field(1, 900) + field(7, field(2, field(1, 0.0) + field(2, 0.0) + field(3, 0.0))))
STEPS = b"".join(field(1, 0.1 * k) for k in range(5)) + SIGN
EGO = field(2, field(1, 8) + field(2, 1) + b"".join(state(float(k)) for k in range(5)))


@pytest.mark.parametrize(
    ("number", "value", "wanted", "reason"),
    [
        (2, np.nan, "position", "expected finite metres"),
        (2, 1e300, "position", "expected a position within 10,000 m"),
        (3, 2e4, "position", "expected a position within 10,000 m"),
        (5, np.float32(0), "size", "expected a size above 0"),
        (7, np.float32(1e9), "size", "expected a size above 0 and up to 200 m"),
        (8, np.float32(np.inf), "heading", "expected finite radians"),
        (9, np.float32(np.nan), "velocity", "expected a velocity of up to 150 m/s"),
    ],
)
def test_bad_state_costs_that_state(tmp_path: Path, number: int, value: float, wanted: str, reason: str) -> None:
    states = [state(float(k)) for k in range(5)]
    states[2] = field(3, states[2][2:] + field(number, value))
    other = field(2, field(1, 9) + field(2, 2) + b"".join(states))
    scenario = found(tmp_path, STEPS + EGO + other + field(5, "x") + field(6, 0))
    assert scenario.tracks.valid.tolist() == [[True] * 5, [True, True, False, True, True]]
    (defect,) = scenario.defects
    assert (defect.table, defect.field, defect.action, defect.count) == ("tracks", wanted, "dropped", 1)
    assert (defect.file, defect.location) == (NAME, "track 9 step 2")
    assert defect.reason.startswith(reason)


def test_bad_state_of_the_ego_is_interpolated_and_flagged(tmp_path: Path) -> None:
    states = [state(float(k)) for k in range(5)]
    states[2] = field(3, states[2][2:] + field(2, np.nan))
    ego = field(2, field(1, 8) + field(2, 1) + b"".join(states))
    scenario = found(tmp_path, STEPS + ego + field(5, "x") + field(6, 0) + field(10, 2))
    assert scenario.tracks.valid.all()
    assert scenario.tracks.is_interpolated.tolist() == [[False, False, True, False, False]]
    assert scenario.tracks.position[0, 2].tolist() == pytest.approx(scenario.tracks.position[0, [1, 3]].mean(axis=0))
    assert [(each.action, each.location) for each in scenario.defects] == [
        ("dropped", "track 8 step 2"),
        ("assumed", "step 2"),
    ]


def test_tracks_that_cannot_be_used_cost_themselves(tmp_path: Path) -> None:
    short = field(2, field(1, 9) + field(2, 1) + state(1.0) * 3)
    again = field(2, field(1, 8) + field(2, 1) + state(50.0) * 5)
    strange = field(2, field(1, 10) + field(2, 77) + state(20.0) * 5)
    targets = b"".join(field(11, field(1, row)) for row in (0, 1, 3, 9))
    of_interest = field(4, 8) + field(4, 9)
    scenario = found(
        tmp_path, STEPS + EGO + short + again + strange + field(5, "x") + field(6, 0) + targets + of_interest
    )
    assert scenario.tracks.ids.tolist() == ["8", "10"]
    assert scenario.tracks.is_type_assumed.tolist() == [False, True]
    assert scenario.tracks_to_predict == (("8", 0), ("10", 0))
    assert scenario.objects_of_interest == ("8",)
    assert {(each.field, each.action): each.count for each in scenario.defects} == {
        ("states", "dropped"): 3,
        ("id", "dropped"): 5,
        ("object_type", "assumed"): 1,
        ("objects_of_interest", "assumed"): 1,
        ("tracks_to_predict", "assumed"): 2,
    }


def test_lights_that_cannot_be_used_are_flagged(tmp_path: Path) -> None:
    def light(state: int, x: float) -> bytes:
        return field(1, field(1, 5) + field(2, state) + field(3, field(1, x) + field(2, 0.0) + field(3, 0.0)))

    steps = b"".join(field(7, light(4, 1e12)) for _ in range(4)) + field(7, light(99, 1.0)) + field(7, light(4, 1.0))
    scenario = found(tmp_path, STEPS + EGO + field(5, "x") + field(6, 0) + steps)
    assert scenario.lights.state.tolist() == [[LightState.LANE_STATE_STOP] * 4 + [LightState.LANE_STATE_UNKNOWN]]
    assert np.isnan(scenario.lights.stop_point).all()
    assert {(each.table, each.field, each.action): each.count for each in scenario.defects} == {
        ("lights", "dynamic_map_states", "dropped"): 1,
        ("lights", "state", "assumed"): 1,
        ("lights", "stop_point", "assumed"): 4,
    }


def test_bad_feature_costs_that_feature(tmp_path: Path) -> None:
    def feature(name: int, *xs: float, limit: float = 0.0) -> bytes:
        points = b"".join(field(8, field(1, x) + field(2, 0.0) + field(3, 0.0)) for x in xs)
        return field(8, field(1, name) + field(3, field(1, limit) + points))

    features = [
        feature(1, 0.0, 5.0, limit=25.0),
        feature(2, 0.0, np.nan),
        feature(1, 7.0, 9.0),
        feature(3, 5.0, 1e9),
        feature(4, 5.0, 9.0, limit=1e9),
        field(8, field(1, 6) + field(15, b"later")),
    ]
    scenario = found(tmp_path, STEPS.removesuffix(SIGN) + EGO + field(5, "x") + field(6, 0) + b"".join(features))
    assert scenario.map is not None
    assert scenario.map.ids.tolist() == ["1", "4"]
    assert scenario.map.polyline[0][:, 0].tolist() == [0.0, 5.0]
    assert np.isnan(scenario.map.speed_limit).tolist() == [False, True]
    assert [(each.table, each.field, each.action, each.location) for each in scenario.defects] == [
        ("maps", "id", "dropped", "feature 1"),
        ("maps", "points", "dropped", "feature 2"),
        ("maps", "points", "dropped", "feature 3"),
        ("maps", "speed_limit_mph", "assumed", "feature 4"),
        ("maps", "feature_data", "dropped", "features"),
    ]


@pytest.mark.parametrize("index", [14, 99, -3])
def test_ego_out_of_range(tmp_path: Path, index: int):
    error = refused(tmp_path, PAYLOAD + field(6, index))
    assert (error.scenario_id, error.field) == ("waymo/v1.2/0000000000000005", "sdc_track_index")
    assert "expected a track, 0 to 13" in error.reason


def test_ego_missing(tmp_path: Path):
    error = refused(tmp_path, field(1, 0.0) + field(2, field(1, 8) + state(1.0)) + field(5, "x"))
    assert (error.field, error.reason) == ("sdc_track_index", "expected a track, 0 to 0, found none")


def test_ego_invalid_at_current_timestep(tmp_path: Path):
    assert refused(tmp_path, single(field(4, 1.0) + field(11, False))).field == "ego_id"


def test_current_time_out_of_range(tmp_path: Path):
    assert refused(tmp_path, PAYLOAD + field(10, 91)).field == "current_timestep"


def test_timestamps_that_do_not_increase(tmp_path: Path):
    assert (
        refused(tmp_path, scenario_bytes(6, num_steps=3).replace(field(1, 0.0), field(1, 7.0), 1)).field == "timestamps"
    )


def test_record_without_map_is_said(tmp_path: Path) -> None:
    (defect,) = found(tmp_path, STEPS.removesuffix(SIGN) + EGO + field(5, "x") + field(6, 0)).defects
    assert (defect.table, defect.action, defect.location) == ("maps", "assumed", "the whole map")


def test_times_that_do_not_increase_are_named(tmp_path: Path) -> None:
    error = refused(tmp_path, STEPS.replace(field(1, 0.1 * 3), field(1, 0.1)) + EGO + field(5, "x") + field(6, 0))
    assert error.reason == "wanted strictly increasing times, found [0.2, 0.1] s at timesteps 2 and 3"
