"""Topics that a stack of ROS gets and answers on, and the messages of a moment on them.

``base_link`` is on the ground under the centre of the vehicle's box, x forward, y left, z up.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float32
from scenarionet_data.errors import BadParameter, SourceError
from scenarionet_data.interchange.ros.messages import RosMessages
from scenarionet_data.scenario.vocabulary import LightColor, LightState, MapFeatureType, ObjectType
from scenarionet_sim.bridges.commands import Command, Steer, Twist
from scenarionet_sim.bridges.link import NS, StackMoment
from scenarionet_sim.bridges.sensing import CAMERA, LIDAR, SCAN, jpeg
from scenarionet_sim.planners.base import Trajectory
from scenarionet_sim.planners.view import View


class Topic(NamedTuple):
    """A topic.

    Attributes:
        kind: Its type.
        content: What is on it, for the documentation.
        needs: The option that it is there with; empty for always.
        is_of_ros2: Whether ROS 1 lacks the type.
        is_once: Whether it is there only where a scenario begins.
    """

    kind: str
    content: str
    needs: str = ""
    is_of_ros2: bool = False
    is_once: bool = False


TOPICS = {
    "tf": Topic("tf2_msgs/msg/TFMessage", "`map` to `base_link`, and `base_link` to `camera` and `lidar`"),
    "odom": Topic("nav_msgs/msg/Odometry", "pose in `map`, speed and yaw rate in `base_link`"),
    "objects": Topic(
        "vision_msgs/msg/Detection3DArray",
        "boxes of the other objects, as in the recording or as traffic moves them",
        is_of_ros2=True,
    ),
    "traffic_lights": Topic(
        "vision_msgs/msg/Detection3DArray",
        "stop points of the lights; class `green`, `yellow`, `red` or `unknown`; id: the lane",
        is_of_ros2=True,
    ),
    "route": Topic("nav_msgs/msg/Path", "the way to take", is_once=True),
    "map": Topic(
        "visualization_msgs/msg/MarkerArray", "lanes, lines and edges as line strips", needs="map", is_once=True
    ),
    "markers": Topic("visualization_msgs/msg/MarkerArray", "the other objects as boxes, for viewers", needs="markers"),
    "camera/image_raw": Topic("sensor_msgs/msg/Image", "rgb8, 640 x 360 pixels", needs="camera"),
    "camera/image_raw/compressed": Topic("sensor_msgs/msg/CompressedImage", "the same as JPEG", needs="compressed"),
    "camera/camera_info": Topic("sensor_msgs/msg/CameraInfo", "its intrinsics", needs="camera"),
    "points": Topic(
        "sensor_msgs/msg/PointCloud2", "x, y, z, intensity of a lidar of 32 rings and 1085 azimuths", needs="lidar"
    ),
    "scan": Topic("sensor_msgs/msg/LaserScan", "360 rays in the plane, to 50 m, from `base_link`", needs="scan"),
    "clock": Topic("rosgraph_msgs/msg/Clock", "the moment"),
}
"""What a stack gets at each moment, in this order."""

OPTIONS = tuple(dict.fromkeys(topic.needs for topic in TOPICS.values() if topic.needs))
"""Options that add topics."""

ANSWERS = {
    "ackermann_cmd": Topic(
        "ackermann_msgs/msg/AckermannDriveStamped",
        "steering angle, speed, and the acceleration to reach it with; 0: as quickly as possible",
    ),
    "cmd_vel": Topic("geometry_msgs/msg/TwistStamped", "speed and yaw rate"),
    "plan": Topic("nav_msgs/msg/Path", "poses in `map`, each with its stamp, followed by `--tracker`"),
}
"""What a stack answers on: one of them, with the stamp of the moment."""

_COLORS = {
    ObjectType.VEHICLE: (0.26, 0.52, 0.84, 1.0),
    ObjectType.PEDESTRIAN: (0.94, 0.63, 0.19, 1.0),
    ObjectType.CYCLIST: (0.25, 0.66, 0.38, 1.0),
}
_GREY = (0.6, 0.6, 0.6, 1.0)


def topics(version: int, options: Collection[str]) -> dict[str, str]:
    """Return the types of the topics that a stack gets, by name, in order."""
    wanted = set(options) | ({"camera"} if "compressed" in options else set())
    return {
        name: topic.kind
        for name, topic in TOPICS.items()
        if (not topic.needs or topic.needs in wanted) and (version == 2 or not topic.is_of_ros2)
    }


def moment_messages(ros: RosMessages, moment: StackMoment, names: Collection[str]) -> Iterator[tuple[str, Any]]:
    """Yield topic and message of a moment, in the order of TOPICS.

    Args:
        ros: Makes messages.
        moment: The moment.
        names: The topics.
    """
    view, header = moment.view, ros.header(moment.stamp, "map")
    for name in names:
        if moment.is_first or not TOPICS[name].is_once:
            yield name, _message(ros, name, moment, view, header)


def _message(ros: RosMessages, name: str, moment: StackMoment, view: View, header: Any) -> Any:
    ego, seen = view.ego, moment.seen
    match name:
        case "tf":
            turned = ros.pose(0.0, 0.0, ego.heading).orientation
            own = ros.header(moment.stamp, "base_link")
            frames = [ros.transform(header, "base_link", (ego.x, ego.y, 0.0), turned)]
            if "camera" in seen:  # right, down, ahead
                mount = CAMERA.mount
                frames.append(ros.transform(own, "camera", (mount.x, mount.y, mount.z), ros.turn(-0.5, 0.5, -0.5, 0.5)))
            if "lidar" in seen:
                mount = LIDAR.mount
                frames.append(ros.transform(own, "lidar", (mount.x, mount.y, mount.z), ros.turn(0.0, 0.0, 0.0, 1.0)))
            return ros.make("tf2_msgs/TFMessage", transforms=frames)
        case "odom":
            return ros.odometry(header, ros.pose(ego.x, ego.y, ego.heading), ego.speed, ego.yaw_rate)
        case "objects":
            found = [
                ros.detection(header, track, kind.name.lower(), pose, size)
                for track, kind, pose, size in _boxes(ros, view)
            ]
            return ros.detections(header, found)
        case "traffic_lights":
            return ros.detections(header, list(_lights(ros, view, header)))
        case "route":
            xyh = zip(*view.route.centreline.T.tolist(), view.route.heading.tolist(), strict=True)
            return ros.path(header, [ros.pose(*each) for each in xyh])
        case "map":
            return ros.markers(header, list(_map(ros, view, header)))
        case "markers":
            boxes = [
                ros.cube(header, f"{kind.name.lower()} {track}", number, pose, size, _COLORS.get(kind, _GREY))
                for number, (track, kind, pose, size) in enumerate(_boxes(ros, view))
            ]
            return ros.markers(header, boxes)
        case "clock":
            return ros.make("rosgraph_msgs/Clock", clock=header.stamp)
    return sensor_message(ros, name, moment.stamp, seen)


def sensor_message(ros: RosMessages, name: str, stamp: int, seen: dict[str, Array]) -> Any:
    """Return the message of a sensor's topic; arrays as of :class:`~scenarionet_sim.bridges.sensing.StackSensors`."""
    frame = {"points": "lidar", "scan": "base_link"}.get(name, "camera")
    header = ros.header(stamp, frame)
    match name:
        case "camera/image_raw":
            height, width, _ = seen["camera"].shape
            return ros.make(
                "sensor_msgs/Image", header=header, height=height, width=width, encoding="rgb8", is_bigendian=0,
                step=3 * width, data=seen["camera"].reshape(-1),
            )  # fmt: skip
        case "camera/image_raw/compressed":
            return ros.make(
                "sensor_msgs/CompressedImage", header=header, format="rgb8; jpeg compressed bgr8",
                data=jpeg(seen["camera"]),
            )  # fmt: skip
        case "camera/camera_info":
            return camera_info(ros, header)
        case "points":
            return point_cloud(ros, header, LIDAR.points(seen["lidar"]))
        case "scan":
            ranges = np.where(seen["scan"] < 1.0, seen["scan"] * SCAN.range, np.inf).astype(np.float32)
            step = 2.0 * math.pi / SCAN.rays
            return ros.make(
                "sensor_msgs/LaserScan", header=header, angle_min=0.0, angle_max=2.0 * math.pi - step,
                angle_increment=step, time_increment=0.0, scan_time=0.1, range_min=0.0, range_max=SCAN.range,
                ranges=ranges, intensities=np.zeros(0, np.float32),
            )  # fmt: skip
    raise BadParameter(f"{name!r} is no topic of a sensor")


def _boxes(ros: RosMessages, view: View) -> Iterator[tuple[str, ObjectType, Any, list[float]]]:
    """Yield track id, type, pose of the box's centre and size of each object."""
    found = view.objects
    for row, track in enumerate(found.track_ids):
        (x, y), size = found.position[row].tolist(), found.size[row].tolist()
        kind = ObjectType(found.object_type[row])
        yield str(track), kind, ros.pose(x, y, float(found.heading[row]), size[2] / 2.0), size


def _lights(ros: RosMessages, view: View, header: Any) -> Iterator[Any]:
    lights, lane_ids = view.lights, view.world.roads.lane_ids
    for lane, (x, y), state, color in zip(
        lights.lane.tolist(), lights.stop.tolist(), lights.state.tolist(), lights.color.tolist(), strict=True
    ):
        if state != LightState.ABSENT and math.isfinite(x):
            name = str(lane_ids[lane]) if lane >= 0 else ""
            yield ros.detection(header, name, LightColor(color).name.lower(), ros.pose(x, y, 0.0), (0.0, 0.0, 0.0))


def _map(ros: RosMessages, view: View, header: Any) -> Iterator[Any]:
    """Yield a line strip for each lane, named by its id, and for each stretch of lines and edges."""
    roads = view.world.roads
    for number, line in enumerate(roads.lanes):
        yield ros.line(header, f"lane {roads.lane_ids[number]}", number, line, _GREY)
    cuts = np.flatnonzero((roads.segments[1:, :2] != roads.segments[:-1, 2:]).any(axis=1)) + 1
    kinds = np.split(roads.segment_type, cuts)
    for number, part in enumerate(np.split(roads.segments, cuts)):
        if len(part):
            name = MapFeatureType(kinds[number][0]).name.lower()
            yield ros.line(header, name, number, np.concatenate([part[:, :2], part[-1:, 2:]]), (1.0, 1.0, 1.0, 1.0))


def camera_info(ros: RosMessages, header: Any) -> Any:
    """Return the intrinsics; ROS counts the centre of the first pixel as 0, a camera as 0.5."""
    fx, fy, cx, cy = CAMERA.matrix
    cx, cy = cx - 0.5, cy - 0.5
    capital = str.upper if ros.version == 1 else str
    arrays = {
        "d": np.zeros(5),
        "k": np.array([fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]),
        "r": np.eye(3).reshape(-1),
        "p": np.array([fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0]),
    }
    whole = ros.make("sensor_msgs/RegionOfInterest", x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
    return ros.make(
        "sensor_msgs/CameraInfo", header=header, height=CAMERA.height, width=CAMERA.width,
        distortion_model="plumb_bob", binning_x=0, binning_y=0, roi=whole,
        **{capital(key): value for key, value in arrays.items()},
    )  # fmt: skip


def point_cloud(ros: RosMessages, header: Any, points: Float32) -> Any:
    """Return points (n, 4) x, y, z [m] and intensity as PointCloud2."""
    fields = [
        ros.make("sensor_msgs/PointField", name=name, offset=4 * number, datatype=7, count=1)
        for number, name in enumerate(("x", "y", "z", "intensity"))
    ]
    return ros.make(
        "sensor_msgs/PointCloud2", header=header, height=1, width=len(points), fields=fields, is_bigendian=False,
        point_step=16, row_step=16 * len(points), data=np.ascontiguousarray(points).view(np.uint8).reshape(-1),
        is_dense=True,
    )  # fmt: skip


def decode(ros: RosMessages, topic: str, content: bytes) -> tuple[int, Command]:
    """Return the stamp [ns] and the command of an answer.

    Raises:
        SourceError: The content is no message of the topic's type.
        BadParameter: A plan is no trajectory.
    """
    message = decoded(ros, topic, content, ANSWERS[topic].kind)
    stamp = nanoseconds(message.header.stamp)
    if topic == "cmd_vel":
        return stamp, Twist(float(message.twist.linear.x), float(message.twist.angular.z))
    if topic == "ackermann_cmd":
        told = message.drive
        return stamp, Steer(float(told.steering_angle), float(told.speed), float(told.acceleration))
    rows = [(nanoseconds(each.header.stamp), each.pose.position, each.pose.orientation) for each in message.poses]
    poses = [(place.x, place.y, 2.0 * math.atan2(turn.z, turn.w)) for _, place, turn in rows]
    times = np.array([(at - stamp) / NS for at, _, _ in rows])
    return stamp, Trajectory(np.array(poses), times)


def decoded(ros: RosMessages, topic: str, content: bytes, kind: str) -> Any:
    """Return the message of a type that came on a topic.

    Raises:
        SourceError: The content is no such message.
    """
    try:
        return ros.decode(content, kind)
    except Exception as error:  # rosbags raises what its generated code happens to meet
        raise SourceError(
            f"{len(content)} bytes on /{topic} are no {kind} ({error or type(error).__name__}); compare the "
            "definitions of both sides"
        ) from error


def nanoseconds(time: Any) -> int:
    """Return a time of a message [ns]."""
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)
