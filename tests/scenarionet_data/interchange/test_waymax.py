"""Waymax's examples, decoded by Google's protobuf."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data import ScenarioLoader
from scenarionet_data.converters.formats.tfrecord import read_records
from scenarionet_data.errors import BadParameter
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.waymax.example import packed_varints
from scenarionet_data.interchange.waymax.features import sample_lines
from scenarionet_data.scenario.description import Lights, strings
from scenarionet_data.scenario.vocabulary import LightState, Provenance, is_lane
from tests.scenarionet_data.interchange.conformance import WriterConformance

_FEATURE = ("bytes_list", "BytesList", "TYPE_BYTES"), ("float_list", "FloatList", "TYPE_FLOAT"), (
    "int64_list", "Int64List", "TYPE_INT64",
)  # fmt: skip


def example_class():
    """Return ``tensorflow.Example`` as tensorflow/core/example/{example,feature}.proto define it."""
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    kinds = descriptor_pb2.FieldDescriptorProto
    file = descriptor_pb2.FileDescriptorProto(name="example.proto", package="tensorflow", syntax="proto3")
    feature = descriptor_pb2.DescriptorProto(name="Feature")
    feature.oneof_decl.add(name="kind")
    for number, (name, message, kind) in enumerate(_FEATURE, 1):
        listed = file.message_type.add(name=message)
        listed.field.add(name="value", number=1, label=kinds.LABEL_REPEATED, type=getattr(kinds, kind))
        feature.field.add(
            name=name, number=number, label=kinds.LABEL_OPTIONAL, type=kinds.TYPE_MESSAGE,
            type_name=f".tensorflow.{message}", oneof_index=0,
        )  # fmt: skip
    file.message_type.append(feature)
    features = file.message_type.add(name="Features")
    entry = features.nested_type.add(name="FeatureEntry")
    entry.options.map_entry = True
    entry.field.add(name="key", number=1, label=kinds.LABEL_OPTIONAL, type=kinds.TYPE_STRING)
    message = {"label": kinds.LABEL_OPTIONAL, "type": kinds.TYPE_MESSAGE}
    entry.field.add(name="value", number=2, type_name=".tensorflow.Feature", **message)
    features.field.add(
        name="feature", number=1, label=kinds.LABEL_REPEATED, type=kinds.TYPE_MESSAGE,
        type_name=".tensorflow.Features.FeatureEntry",
    )  # fmt: skip
    example = file.message_type.add(name="Example")
    example.field.add(name="features", number=1, type_name=".tensorflow.Features", **message)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("tensorflow.Example"))


@pytest.fixture(scope="module")
def decode():
    pytest.importorskip("google.protobuf")
    kind = example_class()

    def decoded(content: bytes, folder) -> dict[str, np.ndarray]:
        (folder / "one.tfrecord").write_bytes(content)
        (record,) = read_records(folder / "one.tfrecord")
        assert record.damage is None
        found = {}
        for name, feature in kind.FromString(record.payload).features.feature.items():
            found[name] = np.array(getattr(feature, feature.WhichOneof("kind")).value)
        return found

    return decoded


def write(scenario, **options):
    losses = Losses()
    (content,) = writer_for("waymax", options).write(scenario, "stem", losses).values()
    return content, {loss.what: loss for loss in losses.found()}


class TestWaymax(WriterConformance):
    name = "waymax"

    def test_states_are_those_of_the_scenario(self, lake, decode, tmp_path):
        scenario = ScenarioLoader(lake)[0]
        found = decode(write(scenario)[0], tmp_path)
        ego, first, tracks = scenario.ego_index, scenario.current_timestep - 10, scenario.tracks
        assert bytes(found["scenario/id"][0]).decode() == scenario.source.scenario_id
        assert found["state/is_sdc"].tolist() == [int(row == ego) if row < len(tracks) else -1 for row in range(128)]
        position = np.stack(
            [
                np.concatenate(
                    [found[f"state/{time}/{axis}"].reshape(128, -1) for time in ("past", "current", "future")], 1
                )
                for axis in "xyz"
            ],
            axis=-1,
        )[: len(tracks)]
        steps = slice(first, first + 91)
        valid = tracks.valid[:, steps]
        np.testing.assert_allclose(position[valid], (tracks.position[:, steps] + scenario.origin)[valid], atol=1e-3)
        assert (position[~valid] == -1).all()
        speed = np.hypot(*tracks.velocity[ego, scenario.current_timestep])
        assert found["state/current/speed"][ego] == pytest.approx(speed, abs=1e-5)
        assert found["state/current/timestamp_micros"][ego] == 1_000_000
        assert found["state/type"][: len(tracks)].tolist() == tracks.object_type.tolist()

    def test_road_graph_has_a_point_every_half_metre(self, lake, decode, tmp_path):
        scenario = ScenarioLoader(lake)[0]
        found = decode(write(scenario)[0], tmp_path)
        valid = found["roadgraph_samples/valid"] == 1
        xyz, number = found["roadgraph_samples/xyz"].reshape(-1, 3)[valid], found["roadgraph_samples/id"][valid]
        gaps = np.linalg.norm(np.diff(xyz, axis=0), axis=1)[number[1:] == number[:-1]]
        assert gaps.max() <= 0.751
        lanes = np.isin(found["roadgraph_samples/type"][valid], (1, 2, 3))
        assert len(set(number[lanes])) == int(is_lane(scenario.map.feature_type).sum())
        lengths = np.linalg.norm(found["roadgraph_samples/dir"].reshape(-1, 3)[valid], axis=1)
        assert lengths == pytest.approx(np.ones(len(lengths)), abs=1e-5)

    def test_points_far_from_the_ego_are_left_out_first(self, lake, decode, tmp_path):
        scenario = ScenarioLoader(lake)[0]
        whole, (content, losses) = decode(write(scenario)[0], tmp_path), write(scenario, points=500)
        found = decode(content, tmp_path)
        count = int((whole["roadgraph_samples/valid"] == 1).sum())
        assert losses["points of the map, far from the ego"].count == count - 500
        ego = scenario.tracks.position[scenario.ego_index] + scenario.origin

        def apart(example):
            kept = example["roadgraph_samples/valid"] == 1
            points = example["roadgraph_samples/xyz"].reshape(-1, 3)[kept]
            return np.sort(np.hypot(*(points[:, None] - ego[None])[..., :2].T).min(axis=0))

        assert apart(found).max() <= apart(whole)[500] + 5.0, "the path is looked at once a second"

    def test_paths_begin_at_the_ego_and_one_is_the_route(self, lake, decode, tmp_path):
        for scenario in ScenarioLoader(lake):
            found = decode(write(scenario)[0], tmp_path)
            valid = found["path_samples/valid"].reshape(45, 800) == 1
            xyz = found["path_samples/xyz"].reshape(45, 800, 3)
            on_route = found["path_samples/on_route"] == 1
            assert on_route[0] and (np.diff(on_route.astype(int)) <= 0).all()
            ego = scenario.tracks.position[scenario.ego_index] + scenario.origin
            for path in xyz[valid.any(axis=1)]:
                assert np.hypot(*(path[0] - ego[scenario.current_timestep - 10])[:2]) < 4.5
            path = xyz[0][valid[0]]
            assert np.hypot(*(path - ego[scenario.current_timestep + 80])[:, :2].T).min() < 3.0
            np.testing.assert_allclose(np.linalg.norm(np.diff(path, axis=0), axis=1), 0.5, atol=0.02)

    def test_lights_are_written_at_each_step(self, lake, decode, tmp_path):
        scenario = ScenarioLoader(lake)[0]
        lanes = scenario.map.ids[is_lane(scenario.map.feature_type)]
        state = np.zeros((2, scenario.num_timesteps), np.uint8)
        state[0], state[1, ::2] = LightState.LANE_STATE_STOP, LightState.TRAFFIC_LIGHT_GREEN
        lights = Lights(
            ids=strings(["a", "b"]), lane_ids=strings([lanes[0], "elsewhere"]),
            stop_point=np.array([[1, 2, 0], [3, 4, 0]], np.float32), state=state,
            is_lane_in_map=np.array([True, False]), provenance=np.full(2, Provenance.OBSERVED, np.uint8),
        )  # fmt: skip
        content, losses = write(replace(scenario, lights=lights))
        found = decode(content, tmp_path)
        shown = found["traffic_light_state/future/state"].reshape(80, 16)
        assert losses["lanes of traffic lights that are not in the map"].count == 1
        assert (shown[:, 0] == 4).all() and shown[:2, 1].tolist() in ([-1, 6], [6, -1]) and (shown[:, 2:] == -1).all()
        x = found["traffic_light_state/current/x"]
        assert x[0] == pytest.approx(1 + scenario.origin[0], abs=1e-3)

    def test_far_source_frames_are_moved(self, lake, decode, tmp_path):
        near = ScenarioLoader(lake)[0]
        content, losses = write(replace(near, origin=near.origin + np.array([664_000.0, 4e6, 0.0])))
        assert losses["origins of source frames, too far away for 32 bits"].count == 1
        found = decode(content, tmp_path)
        now = near.tracks.position[near.ego_index, near.current_timestep]
        assert found["state/current/x"][near.ego_index] == pytest.approx(now[0], abs=1e-4)

    def test_of_many_objects_the_nearest_are_kept(self, lake, decode, tmp_path):
        scenario = ScenarioLoader(lake)[0]
        tracks, count = scenario.tracks, 140
        rows = np.concatenate([np.full(count, (scenario.ego_index + 1) % len(tracks)), [scenario.ego_index]])
        many = replace(tracks, **{name: getattr(tracks, name)[rows] for name in tracks.__dataclass_fields__})
        position = many.position.copy()
        position[:count, :, 1] += 10.0 * np.arange(count)[:, None]
        ids = strings([*(str(each) for each in range(count)), "1000"])
        many = replace(many, position=position, ids=ids, valid=np.ones_like(many.valid))
        content, losses = write(replace(scenario, tracks=many, ego_id="1000"))
        assert losses["objects beyond 128"].count == 13
        kept = decode(content, tmp_path)["state/id"]
        assert kept.max() == 1000 and set(kept[:100]) <= {*map(float, range(count))}

    def test_number_of_points_is_checked(self):
        with pytest.raises(BadParameter, match="wanted a number from 1"):
            writer_for("waymax", {"points": 0})


def test_varints_by_hand():
    assert packed_varints(np.array([0, 1, 127, 128, 300])) == bytes([0, 1, 0x7F, 0x80, 1, 0xAC, 2])
    assert packed_varints(np.array([-1])) == bytes([0xFF] * 9 + [1])
    assert packed_varints(np.array([3, 2])) == bytes([3, 2])


def test_lines_are_sampled_by_hand():
    line = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.7, 0.0]])
    points, direction, owner = sample_lines([line, np.array([[9.0, 9.0, 9.0]])])
    assert points[:, :2].tolist() == [[0, 0], [0.5, 0], [1, 0], [1, 0.7], [9, 9]]
    assert direction[:, :2].tolist() == [[1, 0], [1, 0], [0, 1], [0, 1], [0, 0]]
    assert owner.tolist() == [0, 0, 0, 0, 1]
