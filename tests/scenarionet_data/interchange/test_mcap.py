"""MCAP as the owner's reader decodes it."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from scenarionet_data import ScenarioLoader
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.mcap.writer import LAYOUT
from tests.scenarionet_data.interchange.conformance import WriterConformance


class TestMcap(WriterConformance):
    name = "mcap"


def decoded(content):
    """Messages by topic: pairs of log time [ns] and message."""
    found = {}
    reader = make_reader(io.BytesIO(content), decoder_factories=[DecoderFactory()], validate_crcs=True)
    for _, channel, message, decoded_message in reader.iter_decoded_messages():
        found.setdefault(channel.topic, []).append((message.log_time, decoded_message))
    return found


@pytest.fixture(scope="module")
def scenario(lake):
    return ScenarioLoader(lake)[0]


@pytest.fixture(scope="module")
def messages(scenario):
    return decoded(writer_for("mcap").write(scenario, "x", Losses())["x.mcap"])


def test_boxes_are_where_and_as_large_as_recorded(scenario, messages):
    tracks = scenario.tracks
    assert len(messages["/objects"]) == scenario.num_timesteps
    count = 0
    for timestep, (nanoseconds, update) in enumerate(messages["/objects"]):
        assert nanoseconds == round(scenario.timestamps[timestep] * 1e9)
        names = {f"{track}": row for row, track in enumerate(tracks.ids)}
        for entity in update.entities:
            row = names[entity.id.split(" ", 1)[1]]
            (cube,) = entity.cubes
            assert tracks.valid[row, timestep]
            position = [cube.pose.position.x, cube.pose.position.y, cube.pose.position.z]
            np.testing.assert_array_equal(np.float32(position), tracks.position[row, timestep])
            np.testing.assert_array_equal(
                np.float32([cube.size.x, cube.size.y, cube.size.z]), tracks.size[row, timestep]
            )
            turn = 2 * np.arctan2(cube.pose.orientation.z, cube.pose.orientation.w)
            assert np.cos(turn - tracks.heading[row, timestep]) == pytest.approx(1.0, abs=1e-12)
            count += 1
    assert count == tracks.valid.sum()


def test_boxes_grow_with_their_objects(scenario):
    size = scenario.tracks.size.copy()
    size[:, 5:] *= 1.5
    grown = replace(scenario, tracks=replace(scenario.tracks, size=size))
    updates = decoded(writer_for("mcap").write(grown, "x", Losses())["x.mcap"])["/objects"]
    for timestep in (0, 4, 5, 6):
        rows = np.flatnonzero(scenario.tracks.valid[:, timestep])
        lengths = [entity.cubes[0].size.x for entity in updates[timestep][1].entities]
        np.testing.assert_array_equal(np.float32(lengths), size[rows, timestep, 0])


def test_objects_that_left_are_taken_away(messages):
    assert all([deletion.type for deletion in update.deletions] == [1] for _, update in messages["/objects"])


def test_the_map_and_paths_come_once(scenario, messages):
    (map_message,) = messages["/map"]
    lanes = next(entity for entity in map_message[1].entities if entity.id == "lanes")
    np.testing.assert_array_equal(
        np.float32([[point.x, point.y, point.z] for point in lanes.lines[0].points]), scenario.map.polyline[0]
    )
    ((_, paths),) = messages["/paths"]
    assert [len(entity.lines[0].points) for entity in paths.entities] == scenario.tracks.valid.sum(axis=1).tolist()


def test_the_frame_of_the_ego_moves_with_it(scenario, messages):
    translations = [[frame.translation.x, frame.translation.y, frame.translation.z] for _, frame in messages["/tf"]]
    np.testing.assert_array_equal(np.float32(translations), scenario.tracks.position[scenario.ego_index])


def test_lights_have_the_colours_of_their_states(lake):
    scenario = next(each for each in ScenarioLoader(lake) if len(each.lights))
    updates = decoded(writer_for("mcap").write(scenario, "x", Losses())["x.mcap"])["/lights"]
    colors = {(round(s.color.r, 2), round(s.color.g, 2)) for _, u in updates for e in u.entities for s in e.spheres}
    assert len(colors) > 1
    first = np.flatnonzero((scenario.lights.state[:, 0] != 0) & np.isfinite(scenario.lights.stop_point).all(axis=1))[0]
    hung = updates[0][1].entities[0].spheres[0].pose.position
    np.testing.assert_allclose([hung.x, hung.y, hung.z], scenario.lights.stop_point[first] + [0, 0, 4.0])
    assert len(updates[0][1].entities) == int((scenario.lights.state[:, 0] != 0).sum())


def test_pictures_are_messages_at_their_timesteps(scenario):
    images = [b"\xff\xd8" + bytes([number]) for number in range(scenario.num_timesteps)]
    files = writer_for("mcap").write(scenario, "x", Losses(), {"chase": images})
    found = decoded(files["x.mcap"])["/camera/chase"]
    assert [message.data for _, message in found] == images
    assert found[3][0] == round(scenario.timestamps[3] * 1e9)
    assert "/camera/chase" in json.dumps(json.loads(files[LAYOUT]))


def test_paths_can_be_left_out(scenario):
    assert "/paths" not in decoded(writer_for("mcap", {"paths": False}).write(scenario, "x", Losses())["x.mcap"])
