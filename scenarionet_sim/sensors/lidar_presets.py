"""Presets of lidars: rings, azimuths and ranges of products, from their data sheets."""

from __future__ import annotations

import numpy as np

from scenarionet_sim.sensors.camera import Mount
from scenarionet_sim.sensors.scene_lidar import SceneLidar


def _radians(*degrees: float) -> tuple[float, ...]:
    return tuple(np.deg2rad(degrees).tolist())


HDL_32E = SceneLidar(
    elevations=_radians(*np.linspace(10.67, -30.67, 32).tolist()), azimuths=1085, range=100.0,
    mount=Mount(x=0.94, z=1.84),
)  # fmt: skip
"""Velodyne HDL-32E (data sheet 97-0038): 32 rings from +10.67 to -30.67 degrees, a firing each 46.08 us; 1085 azimuths
at 20 revolutions a second as in nuScenes, in whose place it is mounted."""

PANDAR_64 = SceneLidar(
    elevations=_radians(
        15, 11, 8, 5, 3, *np.linspace(2, -6, 49).tolist(), -7, -8, -9, -10, -11, -12, -13, -14, -19, -25
    ), azimuths=1800, range=200.0, mount=Mount(x=0.0, z=1.9),
)  # fmt: skip
"""Hesai Pandar64 (user manual, distribution of channels): 64 rings from +15 to -25 degrees, every sixth of a degree
between +2 and -6; azimuths of 0.2 degrees at 10 revolutions a second."""
