"""Depth [m]: along the optical axis with a pinhole, along the ray with other lenses."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.structures import FrameView, SceneArrays, Tile, Triangles

VALUES, DTYPE = 1, np.float32


@device_function(forceinline=True, divides_by_zero=True)
def write(first: int, view: FrameView, scene: SceneArrays, triangles: Triangles, tile: Tile, out: Float32) -> None:
    """Write the distance of each pixel."""
    for k in range(len(out)):
        out[k] = tile.shades[at.DISTANCE, k]
