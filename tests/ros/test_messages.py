"""Messages of ROS 2: their bytes against another serialiser, their types against ROS, numbers against the scene."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from scenarionet_data.errors import SourceError
from scenarionet_data.interchange.ros.messages import messages
from scenarionet_sim.bridges.dds_wire import idl_type
from scenarionet_sim.bridges.link import StackMoment
from scenarionet_sim.bridges.ros_topics import ANSWERS, OPTIONS, TOPICS, decode, moment_messages, topics
from scenarionet_sim.bridges.sensing import CAMERA, LIDAR, SENSORS, StackSensors
from scenarionet_sim.planners.view import View
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch
from tests.fixtures.drives import Other, make_drive

pytestmark = pytest.mark.ros

ROS = messages(2)
AHEAD = Other(20.0, 0.5)
STAMP = 12_345_678_901


@pytest.fixture(scope="module")
def view() -> View:
    world = World.from_scenario(make_drive("seen", others=(AHEAD,), red=True))
    simulation = Simulation([world], (Replay(),))
    return View(world, simulation.state, 0, world.ego)


@pytest.fixture(scope="module")
def found(view: View) -> dict[str, Any]:
    moment = StackMoment(view, STAMP, True, StackSensors(SENSORS).look(view))
    return dict(moment_messages(ROS, moment, topics(2, OPTIONS)))


@pytest.mark.parametrize("topic", TOPICS)
def test_bytes_are_those_of_cyclonedds(found: dict[str, Any], topic: str) -> None:
    content = ROS.encode(found[topic])
    kind = idl_type(TOPICS[topic].kind).__idl__
    assert bytes(kind.serialize(kind.deserialize(content), use_version_2=False)) == content


@pytest.mark.parametrize(
    ("kind", "digits"),
    [
        ("std_msgs/msg/String", "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"),
        ("rosgraph_msgs/msg/Clock", "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"),
        ("nav_msgs/msg/Odometry", "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"),
        ("tf2_msgs/msg/TFMessage", "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"),
        ("sensor_msgs/msg/PointCloud2", "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"),
        ("nav_msgs/msg/Path", "1957a5bb3cee5da65c4e52e52b65a93df227efce4c20f8458b36e73066ca334b"),
        ("sensor_msgs/msg/Image", "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47"),
        ("sensor_msgs/msg/CompressedImage", "15640771531571185e2efc8a100baf923961a4d15d5569652e6cb6691e8e371a"),
        ("sensor_msgs/msg/CameraInfo", "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275"),
        ("sensor_msgs/msg/LaserScan", "64c191398013af96509d518dac71d5164f9382553fce5c1f8cca5be7924bd828"),
        ("vision_msgs/msg/Detection3DArray", "793f5eab9595ac1c0da07873cc859db42eae51f0ee76056db8562515d830e018"),
        (
            "ackermann_msgs/msg/AckermannDriveStamped",
            "48ca7612a08d3bb72744fd98b71b7cf2ea24c6ad50fa4e1aa0bbad963c90d8cf",
        ),
        ("geometry_msgs/msg/TwistStamped", "5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64"),
    ],
)
def test_hashes_are_those_that_ros_prints(kind: str, digits: str) -> None:
    """Of rmw_zenoh, docs/design.md, and of keys that programs for ROS 2 Jazzy name."""
    assert ROS.store.hash_rihs01(kind) == f"RIHS01_{digits}"


def test_a_corner_is_where_camera_info_and_transforms_put_it(view: View, found: dict[str, Any]) -> None:
    """The edges of the box in the picture of instances, against the projection of its corners by messages alone."""
    box = found["objects"].detections[0].bbox
    transforms = {each.child_frame_id: each.transform for each in found["tf"].transforms}
    at, size = box.center.position, box.size
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2
    corners = [at.x, at.y, at.z] + signs * [size.x, size.y, size.z]
    for frame in ("base_link", "camera"):
        moved, turn = transforms[frame].translation, transforms[frame].rotation
        x, y, z, w = turn.x, turn.y, turn.z, turn.w
        rotation = np.array([
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ])  # fmt: skip
        corners = (corners - [moved.x, moved.y, moved.z]) @ rotation
    pixels = corners @ found["camera/camera_info"].k.reshape(3, 3).T
    pixels = pixels[:, :2] / pixels[:, 2:]
    agents = np.array([[0, view.row]], np.int32)
    camera = replace(CAMERA, channels=("instance",), are_boxes=True)
    seen = camera.frames(WorldBatch([view.world]), view.state, agents)["instance"][0]
    rows, columns = np.nonzero(seen == view.objects.rows[0])
    assert columns.min() == pytest.approx(pixels[:, 0].min(), abs=1.0)
    assert columns.max() == pytest.approx(pixels[:, 0].max(), abs=1.0)
    assert rows.min() == pytest.approx(pixels[:, 1].min(), abs=1.0)
    assert rows.max() == pytest.approx(pixels[:, 1].max(), abs=1.0)


def test_sensors_see_the_car_ahead(found: dict[str, Any]) -> None:
    length, width = (found["objects"].detections[0].bbox.size.x, found["objects"].detections[0].bbox.size.y)
    scan = found["scan"]
    assert scan.ranges[0] == pytest.approx(AHEAD.x - length / 2, abs=0.01)
    assert np.isinf(scan.ranges[180])
    cloud = found["points"]
    points = cloud.data.view(np.float32).reshape(-1, 4)
    assert (cloud.width, cloud.row_step) == (len(points), 16 * len(points))
    on_car = (np.abs(points[:, 1] - AHEAD.y) < width / 2) & (np.abs(points[:, 2] + LIDAR.mount.z - 0.8) < 0.4)
    nearest = points[on_car & (points[:, 0] > 10.0)][:, 0].min()
    assert nearest + LIDAR.mount.x == pytest.approx(AHEAD.x - length / 2, abs=0.3)
    image, packed = found["camera/image_raw"], found["camera/image_raw/compressed"]
    assert (image.height, image.width, image.step, image.data.size) == (360, 640, 1920, 360 * 1920)
    decoded = np.asarray(Image.open(io.BytesIO(packed.data.tobytes())).convert("RGB")).astype(float)
    assert np.abs(decoded - image.data.reshape(360, 640, 3)).mean() < 6.0


def test_lights_are_told(found: dict[str, Any]) -> None:
    (light,) = found["traffic_lights"].detections
    assert light.results[0].hypothesis.class_id == "red"


def test_every_message_of_a_moment_has_its_time(found: dict[str, Any]) -> None:
    assert found["clock"].clock.sec * 1_000_000_000 + found["clock"].clock.nanosec == STAMP
    headers = [found[name].header for name in ("odom", "scan", "points", "camera/image_raw", "camera/camera_info")]
    assert all(header.stamp == found["clock"].clock for header in headers)


def test_the_route_and_the_map_come_once(view: View) -> None:
    names = [name for name, _ in moment_messages(ROS, StackMoment(view, STAMP, False), topics(2, ("map",)))]
    assert names == ["tf", "odom", "objects", "traffic_lights", "clock"]


def test_a_plan_is_read_with_its_times() -> None:
    poses = []
    for number in range(3):
        header = ROS.header(STAMP + number * 100_000_000, "map")
        poses.append(ROS.make("geometry_msgs/PoseStamped", header=header, pose=ROS.pose(number, 2.0, 0.5)))
    plan = ROS.make("nav_msgs/Path", header=ROS.header(STAMP, "map"), poses=poses)
    stamp, command = decode(ROS, "plan", ROS.encode(plan))
    assert stamp == STAMP
    np.testing.assert_allclose(command.times, [0.0, 0.1, 0.2])
    np.testing.assert_allclose(command.poses, [[0, 2, 0.5], [1, 2, 0.5], [2, 2, 0.5]])


@pytest.mark.parametrize("topic", ANSWERS)
def test_half_an_answer_is_a_sentence(topic: str) -> None:
    with pytest.raises(SourceError, match="compare the definitions of both sides"):
        decode(ROS, topic, b"\0\1\0\0\1\0\0\0")
