"""Optical flow [pixels], columns and rows."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.arrays.log import VX, YAW_RATE, X, Y
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.lens import project
from scenarionet_sim.cameras.draw.structures import FrameView, SceneArrays, Tile, Triangles

VALUES, DTYPE = 2, np.float32


@device_function(forceinline=True, divides_by_zero=True)
def write(first: int, view: FrameView, scene: SceneArrays, triangles: Triangles, tile: Tile, out: Float32) -> None:
    """Write where each pixel's point will be after ``flow_time``, at constant velocities and yaw rates."""
    seen, shades, labels = tile.seen, tile.shades, triangles.labels
    pose, lens, dt, width = view.pose, view.lens, view.flow_time, view.width
    turn = pose[at.YAW_SPEED] * dt
    cos, sin = math.cos(turn), math.sin(turn)
    for k in range(len(out)):
        out[k, 0], out[k, 1] = 0.0, 0.0
        far = shades[at.DISTANCE, k]
        x, y, z = far * shades[at.RAY_X, k], far * shades[at.RAY_Y, k], far * shades[at.RAY_Z, k]
        if seen[k] != codes.NOTHING:
            x, y = x + pose[at.EYE], y + pose[at.EYE + 1]
            if seen[k] >= 0 and labels[seen[k], at.INSTANCE_ROW] >= 0:
                motion = scene.solids.motion[view.slot, labels[seen[k], at.INSTANCE_ROW]]
                angle = motion[YAW_RATE] * dt
                c, s = math.cos(angle), math.sin(angle)
                ax, ay = x - motion[X], y - motion[Y]
                x = motion[X] + motion[VX] * dt + c * ax - s * ay
                y = motion[Y] + motion[VX + 1] * dt + s * ax + c * ay
            # Into the frame of the vehicle as it is now: undo the motion of the camera.
            x, y = x - pose[at.PIVOT] - pose[at.VELOCITY] * dt, y - pose[at.PIVOT + 1] - pose[at.VELOCITY + 1] * dt
            x, y = cos * x + sin * y + pose[at.PIVOT], cos * y - sin * x + pose[at.PIVOT + 1]
            x, y = x - pose[at.EYE], y - pose[at.EYE + 1]
        else:
            x, y = cos * x + sin * y, cos * y - sin * x
        right = pose[at.RIGHT] * x + pose[at.RIGHT + 1] * y + pose[at.RIGHT + 2] * z
        down = pose[at.DOWN] * x + pose[at.DOWN + 1] * y + pose[at.DOWN + 2] * z
        ahead = pose[at.FORWARD] * x + pose[at.FORWARD + 1] * y + pose[at.FORWARD + 2] * z
        if ahead > 1e-3 or (lens[at.KIND] != codes.PINHOLE and lens[at.KIND] != codes.DISTORTED):
            place = project(lens, right, down, ahead)
            row, column = (first + k) // width, (first + k) % width
            out[k, 0], out[k, 1] = place[0] - column - 0.5, place[1] - row - 0.5
