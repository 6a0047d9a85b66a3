"""Unit vectors in the scenario's frame, 0 in the sky."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.ground import height_at
from scenarionet_sim.cameras.draw.structures import FrameView, SceneArrays, Tile, Triangles

VALUES, DTYPE = 3, np.float32


@device_function(forceinline=True, divides_by_zero=True)
def write(first: int, view: FrameView, scene: SceneArrays, triangles: Triangles, tile: Tile, out: Float32) -> None:
    """Write the normal of what each pixel sees."""
    seen, shades, pose, ground, slot = tile.seen, tile.shades, view.pose, scene.ground, view.slot
    for k in range(len(out)):
        normal = out[k]
        normal[0], normal[1], normal[2] = 0.0, 0.0, 0.0
        if seen[k] >= 0:
            color = triangles.colors[seen[k]]
            normal[0], normal[1], normal[2] = color[9], color[10], color[11]
        elif seen[k] == codes.ON_GROUND and ground.height_frame[slot, 3] == 0.0:
            normal[2] = 1.0
        elif seen[k] == codes.ON_GROUND:
            far = shades[at.DISTANCE, k]
            x, y = pose[at.EYE] + far * shades[at.RAY_X, k], pose[at.EYE + 1] + far * shades[at.RAY_Y, k]
            slope_x = (height_at(ground, slot, x + 0.05, y) - height_at(ground, slot, x - 0.05, y)) * 10.0
            slope_y = (height_at(ground, slot, x, y + 0.05) - height_at(ground, slot, x, y - 0.05)) * 10.0
            unit = 1.0 / math.sqrt(slope_x * slope_x + slope_y * slope_y + 1.0)
            normal[0], normal[1], normal[2] = -slope_x * unit, -slope_y * unit, unit
