"""Messages of ROS 1 (Noetic) and ROS 2 (Jazzy) by rosbags, without a ROS installation.

The frame ``map`` is the scenario's, with the ground at z = 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.errors import needing

_DEFINITIONS = {
    "ackermann_msgs/msg/AckermannDrive": (
        "float32 steering_angle\nfloat32 steering_angle_velocity\nfloat32 speed\nfloat32 acceleration\nfloat32 jerk\n"
    ),
    "ackermann_msgs/msg/AckermannDriveStamped": "std_msgs/Header header\nackermann_msgs/AckermannDrive drive\n",
}
"""Of the package ackermann_msgs 2, which rosbags lacks; that of ROS 1 has the same fields."""

_DEFINITIONS_1 = {"tf2_msgs/msg/TFMessage": "geometry_msgs/TransformStamped[] transforms\n"}
"""Of the package tf2_msgs of ROS 1, which rosbags lacks."""

_DEFINITIONS_2 = {
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
"""Of the package vision_msgs 4, which rosbags lacks."""

_SERVICE_HEADER = "uint64 client\nint64 number\n"
"""What rmw_cyclonedds writes before the fields of a request, and of its reply."""

_NO_FIELDS = "uint8 structure_needs_at_least_one_member\n"
"""What ROS writes for none."""


class RosMessages:
    """Messages of one version.

    Args:
        version: 1 or 2.

    Attributes:
        store: The types, of rosbags.

    Raises:
        MissingDependency: rosbags is not installed.
    """

    def __init__(self, version: int) -> None:
        with needing("messages of ROS need rosbags", "ros"):
            from rosbags.typesys import Stores, get_types_from_msg, get_typestore
        self.version = version
        self.store: Any = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_JAZZY)
        for name, text in (_DEFINITIONS | (_DEFINITIONS_2 if version == 2 else _DEFINITIONS_1)).items():
            self.store.register(get_types_from_msg(text, name))
        if version == 2:
            _, *blocks = (Path(__file__).parent / "autoware.txt").read_text("utf-8").split("\n\n")
            for name, _, fields in (block.partition("\n") for block in blocks):
                fields = _SERVICE_HEADER + (fields or _NO_FIELDS) if "/srv/" in name else fields
                self.store.register(get_types_from_msg(fields, name.replace("/srv/", "/srv/msg/")))

    def encode(self, message: Any) -> bytes:
        """Return a message as bytes: of ROS 2 as CDR, little endian, with its four bytes of header."""
        write = self.store.serialize_ros1 if self.version == 1 else self.store.serialize_cdr
        return bytes(write(message, message.__msgtype__))

    def decode(self, content: bytes, kind: str) -> Any:
        """Return the message of a type, such as ``geometry_msgs/msg/Point``; raises what rosbags happens to meet."""
        return (self.store.deserialize_ros1 if self.version == 1 else self.store.deserialize_cdr)(content, kind)

    def make(self, name: str, /, **fields: Any) -> Any:
        """Return a message of a type, such as ``geometry_msgs/Point`` or ``a_msgs/srv/Name_Request``."""
        package, _, kind = name.rpartition("/")
        return self.store.types[f"{package}/msg/{kind}"](**fields)

    def time(self, stamp: int) -> Any:
        """Return a time [ns]."""
        sec, nanosec = divmod(stamp, 1_000_000_000)
        return self.make("builtin_interfaces/Time", sec=sec, nanosec=nanosec)

    def header(self, stamp: int, frame: str) -> Any:
        """Return a header of a time [ns]."""
        numbered = {"seq": 0} if self.version == 1 else {}
        return self.make("std_msgs/Header", stamp=self.time(stamp), frame_id=frame, **numbered)

    def vector(self, x: float, y: float, z: float) -> Any:
        """Return a Vector3."""
        return self.make("geometry_msgs/Vector3", x=x, y=y, z=z)

    def point(self, x: float, y: float, z: float = 0.0) -> Any:
        """Return a Point."""
        return self.make("geometry_msgs/Point", x=x, y=y, z=z)

    def turn(self, x: float, y: float, z: float, w: float) -> Any:
        """Return a Quaternion."""
        return self.make("geometry_msgs/Quaternion", x=x, y=y, z=z, w=w)

    def pose(self, x: float, y: float, heading: float, z: float = 0.0) -> Any:
        """Return a Pose in the plane."""
        turned = self.turn(0.0, 0.0, math.sin(heading / 2.0), math.cos(heading / 2.0))
        return self.make("geometry_msgs/Pose", position=self.point(x, y, z), orientation=turned)

    def transform(self, header: Any, child: str, translation: Sequence[float], rotation: Any) -> Any:
        """Return a TransformStamped to the frame ``child``; ``translation`` is x, y, z [m]."""
        moved = self.make("geometry_msgs/Transform", translation=self.vector(*translation), rotation=rotation)
        return self.make("geometry_msgs/TransformStamped", header=header, child_frame_id=child, transform=moved)

    def odometry(self, header: Any, pose: Any, speed: float, yaw_rate: float) -> Any:
        """Return the Odometry of ``base_link``: speed [m/s] and yaw rate [rad/s] there."""
        linear, angular = self.vector(speed, 0.0, 0.0), self.vector(0.0, 0.0, yaw_rate)
        twist = self.make("geometry_msgs/Twist", linear=linear, angular=angular)
        unsaid = np.zeros(36)
        return self.make(
            "nav_msgs/Odometry",
            header=header,
            child_frame_id="base_link",
            pose=self.make("geometry_msgs/PoseWithCovariance", pose=pose, covariance=unsaid),
            twist=self.make("geometry_msgs/TwistWithCovariance", twist=twist, covariance=unsaid),
        )

    def path(self, header: Any, poses: Iterable[Any]) -> Any:
        """Return a Path."""
        stamped = [self.make("geometry_msgs/PoseStamped", header=header, pose=pose) for pose in poses]
        return self.make("nav_msgs/Path", header=header, poses=stamped)

    def detection(self, header: Any, name: str, kind: str, pose: Any, size: Sequence[float]) -> Any:
        """Return a Detection3D of ROS 2, of which its source is sure; ``pose`` is the centre of the box."""
        placed = self.make("geometry_msgs/PoseWithCovariance", pose=pose, covariance=np.zeros(36))
        hypothesis = self.make("vision_msgs/ObjectHypothesis", class_id=kind, score=1.0)
        return self.make(
            "vision_msgs/Detection3D",
            header=header,
            results=[self.make("vision_msgs/ObjectHypothesisWithPose", hypothesis=hypothesis, pose=placed)],
            bbox=self.make("vision_msgs/BoundingBox3D", center=pose, size=self.vector(*size)),
            id=name,
        )

    def detections(self, header: Any, detections: list[Any]) -> Any:
        """Return a Detection3DArray of ROS 2."""
        return self.make("vision_msgs/Detection3DArray", header=header, detections=detections)

    def cube(
        self, header: Any, group: str, number: int, pose: Any, size: Sequence[float], color: Sequence[float]
    ) -> Any:
        """Return a Marker that is a box; see :meth:`line`."""
        return self._marker(header, group, number, color, type=1, pose=pose, scale=self.vector(*size))

    def line(self, header: Any, group: str, number: int, points: Array, color: Sequence[float]) -> Any:
        """Return a Marker that is a line.

        Args:
            header: Its time and frame.
            group, number: Its namespace and id.
            points: (P, 2) or (P, 3) [m].
            color: Red, green, blue, alpha in [0, 1].
        """
        told = [self.point(*place) for place in points.astype(np.float64).tolist()]
        return self._marker(
            header, group, number, color, type=4, scale=self.vector(0.15, 0.0, 0.0), points=told,
            pose=self.pose(0.0, 0.0, 0.0),
        )  # fmt: skip

    def markers(self, header: Any, markers: list[Any]) -> Any:
        """Return a MarkerArray that takes away what its topic showed before."""
        nothing = self._marker(
            header, "", 0, (0.0,) * 4, type=0, pose=self.pose(0.0, 0.0, 0.0), scale=self.vector(0.0, 0.0, 0.0), action=3
        )
        return self.make("visualization_msgs/MarkerArray", markers=[nothing, *markers])

    def _marker(self, header: Any, group: str, number: int, color: Sequence[float], **fields: Any) -> Any:
        rest = {
            "action": 0, "frame_locked": False, "points": [], "colors": [], "text": "", "mesh_resource": "",
            "mesh_use_embedded_materials": False,
            "lifetime": self.make("builtin_interfaces/Duration", sec=0, nanosec=0),
        }  # fmt: skip
        if self.version == 2:
            texture = self.make("sensor_msgs/CompressedImage", header=header, format="", data=_NO_BYTES)
            mesh = self.make("visualization_msgs/MeshFile", filename="", data=_NO_BYTES)
            rest |= {"texture_resource": "", "texture": texture, "uv_coordinates": [], "mesh_file": mesh}
        shade = self.make("std_msgs/ColorRGBA", **dict(zip("rgba", map(float, color), strict=True)))
        given = rest | fields
        return self.make("visualization_msgs/Marker", header=header, ns=group, id=number, color=shade, **given)


_NO_BYTES = np.zeros(0, np.uint8)


@cache
def messages(version: int) -> RosMessages:
    """Return the messages of a version, 1 or 2, made once."""
    return RosMessages(version)
