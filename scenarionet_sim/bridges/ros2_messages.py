"""Messages of ROS 2 (Jazzy) as bytes: CDR by rosbags, without a ROS installation.

The frame ``map`` is the scenario's; ``base_link`` is the centre of the vehicle's box, x forward, y left, z up.
"""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.errors import MissingDependency
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.planners.view import View

PUBLISHED = {
    "tf": "tf2_msgs/msg/TFMessage",
    "odom": "nav_msgs/msg/Odometry",
    "objects": "vision_msgs/msg/Detection3DArray",
    "route": "nav_msgs/msg/Path",
    "clock": "rosgraph_msgs/msg/Clock",
}
"""Types of the topics that a stack gets at each moment, in this order; the route where an episode begins."""

ANSWERS = {
    "ackermann_cmd": "ackermann_msgs/msg/AckermannDriveStamped",
    "cmd_vel": "geometry_msgs/msg/TwistStamped",
    "plan": "nav_msgs/msg/Path",
}
"""Types of the topics that a stack answers on: one of them, with the stamp of the moment."""

_DEFINITIONS = {
    "ackermann_msgs/msg/AckermannDrive": (
        "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
    ),
    "ackermann_msgs/msg/AckermannDriveStamped": "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n",
    "vision_msgs/msg/BoundingBox3D": "geometry_msgs/Pose center\ngeometry_msgs/Vector3 size\n",
    "vision_msgs/msg/ObjectHypothesis": "string class_id\nfloat64 score\n",
    "vision_msgs/msg/ObjectHypothesisWithPose": (
        "vision_msgs/ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"
    ),
    "vision_msgs/msg/Detection3D": (
        "std_msgs/Header header\nvision_msgs/ObjectHypothesisWithPose[] results\nvision_msgs/BoundingBox3D bbox\n"
        "string id\n"
    ),
    "vision_msgs/msg/Detection3DArray": "std_msgs/Header header\nvision_msgs/Detection3D[] detections\n",
}
"""Of the packages ackermann_msgs 2 and vision_msgs 4, which rosbags lacks."""


@cache
def typestore() -> Any:
    """Return the types of ROS 2 Jazzy and those of ``_DEFINITIONS``.

    Raises:
        MissingDependency: rosbags is not installed.
    """
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ModuleNotFoundError as error:
        raise MissingDependency("messages of ROS 2 need rosbags", "ros") from error
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in _DEFINITIONS.items():
        store.register(get_types_from_msg(text, name))
    return store


def encode(message: Any) -> bytes:
    """Return a message as CDR, little endian, with its four bytes of header."""
    return bytes(typestore().serialize_cdr(message, message.__msgtype__))


def make(name: str, **fields: Any) -> Any:
    """Return a message of a type, such as ``geometry_msgs/Point``."""
    return typestore().types[name.replace("/", "/msg/")](**fields)


def dds_name(kind: str) -> str:
    """Return the name of a type on the wire.

    Example:
        >>> dds_name("std_msgs/msg/String")
        'std_msgs::msg::dds_::String_'
    """
    package, _, name = kind.split("/")
    return f"{package}::msg::dds_::{name}_"


def moment_messages(view: View, stamp: int, *, with_route: bool) -> dict[str, Any]:
    """Return the messages of a moment by topic, in the order of ``PUBLISHED``.

    Args:
        view: The moment, in the scenario's frame.
        stamp: [ns].
        with_route: Whether the route is among them.
    """
    ego, objects, header = view.ego, view.objects, _header(stamp, "map")
    covariance = np.zeros(36)
    pose = _pose(ego.x, ego.y, ego.heading)
    moved = make("geometry_msgs/Transform", translation=_vector(ego.x, ego.y, 0.0), rotation=pose.orientation)
    transform = make("geometry_msgs/TransformStamped", header=header, child_frame_id="base_link", transform=moved)
    twist = make("geometry_msgs/Twist", linear=_vector(ego.speed, 0.0, 0.0), angular=_vector(0.0, 0.0, ego.yaw_rate))
    messages = {
        "tf": make("tf2_msgs/TFMessage", transforms=[transform]),
        "odom": make(
            "nav_msgs/Odometry",
            header=header,
            child_frame_id="base_link",
            pose=make("geometry_msgs/PoseWithCovariance", pose=pose, covariance=covariance),
            twist=make("geometry_msgs/TwistWithCovariance", twist=twist, covariance=covariance),
        ),
        "objects": make(
            "vision_msgs/Detection3DArray",
            header=header,
            detections=[
                _detection(header, *each)
                for each in zip(
                    objects.track_ids, objects.object_type, objects.position, objects.heading, objects.size, strict=True
                )
            ],
        ),
    }
    if with_route:
        route = view.route
        xyh = zip(*route.centreline.T.tolist(), route.heading.tolist(), strict=True)
        poses = [make("geometry_msgs/PoseStamped", header=header, pose=_pose(*each)) for each in xyh]
        messages["route"] = make("nav_msgs/Path", header=header, poses=poses)
    return messages | {"clock": make("rosgraph_msgs/Clock", clock=header.stamp)}


def _header(stamp: int, frame: str) -> Any:
    sec, nanosec = divmod(stamp, 1_000_000_000)
    return make("std_msgs/Header", stamp=make("builtin_interfaces/Time", sec=sec, nanosec=nanosec), frame_id=frame)


def _vector(x: float, y: float, z: float) -> Any:
    return make("geometry_msgs/Vector3", x=x, y=y, z=z)


def _pose(x: float, y: float, heading: float) -> Any:
    turn = make("geometry_msgs/Quaternion", x=0.0, y=0.0, z=math.sin(heading / 2.0), w=math.cos(heading / 2.0))
    return make("geometry_msgs/Pose", position=make("geometry_msgs/Point", x=x, y=y, z=0.0), orientation=turn)


def _detection(header: Any, track_id: str, kind: int, position: Array, heading: float, size: Array) -> Any:
    """Return an object as Detection3D; the recording is sure of it."""
    pose = _pose(float(position[0]), float(position[1]), float(heading))
    hypothesis = make("vision_msgs/ObjectHypothesis", class_id=ObjectType(kind).name.lower(), score=1.0)
    placed = make("geometry_msgs/PoseWithCovariance", pose=pose, covariance=np.zeros(36))
    return make(
        "vision_msgs/Detection3D",
        header=header,
        results=[make("vision_msgs/ObjectHypothesisWithPose", hypothesis=hypothesis, pose=placed)],
        bbox=make("vision_msgs/BoundingBox3D", center=pose, size=_vector(*map(float, size))),
        id=str(track_id),
    )
