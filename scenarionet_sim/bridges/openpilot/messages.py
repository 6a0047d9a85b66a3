"""Services that openpilot gets and answers on, and what is in their messages.

Sensors stand as in comma's device, whose frame is ahead, right, down; measurements are (-down, -right, -ahead), as
``selfdrive/locationd/locationd.py`` of openpilot reads them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

from scenarionet_sim.bridges.carla.sensors import degrees_of
from scenarionet_sim.planners.view import EgoView
from scenarionet_sim.sensors.camera import Camera, Mount

WIDTH, HEIGHT = 1928, 1208
"""Of frames [pixels]."""

_MIDDLE, _EYES = (WIDTH / 2.0, HEIGHT / 2.0), Mount(0.0, 0.0, 1.22)
ROAD = Camera(WIDTH, HEIGHT, intrinsics=(2648.0, 2648.0, *_MIDDLE), mount=_EYES)
WIDE = Camera(WIDTH, HEIGHT, intrinsics=(567.0, 567.0, *_MIDDLE), mount=_EYES)
"""The cameras that openpilot's ``common/transformations/camera.py`` expects of a PC, at the height of its simulator."""

SAMPLES = 100
"""Samples of a second; of a time between two moments of the simulation, what moves is interpolated."""

PER_FRAME = 5
"""Samples of a frame, the last of which has its stamp."""

_GRAVITY = 9.81  # [m/s²]


class Service(NamedTuple):
    """A service.

    Attributes:
        every: Samples from one message to the next.
        content: What is in it, for the documentation.
    """

    every: int
    content: str


SENT = {
    "accelerometer": Service(1, "specific force, by the change of speed and the yaw rate"),
    "gyroscope": Service(1, "yaw rate"),
    "can": Service(1, "the messages of the car below"),
    "gpsLocationExternal": Service(10, "latitude, longitude, velocity and bearing, around 42° N, 2° E"),
    "pandaStates": Service(10, "ignition on, controls allowed, safety model `hondaBosch`"),
    "peripheralState": Service(50, "12 V"),
    "driverStateV2": Service(PER_FRAME, "a face straight ahead"),
    "driverMonitoringState": Service(PER_FRAME, "an attentive driver"),
    "roadCameraState": Service(PER_FRAME, "number and stamp of the frame of focal length 2648 pixels"),
    "wideRoadCameraState": Service(PER_FRAME, "the same, of focal length 567 pixels"),
}
"""What openpilot gets, in this order."""

ANSWER = "carControl"
"""What openpilot answers on: ``enabled``, and of ``actuators`` ``accel`` and ``steeringAngleDeg``."""

STREAMS = {"roadCameraState": 0, "wideRoadCameraState": 2}
"""Numbers of the streams of ``camerad``, of ``VisionStreamType``."""


def contents(ego: EgoView, stamp: int, unix: int, frame: int) -> Iterator[tuple[str, Any]]:
    """Yield service and content of each message of a sample except ``can``.

    Args:
        ego: The vehicle, in the scenario's frame.
        stamp: Of the sample [ns].
        unix: The same since 1970 [ms].
        frame: Number of the next frame.
    """
    turn, ahead = ego.yaw_rate, ego.acceleration
    yield "accelerometer", _measured(stamp, 1, "acceleration", (_GRAVITY, ego.speed * turn, -ahead))
    yield "gyroscope", _measured(stamp, 5, "gyroUncalibrated", (turn, 0.0, 0.0))
    latitude, longitude = degrees_of(ego.x, ego.y)
    yield "gpsLocationExternal", {
        "flags": 1, "hasFix": True, "satelliteCount": 12, "source": "ublox", "unixTimestampMillis": unix,
        "latitude": latitude, "longitude": longitude, "speed": ego.speed,
        "vNED": [ego.speed * math.sin(ego.heading), ego.speed * math.cos(ego.heading), 0.0],
        "bearingDeg": (90.0 - math.degrees(ego.heading)) % 360.0, "bearingAccuracyDeg": 0.1, "speedAccuracy": 0.1,
        "accuracy": 1.0, "horizontalAccuracy": 1.0, "verticalAccuracy": 1.0,
    }  # fmt: skip
    panda = {"ignitionLine": True, "pandaType": "blackPanda", "controlsAllowed": True, "safetyModel": "hondaBosch"}
    yield "pandaStates", [panda | {"safetyParam": 10}]  # HondaSafetyFlags: RADARLESS | BOSCH_LONG
    yield "peripheralState", {"pandaType": "blackPanda", "voltage": 12000, "current": 5678, "fanSpeedRpm": 1000}
    face = {"faceOrientation": [0.0, 0.0, 0.0], "faceProb": 1.0}
    yield "driverStateV2", {"leftDriverData": face, "rightDriverData": face}
    yield "driverMonitoringState", {
        "faceDetected": True, "isDistracted": False, "awarenessStatus": 1.0, "activePolicy": "vision",
        "visionPolicyState": {"faceDetected": True, "isDistracted": False, "awarenessPercent": 100},
    }  # fmt: skip
    upright = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
    for camera in STREAMS:
        yield camera, {"frameId": frame, "timestampSof": stamp, "timestampEof": stamp, "transform": upright}


def _measured(stamp: int, sensor: int, kind: str, values: tuple[float, float, float]) -> dict[str, Any]:
    return {"sensor": sensor, "type": 0x10, "timestamp": stamp, "source": "lsm6ds3trc", kind: {"v": list(values)}}
