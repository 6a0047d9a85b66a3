"""The road as short straight pieces: lanes, lines and edges, as learned drivers read them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Float32, Float64, Int32, UInt8
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building.thinning import thin
from scenarionet_data.scenario.vocabulary import is_lane, is_road_edge, is_road_line
from scenarionet_sim.roads.grid import Grid

LONGEST = 20.0
"""Length of the longest piece [m], so that its midpoint is at most 10 m from what it shows."""

_AREA = 0.1
"""A point is left out if its triangle with its neighbours is smaller [m²], as PufferDrive's preparation does."""

_CELL = 12.5
"""Side of a cell [m]."""


@dataclass(frozen=True, eq=False)
class RoadPieces:
    """K pieces, cell by cell of a grid by their midpoints.

    Attributes:
        frame: (5,) float64, see ``Grid``.
        start: (C + 1,) int32 first piece of each cell.
        numbers: (K, 8) float32 midpoint x, y [m]; length / ``LONGEST``; cosine and sine of the heading; 1 for a lane,
            a line, an edge.
    """

    frame: Float64
    start: Int32
    numbers: Float32

    @classmethod
    def along(cls, lines: Ragged, types: UInt8) -> RoadPieces:
        """Return the pieces of polylines in the plane (float32 [m]), whose types are codes of ``MapFeatureType``."""
        points, is_kept = lines.values.astype(np.float64), np.zeros(len(lines.values), np.bool_)
        thin(points, lines.offsets, _AREA, np.inf, np.empty(len(points), np.int32), is_kept)
        points = points[is_kept]
        owner = np.repeat(np.arange(len(lines)), lines.lengths)[is_kept]
        follows = owner[1:] == owner[:-1]
        begin, along, owner = points[:-1][follows], np.diff(points, axis=0)[follows], owner[1:][follows]
        length = np.hypot(*along.T)
        count = np.ceil(length / LONGEST).astype(np.intp)  # none of a point that is repeated
        piece = np.repeat(np.arange(len(length)), count)
        part = (np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[piece]
        kinds = np.stack([is_kind(types) for is_kind in (is_lane, is_road_line, is_road_edge)], axis=1)
        numbers = np.concatenate([
            begin[piece] + part[:, None] * along[piece], (length / LONGEST / np.maximum(count, 1))[piece, None],
            along[piece] / length[piece, None], kinds[owner[piece]],
        ], axis=1, dtype=np.float32)  # fmt: skip
        grid = Grid.over(numbers[:, :2], numbers[:, :2], _CELL)
        return cls(grid.frame, grid.cell_start, numbers[grid.cell_items])


def joined(segments: Float32, owner: Array) -> Ragged:
    """Return the polylines of consecutive segments (S, 4) [m] with the same owner (S,)."""
    ends = np.flatnonzero(np.append(np.diff(owner), 1)) + 1 if len(owner) else np.zeros(0, np.intp)
    points = np.insert(segments[:, :2], ends, segments[ends - 1, 2:], axis=0)
    return Ragged.from_flat(np.diff(ends, prepend=0) + 1, points)
