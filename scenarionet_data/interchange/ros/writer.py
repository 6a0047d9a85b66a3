"""Write scenarios as rosbag (ROS 1) and rosbag2, by rosbags.

Topics: ``/map`` once; ``/tf`` (``map`` to ``base_link``), ``/odom``, ``/markers`` for each timestep, in ROS 2 also
``/objects`` and ``/traffic_lights``; ``/camera/NAME/image_raw/compressed`` for pictures. Times count from 1 s, as ROS
takes 0 for unknown. ``base_link`` is under the centre of the ego's box.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from rosbags import rosbag1, rosbag2

from scenarionet_data.errors import BadParameter
from scenarionet_data.interchange.base import CameraFiles, Losses
from scenarionet_data.interchange.ros.messages import RosMessages, messages
from scenarionet_data.interchange.viewing import LAYERS, draw
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import LightColor, ObjectType

_START = 1_000_000_000
_STORAGES = {"mcap": rosbag2.StoragePlugin.MCAP, "sqlite3": rosbag2.StoragePlugin.SQLITE3}


@dataclass(frozen=True)
class RosbagWriter:
    """Writes one bag of ROS 1 a scenario."""

    name: ClassVar[str] = "rosbag"

    def write(
        self, scenario: ScenarioDescription, stem: str, losses: Losses, pictures: CameraFiles | None = None
    ) -> Mapping[str, bytes]:
        """Return the files of a scenario; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, f"{stem}.bag")
            with rosbag1.Writer(path) as bag:
                _fill(bag, messages(1), scenario, losses, pictures or {})
            return {path.name: path.read_bytes()}


@dataclass(frozen=True)
class Rosbag2Writer:
    """Writes one folder of ROS 2 a scenario.

    Attributes:
        storage: ``mcap`` or ``sqlite3``.
    """

    name: ClassVar[str] = "rosbag2"

    storage: str = "mcap"

    def __post_init__(self) -> None:
        if self.storage not in _STORAGES:
            raise BadParameter(f"rosbag2 has no storage {self.storage!r}; choose from {', '.join(_STORAGES)}")

    def write(
        self, scenario: ScenarioDescription, stem: str, losses: Losses, pictures: CameraFiles | None = None
    ) -> Mapping[str, bytes]:
        """Return the files of a scenario; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, stem)
            with rosbag2.Writer(path, version=9, storage_plugin=_STORAGES[self.storage]) as bag:
                _fill(bag, messages(2), scenario, losses, pictures or {})
            return {f"{stem}/{file.name}": file.read_bytes() for file in sorted(path.iterdir())}


def _fill(bag: Any, ros: RosMessages, scenario: ScenarioDescription, losses: Losses, pictures: CameraFiles) -> None:
    connections: dict[str, Any] = {}
    for topic, stamp, message in _recorded(ros, scenario, losses, pictures):
        if topic not in connections:
            connections[topic] = bag.add_connection(topic, message.__msgtype__, typestore=ros.store)
        bag.write(connections[topic], stamp, ros.encode(message))


def _recorded(
    ros: RosMessages, scenario: ScenarioDescription, losses: Losses, pictures: CameraFiles
) -> Iterator[tuple[str, int, Any]]:
    """Yield topic, time [ns] and message, in order of time."""
    scene, tracks = draw(scenario, losses), scenario.tracks
    shades = (scene.colors / 255.0).tolist()
    header = ros.header(_START, "map")
    lines = [
        ros.line(header, layer, number, points, [value / 255.0 for value in LAYERS[layer]])
        for layer, features in scene.layers.items()
        for number, points in enumerate(features)
    ]
    yield "/map", _START, ros.markers(header, lines)
    others = np.arange(len(scene.names)) != scene.ego
    for timestep, nanoseconds in enumerate(scene.nanoseconds.tolist()):
        stamp = _START + nanoseconds
        header, shown = ros.header(stamp, "map"), scene.valid[:, timestep]
        if shown[scene.ego]:
            (x, y, z), heading = scene.position[scene.ego, timestep].tolist(), float(scene.heading[scene.ego, timestep])
            pose = ros.pose(x, y, heading, z - float(scene.size[scene.ego, timestep, 2]) / 2.0)
            place = pose.position
            frame = ros.transform(header, "base_link", (place.x, place.y, place.z), pose.orientation)
            yield "/tf", stamp, ros.make("tf2_msgs/TFMessage", transforms=[frame])
            ahead = np.array([np.cos(heading), np.sin(heading)])
            speed = float(tracks.velocity[scene.ego, timestep] @ ahead)
            yield "/odom", stamp, ros.odometry(header, pose, speed, _yaw_rate(scenario, timestep))
        boxes = []
        for row in np.flatnonzero(shown & others).tolist():
            x, y, z = scene.position[row, timestep].tolist()
            pose = ros.pose(x, y, float(scene.heading[row, timestep]), z)
            boxes.append((row, pose, scene.size[row, timestep].tolist()))
        yield "/markers", stamp, ros.markers(
            header, [ros.cube(header, scene.names[row], row, pose, size, shades[row]) for row, pose, size in boxes]
        )  # fmt: skip
        if ros.version == 2:
            found = [
                ros.detection(
                    header, str(tracks.ids[row]), ObjectType(tracks.object_type[row]).name.lower(), pose, size
                )
                for row, pose, size in boxes
            ]
            yield "/objects", stamp, ros.detections(header, found)
            lights = [
                ros.detection(
                    header,
                    scene.light_names[row].removeprefix("light "),
                    LightColor(scene.light_colors[row, timestep]).name.lower(),
                    ros.pose(
                        float(scene.lights[row, 0]), float(scene.lights[row, 1]), 0.0, float(scene.lights[row, 2])
                    ),
                    (0.0, 0.0, 0.0),
                )
                for row in np.flatnonzero(scene.light_seen[:, timestep]).tolist()
            ]
            yield "/traffic_lights", stamp, ros.detections(header, lights)
        for camera, images in pictures.items():
            image = np.frombuffer(images[timestep], np.uint8)
            own = ros.header(stamp, camera)
            picture = ros.make("sensor_msgs/CompressedImage", header=own, format="jpeg", data=image)
            yield f"/camera/{camera}/image_raw/compressed", stamp, picture


def _yaw_rate(scenario: ScenarioDescription, timestep: int) -> float:
    """Turn of the ego to the next timestep, or from the one before [rad/s]; 0 where neither is recorded."""
    tracks, row = scenario.tracks, scenario.ego_index
    for first in (timestep, timestep - 1):
        if 0 <= first < scenario.num_timesteps - 1 and tracks.valid[row, first : first + 2].all():
            turned = np.diff(tracks.heading[row, first : first + 2].astype(np.float64))[0]
            span = np.diff(scenario.timestamps[first : first + 2])[0]
            return float(np.angle(np.exp(1j * turned)) / span)
    return 0.0
