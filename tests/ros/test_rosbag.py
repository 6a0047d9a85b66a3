"""Bags as rosbags reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from scenarionet_data import ScenarioDescription
from scenarionet_data.interchange import writer_for
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.ros.messages import messages
from tests.fixtures.drives import Other, make_drive

pytestmark = pytest.mark.ros

FORMATS = [("rosbag", {}), ("rosbag2", {"storage": "mcap"}), ("rosbag2", {"storage": "sqlite3"})]
PICTURES = {"front": [bytes([255, 216, k]) for k in range(41)]}


@pytest.fixture(scope="module")
def scenario() -> ScenarioDescription:
    return make_drive("bag", others=(Other(25.0, 3.5, vx=4.0, first=3),), red=True)


def read(folder: Path, files: dict[str, bytes]) -> dict[str, list[tuple[int, Any]]]:
    """Times [ns] and messages by topic."""
    for name, content in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    bag = folder / next(iter(files))
    found: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([bag if bag.suffix == ".bag" else bag.parent]) as reader:
        for connection, stamp, content in reader.messages():
            found.setdefault(connection.topic, []).append((stamp, reader.deserialize(content, connection.msgtype)))
    return found


@pytest.mark.parametrize(("name", "options"), FORMATS)
def test_a_bag_has_what_was_recorded(
    scenario: ScenarioDescription, tmp_path: Path, name: str, options: dict[str, str]
) -> None:
    writer = writer_for(name, options)
    files = dict(writer.write(scenario, "x", Losses(), PICTURES))  # type: ignore[call-arg]  # it holds pictures
    found, tracks = read(tmp_path, files), scenario.tracks
    assert [stamp for stamp, _ in found["/odom"]] == (
        1_000_000_000 + np.round(scenario.timestamps * 1e9).astype(np.int64)
    ).tolist()
    for timestep, (stamp, odometry) in enumerate(found["/odom"]):
        place, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
        position, height = tracks.position[scenario.ego_index, timestep], tracks.size[scenario.ego_index, timestep, 2]
        np.testing.assert_allclose([place.x, place.y, place.z + height / 2], position, atol=1e-6)
        assert 2 * np.arctan2(turn.z, turn.w) == pytest.approx(tracks.heading[scenario.ego_index, timestep])
        assert odometry.twist.twist.linear.x == pytest.approx(10.0, abs=1e-4)
        assert odometry.header.stamp.sec * 1_000_000_000 + odometry.header.stamp.nanosec == stamp
        shown = found["/markers"][timestep][1].markers[1:]
        assert len(shown) == tracks.valid[:, timestep].sum() - 1
        if name == "rosbag2":
            boxes = {each.id: each.bbox for each in found["/objects"][timestep][1].detections}
            for row, track in enumerate(tracks.ids):
                if row != scenario.ego_index and tracks.valid[row, timestep]:
                    at = boxes[track].center.position
                    np.testing.assert_array_equal([at.x, at.y, at.z], tracks.position[row, timestep].astype(float))
            (light,) = found["/traffic_lights"][timestep][1].detections
            assert light.results[0].hypothesis.class_id == "red"
    assert len(found["/map"]) == 1 and len(found["/map"][0][1].markers) > 2
    pictures = [message.data.tobytes() for _, message in found["/camera/front/image_raw/compressed"]]
    assert pictures == PICTURES["front"]


@pytest.mark.parametrize(("name", "options"), FORMATS)
def test_equal_scenarios_give_equal_bytes(scenario: ScenarioDescription, name: str, options: dict[str, str]) -> None:
    writer = writer_for(name, options)
    assert writer.write(scenario, "x", Losses()) == writer.write(scenario, "x", Losses())


@pytest.mark.parametrize(
    ("kind", "digest"),
    [
        ("tf2_msgs/msg/TFMessage", "94810edda583a504dfda3829e70d7eec"),
        ("nav_msgs/msg/Odometry", "cd5e73d190d741a2f92e81eda573aca7"),
        ("visualization_msgs/msg/MarkerArray", "d155b9ce5188fbaf89745847fd5882d7"),
    ],
)
def test_digests_of_ros_1_are_the_published_ones(kind: str, digest: str) -> None:
    assert messages(1).store.generate_msgdef(kind, ros_version=1)[1] == digest
