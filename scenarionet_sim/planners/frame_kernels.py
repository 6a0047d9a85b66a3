"""Motion and paths of a scenario in another frame."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.log import HEADING, VX, VY, X, Y
from scenarionet_sim.worlds.path_kernels import wrapped


class FramePose(NamedTuple):
    """Where a frame is in the scenario's.

    Attributes:
        x, y: Its origin [m].
        heading: Of its x axis [rad].
        cos, sin: Of ``heading``.
    """

    x: float
    y: float
    heading: float
    cos: float
    sin: float


@device_function
def turned(pose: FramePose, x: float, y: float) -> tuple[float, float]:
    """Return a vector of the scenario in a frame."""
    return pose.cos * x + pose.sin * y, pose.cos * y - pose.sin * x


@kernel(allocates=False)
def motion_to_frame(motion: Float64, pose: FramePose, position: Float64, heading: Float64, velocity: Float64) -> None:
    """Convert the motion (N, 7) of objects to a frame: (N, 2) [m], (N,) [rad] in [-pi, pi), (N, 2) [m/s]."""
    for n in range(len(motion)):
        row = motion[n]
        position[n, 0], position[n, 1] = turned(pose, row[X] - pose.x, row[Y] - pose.y)
        heading[n] = wrapped(row[HEADING] - pose.heading)
        velocity[n, 0], velocity[n, 1] = turned(pose, row[VX], row[VY])


@kernel(allocates=False)
def path_to_frame(path: Float32, first: int, pose: FramePose, position: Float64, heading: Float64) -> None:
    """Convert points of ``Paths.path`` from ``first`` on to a frame: (P, 2) [m], (P,) [rad] in [-pi, pi)."""
    for k in range(len(heading)):
        x, y = np.float64(path[first + k, X]), np.float64(path[first + k, Y])
        position[k, 0], position[k, 1] = turned(pose, x - pose.x, y - pose.y)
        heading[k] = wrapped(np.float64(path[first + k, HEADING]) - pose.heading)
