"""Which lanes get in each other's way, and where along them: crossings, splits and merges."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float64, Int32

CROSS, SPLIT, MERGE = 0, 1, 2
_SAME_POINT = 0.5  # [m]
_MARGIN = 1.5  # [m] added to both ends of a zone: points are up to 2 m apart


@kernel
def find_conflicts(
    first: Int32,
    points: Float64,
    step: Float64,
    exit_first: Int32,
    exit_to: Int32,
    junction: Int32,
    rank: Int32,
    clearance: float,
) -> tuple[Int32, Int32, Float64, Bool]:
    """Every pair of lanes of one junction, or with one start, whose centrelines come within ``clearance``.

    Args:
        first, step, exit_first, exit_to, rank: As in ``LaneGraph``; points (P, 2) [m].
        junction: (L,) -1 outside junctions.
        clearance: Distance of centrelines below which two vehicles would touch [m].

    Returns:
        conflict_first, conflicts, conflict_zones, needs_grant as in ``LaneGraph``.
    """
    lanes = len(first) - 1
    conflict_first = np.zeros(lanes + 1, dtype=np.int32)
    needs_grant = np.zeros(lanes, dtype=np.bool_)
    pairs = [(0, 0) for _ in range(0)]
    zones = [(0.0, 0.0, 0.0, 0.0) for _ in range(0)]
    for a in range(lanes):
        for b in range(lanes):
            if a == b or _is_linked(a, b, exit_first, exit_to):
                continue
            starts = _distance(points[first[a]], points[first[b]]) < _SAME_POINT
            if not starts and (junction[a] < 0 or junction[a] != junction[b]):
                continue
            zone = _zone(points[first[a] : first[a + 1]], points[first[b] : first[b + 1]], clearance)
            if zone[0] < 0:
                continue
            ends = _distance(points[first[a + 1] - 1], points[first[b + 1] - 1]) < _SAME_POINT
            kind = SPLIT if starts else (MERGE if ends else CROSS)
            pairs.append((b, kind))
            own, other = step[a], step[b]
            zones.append(
                (
                    zone[0] * own - _MARGIN,
                    zone[1] * own + _MARGIN,
                    zone[2] * other - _MARGIN,
                    zone[3] * other + _MARGIN,
                )
            )
            if kind == CROSS or (kind == MERGE and rank[a] <= rank[b]):
                needs_grant[a] = True
        conflict_first[a + 1] = len(pairs)
    conflicts = np.zeros((len(pairs), 2), dtype=np.int32)
    conflict_zones = np.zeros((len(pairs), 4))
    for row in range(len(pairs)):
        conflicts[row, 0], conflicts[row, 1] = pairs[row]
        for column in range(4):
            conflict_zones[row, column] = zones[row][column]
    return conflict_first, conflicts, conflict_zones, needs_grant


@device_function
def _distance(a: Float64, b: Float64) -> float:
    return float(np.hypot(a[0] - b[0], a[1] - b[1]))


@device_function
def _is_linked(a: int, b: int, exit_first: Int32, exit_to: Int32) -> bool:
    found = False
    for e in range(exit_first[a], exit_first[a + 1]):
        found |= exit_to[e] == b
    for e in range(exit_first[b], exit_first[b + 1]):
        found |= exit_to[e] == a
    return found


@device_function
def _zone(a: Float64, b: Float64, clearance: float) -> tuple[int, int, int, int]:
    """First and last point of ``a`` and of ``b`` nearer than ``clearance`` to the other; -1 when none is."""
    low_a, high_a, low_b, high_b = -1, -1, len(b), -1
    for i in range(len(a)):
        for j in range(len(b)):
            if (a[i, 0] - b[j, 0]) ** 2 + (a[i, 1] - b[j, 1]) ** 2 < clearance**2:
                if low_a < 0:
                    low_a = i
                high_a = i
                low_b = min(low_b, j)
                high_b = max(high_b, j)
    return low_a, high_a, low_b, high_b
