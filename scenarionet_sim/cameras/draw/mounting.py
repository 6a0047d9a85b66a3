"""Cameras and lidars mounted on vehicles."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.arrays.log import HEADING, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.cameras.draw import columns as at


@kernel(allocates=False)
def mount_cameras(
    motion: Float64, agents: Int32, place: tuple[float, float, float], turns: Float64, heights: Float64, poses: Float64
) -> None:
    """Write the poses of a camera on each of A agents.

    Args:
        motion: Of the state, see ``State``.
        agents: (A, 2) slot and row.
        place: x forward, y left of the middle of the box, z above the ground [m].
        turns: (A, 3) yaw from straight ahead, pitch upwards and roll clockwise as the camera sees it [rad].
        heights: (A,) of the ground under the agents [m].
        poses: (A, NUM_POSE) output.
    """
    for k in range(len(agents)):
        body, pose = motion[agents[k, 0], agents[k, 1]], poses[k]
        cos, sin = math.cos(body[HEADING]), math.sin(body[HEADING])
        pose[at.EYE] = body[X] + cos * place[0] - sin * place[1]
        pose[at.EYE + 1] = body[Y] + sin * place[0] + cos * place[1]
        pose[at.EYE + 2] = heights[k] + place[2]
        cos, sin = math.cos(body[HEADING] + turns[k, 0]), math.sin(body[HEADING] + turns[k, 0])
        flat, rise = math.cos(turns[k, 1]), math.sin(turns[k, 1])
        cos_roll, sin_roll = math.cos(turns[k, 2]), math.sin(turns[k, 2])
        pose[at.FORWARD], pose[at.FORWARD + 1], pose[at.FORWARD + 2] = flat * cos, flat * sin, rise
        pose[at.RIGHT] = cos_roll * sin + sin_roll * rise * cos
        pose[at.RIGHT + 1] = -cos_roll * cos + sin_roll * rise * sin
        pose[at.RIGHT + 2] = -sin_roll * flat
        pose[at.DOWN] = cos_roll * rise * cos - sin_roll * sin
        pose[at.DOWN + 1] = cos_roll * rise * sin + sin_roll * cos
        pose[at.DOWN + 2] = -cos_roll * flat
        pose[at.VELOCITY], pose[at.VELOCITY + 1], pose[at.YAW_SPEED] = body[VX], body[VY], body[YAW_RATE]
        pose[at.PIVOT], pose[at.PIVOT + 1] = body[X], body[Y]
