"""Conflicts between lanes: crossings, splits and merges, and where along the lanes they are."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64, RecordArray
from scenarionet_data.compiled.decorators import kernel

CROSS, SPLIT, MERGE = 0, 1, 2
_SAME_POINT = 0.5  # [m]
_MARGIN = 1.5  # [m] added to both ends of a zone: points are up to 2 m apart

CONFLICT = np.dtype(
    [
        ("lane", "i8"),  # the other lane
        ("kind", "i8"),  # CROSS, SPLIT or MERGE
        ("own_begin", "f8"),  # [m] along the own lane
        ("own_end", "f8"),
        ("other_begin", "f8"),  # [m] along the other lane
        ("other_end", "f8"),
    ]
)


def find_conflicts(
    lanes: RecordArray, points: RecordArray, links: Bool, junction: Int64, clearance: float
) -> tuple[RecordArray, Bool]:
    """Find lanes of one junction, or with one start, whose centrelines come within ``clearance``.

    Args:
        lanes: (L,) ``LANE`` records; their range of conflicts is written.
        points: (P,) ``POINT`` records.
        links: (L, L) whether a lane leads to another.
        junction: (L,) -1 outside junctions.
        clearance: Distance of centrelines below which two vehicles would touch [m].

    Returns:
        ``CONFLICT`` records, in the order of the own lane, and (L,) whether entering a lane has to be granted.
    """
    xy = np.stack([points.x, points.y], axis=-1)
    starts, ends = xy[lanes.points_begin], xy[lanes.points_end - 1]
    has_one_start, has_one_end = _are_near(starts), _are_near(ends)
    is_candidate = has_one_start | ((junction[:, None] >= 0) & (junction[:, None] == junction))
    is_candidate &= ~(links | links.T | np.eye(len(lanes), dtype=np.bool_))
    pairs = np.ascontiguousarray(np.argwhere(is_candidate))
    zones = np.empty((len(pairs), 4), np.int64)
    _find_zones(xy, lanes.points_begin, lanes.points_end, pairs, clearance * clearance, zones)
    pairs, zones = pairs[zones[:, 0] >= 0], zones[zones[:, 0] >= 0]
    own, other = pairs.T
    conflicts: RecordArray = np.recarray(len(pairs), CONFLICT)
    conflicts.lane = other
    conflicts.kind = np.where(has_one_start[own, other], SPLIT, np.where(has_one_end[own, other], MERGE, CROSS))
    margins = np.array([-_MARGIN, _MARGIN, -_MARGIN, _MARGIN])
    steps = lanes.step[pairs].repeat(2, axis=1)
    conflicts.own_begin, conflicts.own_end, conflicts.other_begin, conflicts.other_end = (zones * steps + margins).T
    lanes.conflicts_end = np.searchsorted(own, np.arange(len(lanes)), side="right")
    lanes.conflicts_begin = np.searchsorted(own, np.arange(len(lanes)), side="left")
    gives_way = (conflicts.kind == MERGE) & (lanes.rank[own] <= lanes.rank[other])
    needs_grant = np.zeros(len(lanes), dtype=np.bool_)
    needs_grant[own[(conflicts.kind == CROSS) | gives_way]] = True
    return conflicts, needs_grant


def _are_near(places: Float64) -> Bool:
    """(L, L) which of the points (L, 2) are the same, within tolerance."""
    near: Bool = np.hypot(*(places[:, None] - places).transpose(2, 0, 1)) < _SAME_POINT
    return near


@kernel
def _find_zones(xy: Float64, begin: Int64, end: Int64, pairs: Int64, square: float, zones: Int64) -> None:
    """First and last point of lane ``a`` and of ``b`` nearer than a distance to the other lane; -1 when none is.

    Args:
        xy: (P, 2) points of all lanes [m].
        begin, end: (L,) range of each lane's points.
        pairs: (K, 2) lanes a and b.
        square: Of the distance [m2].
        zones: (K, 4), written: first and last point of a, first and last point of b.
    """
    for row in range(len(pairs)):
        a, b = pairs[row, 0], pairs[row, 1]
        low_a, high_a, low_b, high_b = -1, -1, end[b] - begin[b], -1
        for i in range(end[a] - begin[a]):
            x, y = xy[begin[a] + i, 0], xy[begin[a] + i, 1]
            for j in range(end[b] - begin[b]):
                if (x - xy[begin[b] + j, 0]) ** 2 + (y - xy[begin[b] + j, 1]) ** 2 < square:
                    low_a = i if low_a < 0 else low_a
                    high_a = i
                    low_b, high_b = min(low_b, j), max(high_b, j)
        zones[row, 0], zones[row, 1], zones[row, 2], zones[row, 3] = low_a, high_a, low_b, high_b
