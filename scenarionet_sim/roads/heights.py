"""Heights of the ground, from the heights of a map's points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, IntP
from scenarionet_data.scenario.description import MapFeatures

SPACING = 4.0
"""Distance between neighbouring heights [m]."""

_MAX_POINTS = 1 << 18
_OTHER_LEVEL = 4.0
"""Points further than this above or below the recorded objects nearby are on another level, such as a bridge [m]."""


@dataclass(frozen=True, eq=False)
class Heights:
    """Heights on a grid; between its points they are bilinear.

    Attributes:
        frame: (5,) float64 x, y of the first point and distance between points [m]; numbers of columns and rows.
        place: (K,) int32 points of the grid with recorded heights nearby, as row * columns + column.
        total: (K,) float64 sum of these heights [m].
        count: (K,) intp how many they are.
    """

    frame: Float64
    place: Int32
    total: Float64
    count: IntP

    @cached_property
    def values(self) -> Float32:
        """(rows, columns) float32 heights [m]; found when first read, since only cameras and point clouds read them."""
        columns, rows = self.frame[3:].astype(np.int64)
        total, count = np.zeros((2, rows * columns))
        total[self.place], count[self.place] = self.total, self.count
        return _spread(total.reshape(rows, columns), count.reshape(rows, columns)).astype(np.float32)

    @classmethod
    def from_map(cls, features: MapFeatures | None, level: float) -> Heights | None:
        """Return the heights of a map; None for one without usable heights.

        Args:
            features: The map.
            level: Typical height of the ground under recorded objects [m]; points far from it are dropped.
        """
        if features is None:
            return None
        x, y, z = np.concatenate([features.polyline.values, features.polygon.values]).astype(np.float64).T.copy()
        is_usable = np.isfinite(x) & np.isfinite(y) & (np.abs(z - level) < 10.0 * _OTHER_LEVEL)
        x, y, z = x[is_usable], y[is_usable], z[is_usable]
        if not len(z):
            return None
        origin = np.array([x.min(), y.min()]) - SPACING
        end = np.array([x.max(), y.max()]) + SPACING
        spacing = SPACING
        while np.prod(np.ceil((end - origin) / spacing) + 1) > _MAX_POINTS:
            spacing *= 2.0
        columns, rows = (int(points) for points in np.ceil((end - origin) / spacing) + 1)
        # A margin of a cell surrounds all points, so that rounding stays within the grid.
        column, row = np.rint((x - origin[0]) / spacing), np.rint((y - origin[1]) / spacing)
        place = (row * columns + column).astype(np.int64)
        total, count = np.bincount(place, z).astype(np.float64), np.bincount(place)
        used = np.flatnonzero(count).astype(np.int32)
        frame = np.array([*origin, spacing, columns, rows], np.float64)
        return cls(frame, used, total[used], count[used])

    def at(self, points: Float64) -> Float64:
        """Return the heights (n,) at points (n, 2) [m]; beyond the grid, those of its border."""
        columns, rows = self.frame[3:].astype(np.int64)
        where = (points - self.frame[:2]) / self.frame[2]
        where = np.clip(where, 0.0, [columns - 1.0, rows - 1.0])
        low = np.minimum(where.astype(np.int64), [columns - 2, rows - 2])
        (u, v), (column, row) = (where - low).T, low.T
        below = self.values[row, column] * (1 - u) + self.values[row, column + 1] * u
        above = self.values[row + 1, column] * (1 - u) + self.values[row + 1, column + 1] * u
        heights: Float64 = below * (1 - v) + above * v
        return heights


def _spread(total: Float64, count: Float64) -> Float64:
    """Return means; places without points get those of the next coarser grid that has some (push and pull)."""
    if (count > 0).all() or max(total.shape) <= 1:
        return total / np.maximum(count, 1e-12)
    rows, columns = total.shape
    padded = ((0, rows % 2), (0, columns % 2))
    coarse = [
        np.pad(values, padded).reshape((rows + 1) // 2, 2, (columns + 1) // 2, 2).sum(axis=(1, 3))
        for values in (total, count)
    ]
    filled = _spread(coarse[0], coarse[1])
    up = filled.repeat(2, axis=0).repeat(2, axis=1)[:rows, :columns]
    values = np.where(count > 0, total / np.maximum(count, 1e-12), up)
    smooth = np.pad(values, 1, mode="edge")
    smooth = (
        smooth[:-2, 1:-1] + smooth[2:, 1:-1] + smooth[1:-1, :-2] + smooth[1:-1, 2:] + 2.0 * smooth[1:-1, 1:-1]
    ) / 6.0
    return np.where(count > 0, values, smooth)
