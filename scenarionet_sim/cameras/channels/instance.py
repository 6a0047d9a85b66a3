"""Triple of objects in the state, -1 elsewhere."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Int32
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.structures import FrameView, SceneArrays, Tile, Triangles

VALUES, DTYPE = 1, np.int32


@device_function(forceinline=True, divides_by_zero=True)
def write(first: int, view: FrameView, scene: SceneArrays, triangles: Triangles, tile: Tile, out: Int32) -> None:
    """Write the object of each pixel."""
    seen, labels = tile.seen, triangles.labels
    for k in range(len(out)):
        out[k] = labels[seen[k], at.INSTANCE_ROW] if seen[k] >= 0 else -1
