"""Damaged Waymo files, and messages with inconsistent values."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scenarionet_data.converters.waymo import Waymo
from scenarionet_data.errors import CorruptSource, InvalidScenario
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


@pytest.mark.parametrize(
    ("number", "wanted"),
    [(2, "origin"), (7, "tracks.size"), (8, "tracks.heading"), (9, "tracks.velocity")],
)
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_non_finite_numbers_are_refused(tmp_path: Path, number: int, wanted: str, value: float):
    bad = field(number, value if number == 2 else np.float32(value))
    assert refused(tmp_path, single(state(1.0)[2:] + bad)).field == wanted


def single(content: bytes) -> bytes:
    """A scenario with a single state of the ego."""
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
    assert "expected a track, 0 to 13" in error.reason


def test_ego_missing(tmp_path: Path):
    error = refused(tmp_path, field(1, 0.0) + field(2, field(1, 8) + state(1.0)) + field(5, "x"))
    assert (error.field, error.reason) == ("sdc_track_index", "expected a track, 0 to 0, found none")


def test_ego_invalid_at_current_timestep(tmp_path: Path):
    assert refused(tmp_path, single(field(4, 1.0) + field(11, False))).field == "ego_id"


def test_current_time_out_of_range(tmp_path: Path):
    assert refused(tmp_path, PAYLOAD + field(10, 91)).field == "current_timestep"


def test_prediction_out_of_range(tmp_path: Path):
    assert refused(tmp_path, PAYLOAD + field(11, field(1, 14))).field == "tracks_to_predict"


def test_timestamps_that_do_not_increase(tmp_path: Path):
    assert (
        refused(tmp_path, scenario_bytes(6, num_steps=3).replace(field(1, 0.0), field(1, 7.0), 1)).field == "timestamps"
    )
