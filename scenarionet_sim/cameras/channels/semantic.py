"""Classes of ``cameras.classes.SemanticClass``."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.compiled.decorators import device_function
from scenarionet_sim.cameras.draw import codes
from scenarionet_sim.cameras.draw import columns as at
from scenarionet_sim.cameras.draw.ground import cell_of, paint_at, surface_at
from scenarionet_sim.cameras.draw.structures import FrameView, Ground, SceneArrays, Tile, Triangles

VALUES, DTYPE = 1, np.uint8


@device_function(forceinline=True, divides_by_zero=True)
def write(first: int, view: FrameView, scene: SceneArrays, triangles: Triangles, tile: Tile, out: UInt8) -> None:
    """Write the class of each pixel."""
    seen, shades, pose = tile.seen, tile.shades, view.pose
    for k in range(len(out)):
        found = codes.SKY
        if seen[k] >= 0:
            found = triangles.labels[seen[k], at.SEMANTIC]
        elif seen[k] == codes.ON_GROUND:
            far = shades[at.DISTANCE, k]
            x, y = pose[at.EYE] + far * shades[at.RAY_X, k], pose[at.EYE + 1] + far * shades[at.RAY_Y, k]
            found = ground_class(scene.ground, view.slot, x, y)
        out[k] = found


@device_function(forceinline=True, divides_by_zero=True)
def ground_class(ground: Ground, slot: int, x: float, y: float) -> int:
    """Return the class of the ground at a point."""
    cell = cell_of(ground, slot, x, y)
    if cell < 0:
        return codes.TERRAIN
    bits = int(ground.corner[cell])
    if bits >= codes.HAS_STROKES:
        bits = surface_at(ground, slot, cell, x, y)
        paint = paint_at(ground, cell, x, y)
        if bits & codes.CROSSWALK:
            return codes.CROSSING
        if paint == codes.KERB and not bits & codes.ROAD:
            return codes.PAVEMENT
        if paint >= 0 and paint != codes.KERB:
            return codes.LANE_PAINT
    if bits & codes.CROSSWALK:
        return codes.CROSSING
    if bits & codes.ROAD:
        return codes.ROADWAY
    return codes.PAVEMENT if bits & codes.SIDEWALK else codes.TERRAIN
