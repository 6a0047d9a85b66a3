"""Determine the side of a lane's neighbours, and whether they lead in the opposite direction.

Argoverse 1 lists left and right neighbours regardless of direction: two lanes of opposite directions each have the
other on their left, and some neighbours are listed on the wrong side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.arrays.ragged import Ragged

_ASIDE = 0.5
"""Minimum lateral distance of a neighbour for its side to be determined from geometry [m]."""


@dataclass
class LaneNeighbors:
    """Neighbours of a lane, left and right in its driving direction.

    Attributes:
        left, right: Lanes of either direction.
        opposite: Neighbours in the opposite direction.
        moved: Those that the source lists on the other side.
    """

    left: list[str] = field(default_factory=list)
    right: list[str] = field(default_factory=list)
    opposite: list[str] = field(default_factory=list)
    moved: list[str] = field(default_factory=list)


def sort_sides(
    neighbors: Sequence[tuple[str | None, str | None]], known: Mapping[str, int], centers: Ragged
) -> list[LaneNeighbors]:
    """Sort neighbours by geometry; keep the side of those outside the map.

    Args:
        neighbors: Left and right neighbour of each lane in the source.
        known: Row of each lane of the map.
        centers: Centrelines, points (P, 2) [m].
    """
    sorted_sides = [LaneNeighbors() for _ in neighbors]
    told = [(row, name, side) for row, pair in enumerate(neighbors) for side, name in enumerate(pair) if name]
    inside = [(row, name, side) for row, name, side in told if name in known]
    lanes, others = np.array([(row, known[name]) for row, name, _ in inside], np.int64).reshape(-1, 2).T
    aside, is_opposite = _beside(centers, lanes, others)
    for row, name, side in told:
        if name not in known:
            _put(sorted_sides[row], name, side)
    for (row, name, side), offset, is_against in zip(inside, aside.tolist(), is_opposite.tolist(), strict=True):
        sides = sorted_sides[row]
        lies = side if abs(offset) < _ASIDE else int(offset < 0)
        _put(sides, name, lies)
        if is_against:
            sides.opposite.append(name)
        if lies != side:
            sides.moved.append(name)
    return sorted_sides


def _put(sides: LaneNeighbors, name: str, side: int) -> None:
    chosen = sides.right if side else sides.left
    if name not in chosen:
        chosen.append(name)


def _beside(centers: Ragged, lanes: Int64, others: Int64) -> tuple[Float64, Bool]:
    """Lateral offset of another lane at the middle of a lane [m], positive to the left, and whether it is opposite."""
    if not len(lanes):
        return np.zeros(0), np.zeros(0, np.bool_)
    direction = _directions(centers)
    middle = centers.offsets[lanes] + centers.lengths[lanes] // 2
    there = centers.take(others)
    away = there.values - np.repeat(centers.values[middle], there.lengths, axis=0)
    distance = np.hypot(away[:, 0], away[:, 1])
    lowest = np.repeat(np.minimum.reduceat(distance, there.offsets[:-1]), there.lengths)
    candidates = np.flatnonzero(distance == lowest)
    nearest = candidates[np.searchsorted(candidates, there.offsets[:-1])]
    ahead = direction[middle]
    ahead_there = direction[nearest - there.offsets[:-1] + centers.offsets[others]]
    aside = ahead[:, 0] * away[nearest, 1] - ahead[:, 1] * away[nearest, 0]
    return aside, (ahead * ahead_there).sum(axis=1) < 0


def _directions(lines: Ragged) -> Float64:
    """(P, 2) unit tangents of each line, from the previous to the next point."""
    index = np.arange(len(lines.values))
    after = np.minimum(index + 1, np.repeat(lines.offsets[1:] - 1, lines.lengths))
    before = np.maximum(index - 1, np.repeat(lines.offsets[:-1], lines.lengths))
    step = lines.values[after] - lines.values[before]
    norm = np.hypot(step[:, 0], step[:, 1])[:, None]
    unit: Float64 = step / np.where(norm > 0, norm, 1.0)
    return unit
