"""Presets of cameras: sizes, angles of view and places of those of public datasets and drivers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenarionet_data.errors import BadParameter
from scenarionet_sim.sensors.camera import Camera, Mount

NUSCENES_RING = {
    "CAM_FRONT": Mount(1.70, 0.02, 1.51, 0.0),
    "CAM_FRONT_RIGHT": Mount(1.55, -0.49, 1.51, float(np.deg2rad(-56.5))),
    "CAM_FRONT_LEFT": Mount(1.52, 0.49, 1.51, float(np.deg2rad(55.0))),
    "CAM_BACK": Mount(0.03, 0.00, 1.58, float(np.pi)),
    "CAM_BACK_LEFT": Mount(1.04, 0.48, 1.56, float(np.deg2rad(108.5))),
    "CAM_BACK_RIGHT": Mount(1.01, -0.48, 1.56, float(np.deg2rad(-110.5))),
}
"""Places of the six cameras of nuScenes on its vehicle, rounded, with the rear axle at the middle of the box."""

_WIDE_BEHIND = float(np.deg2rad(110.0))
_OTHERS = float(np.deg2rad(70.0))


def camera_ring(camera: Camera | None = None) -> tuple[Camera, ...]:
    """Return six cameras around the vehicle like those of nuScenes, in the order of ``NUSCENES_RING``.

    Args:
        camera: Everything but mount and angle of view; by default a tenth of nuScenes' pixels, 320 x 180.

    Raises:
        BadParameter: It is no camera.
    """
    if not isinstance(camera, Camera | None):
        raise BadParameter(f"camera={camera!r}; expected a Camera, such as Camera(width=320, height=180)")
    whole = camera or Camera(width=320, height=180)
    return tuple(
        replace(whole, mount=mount, intrinsics=None, fov=_WIDE_BEHIND if name == "CAM_BACK" else _OTHERS)
        for name, mount in NUSCENES_RING.items()
    )


ROAD_CAMERA = Camera(
    width=1928, height=1208, intrinsics=(2648.0, 2648.0, 964.0, 604.0), mount=Mount(0.6, 0.0, 1.22), range=400.0
)
"""The road camera of openpilot's devices: 1928 x 1208 pixels, 40 degrees wide."""

CHASE = Mount(x=-8.5, z=3.4, pitch=-0.16)
COCKPIT = Mount(x=-0.15, y=0.38, z=1.22, pitch=-0.05)
"""Places behind and above the vehicle, and at the eyes of its driver."""
