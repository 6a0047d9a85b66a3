"""Sensors of a vehicle that a driving stack drives: a camera, a spinning lidar and a planar one."""

from __future__ import annotations

import io
from collections.abc import Mapping

import numpy as np

from scenarionet_data.arrays.dtypes import Array, UInt8
from scenarionet_sim.planners.view import View
from scenarionet_sim.sensors.base import Sensor
from scenarionet_sim.sensors.camera import Camera
from scenarionet_sim.sensors.lidar import Lidar
from scenarionet_sim.sensors.lidar_presets import HDL_32E
from scenarionet_sim.worlds.world_batch import WorldBatch

CAMERA = Camera(width=640, height=360)
LIDAR = HDL_32E
SCAN = Lidar(rays=360, range=50.0)
SENSORS: dict[str, Sensor] = {"camera": CAMERA, "lidar": LIDAR, "scan": SCAN}

_QUALITY = 85  # of JPEG


class StackSensors:
    """Sensors of one vehicle through one scenario.

    Args:
        sensors: By name.
    """

    def __init__(self, sensors: Mapping[str, Sensor]) -> None:
        self._sensors = sensors
        self._rng = np.random.default_rng(0)
        self._batch: WorldBatch | None = None

    def look(self, view: View) -> dict[str, Array]:
        """Return what each sensor observes now, by name."""
        if not self._sensors:
            return {}
        if self._batch is None:
            self._batch = WorldBatch([view.world] * len(view.state.present))
        agents = np.array([[view.slot, view.row]], np.int32)
        return {
            name: sensor.observe(self._batch, view.state, agents, self._rng, sensor.empty(1))[0]
            for name, sensor in self._sensors.items()
        }


def jpeg(picture: UInt8) -> UInt8:
    """Return a picture (H, W, 3) as the bytes of a JPEG file."""
    from PIL import Image

    file = io.BytesIO()
    Image.fromarray(picture).save(file, "JPEG", quality=_QUALITY)
    return np.frombuffer(file.getbuffer(), np.uint8)


def nv12(picture: UInt8) -> UInt8:
    """Return a picture (H, W, 3) of even sides as NV12 (H * W * 3 / 2,): Y, then U and V of two by two pixels in turns.

    Levels are those of BT.601, 16 to 235 (240), within one.
    """
    height, width, _ = picture.shape
    planes = np.ascontiguousarray(np.moveaxis(picture, -1, 0)).astype(np.uint16)
    red, green, blue = planes
    made = np.empty(height * width * 3 // 2, np.uint8)
    made[: height * width] = (((25 * blue + 129 * green + 66 * red + 128) >> 8) + 16).ravel()
    pairs = planes[:, 0::2] + planes[:, 1::2]
    red, green, blue = ((pairs[..., 0::2] + pairs[..., 1::2] + 2) >> 2).astype(np.int32)
    chroma = made[height * width :].reshape(height // 2, width)
    chroma[:, 0::2] = (112 * blue - 74 * green - 38 * red + 0x8080) >> 8
    chroma[:, 1::2] = (112 * red - 94 * green - 18 * blue + 0x8080) >> 8
    return made
