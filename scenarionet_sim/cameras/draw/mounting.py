"""Cameras and lidars mounted on vehicles."""

from __future__ import annotations

import math

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.arrays.log import HEADING, VX, VY, YAW_RATE, X, Y
from scenarionet_sim.cameras.draw.layout import DOWN, EYE, FORWARD, PIVOT, RIGHT, VELOCITY, YAW_SPEED


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
        pose[EYE] = body[X] + cos * place[0] - sin * place[1]
        pose[EYE + 1] = body[Y] + sin * place[0] + cos * place[1]
        pose[EYE + 2] = heights[k] + place[2]
        cos, sin = math.cos(body[HEADING] + turns[k, 0]), math.sin(body[HEADING] + turns[k, 0])
        flat, rise = math.cos(turns[k, 1]), math.sin(turns[k, 1])
        cos_roll, sin_roll = math.cos(turns[k, 2]), math.sin(turns[k, 2])
        pose[FORWARD], pose[FORWARD + 1], pose[FORWARD + 2] = flat * cos, flat * sin, rise
        pose[RIGHT] = cos_roll * sin + sin_roll * rise * cos
        pose[RIGHT + 1] = -cos_roll * cos + sin_roll * rise * sin
        pose[RIGHT + 2] = -sin_roll * flat
        pose[DOWN] = cos_roll * rise * cos - sin_roll * sin
        pose[DOWN + 1] = cos_roll * rise * sin + sin_roll * cos
        pose[DOWN + 2] = -cos_roll * flat
        pose[VELOCITY], pose[VELOCITY + 1], pose[YAW_SPEED] = body[VX], body[VY], body[YAW_RATE]
        pose[PIVOT], pose[PIVOT + 1] = body[X], body[Y]
