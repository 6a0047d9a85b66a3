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
        14.882, 11.032, 8.059, 5.057, 3.04, 2.028, 1.86, 1.688, 1.522, 1.351, 1.184, 1.013, 0.846, 0.675, 0.508, 0.337,
        0.169, 0.0, -0.169, -0.337, -0.508, -0.675, -0.845, -1.013, -1.184, -1.351, -1.522, -1.688, -1.86, -2.028,
        -2.198, -2.365, -2.536, -2.7, -2.873, -3.04, -3.21, -3.375, -3.548, -3.712, -3.884, -4.05, -4.221, -4.385,
        -4.558, -4.72, -4.892, -5.057, -5.229, -5.391, -5.565, -5.726, -5.898, -6.061, -7.063, -8.059, -9.06, -9.885,
        -11.032, -12.006, -12.974, -13.93, -18.889, -24.897,
    ), azimuths=1800, range=200.0, mount=Mount(x=0.0, z=1.9),
)  # fmt: skip
"""Hesai Pandar64: 64 rings from +15 to -25 degrees, every sixth of a degree between +2 and -6, as in the maker's driver
(HesaiLidar_General_ROS); azimuths of 0.2 degrees at 10 revolutions a second."""
