"""Heights of the ground, from the heights of a map's points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64
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
        values: (rows, columns) float32 [m].
    """

    frame: Float64
    values: Float32

    @classmethod
    def from_map(cls, features: MapFeatures | None, level: float) -> Heights | None:
        """Return the heights of a map; None for one without usable heights.

        Args:
            features: The map.
            level: Typical height of the ground under recorded objects [m]; points far from it are dropped.
        """
        if features is None:
            return None
        points = np.concatenate([features.polyline.values, features.polygon.values]).astype(np.float64)
        points = points[np.isfinite(points).all(axis=1)]
        points = points[np.abs(points[:, 2] - level) < 10.0 * _OTHER_LEVEL]
        if not len(points):
            return None
        origin, end = points[:, :2].min(axis=0) - SPACING, points[:, :2].max(axis=0) + SPACING
        spacing = SPACING
        while np.prod(np.ceil((end - origin) / spacing) + 1) > _MAX_POINTS:
            spacing *= 2.0
        shape = np.ceil((end - origin) / spacing).astype(np.int64) + 1
        columns, rows = np.clip(np.rint((points[:, :2] - origin) / spacing).astype(np.int64), 0, shape - 1).T
        place = rows * shape[0] + columns
        size, ones = int(shape.prod()), np.ones(len(place))
        count = np.bincount(place, ones, minlength=size)
        total = np.bincount(place, points[:, 2], minlength=size)
        table = int(shape[1]), int(shape[0])
        values = _spread(np.asarray(total.reshape(table)), np.asarray(count.reshape(table)))
        return cls(np.array([*origin, spacing, *shape], np.float64), values.astype(np.float32))

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
