"""Sides of Lyft's lanes in driving direction, and the paint along them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.geometry import path_length


class LaneSide(NamedTuple):
    """One side of a lane.

    Attributes:
        points: (n, 2) [m].
        dividers: Kinds of paint, in order.
        changes: Arc lengths at which the kind changes [m].
    """

    points: Float64
    dividers: Sequence[int]
    changes: Sequence[float]

    def reversed(self) -> LaneSide:
        """The side in reverse order."""
        length = path_length(self.points)
        return LaneSide(self.points[::-1], self.dividers[::-1], [length - place for place in reversed(self.changes)])

    def paint(self) -> list[tuple[int, Float64]]:
        """Each kind of paint with its part of the side; kinds without extent are skipped."""
        if len(self.dividers) == 1:
            return [(self.dividers[0], self.points)]
        step = np.hypot(*np.diff(self.points, axis=0).T)
        along = np.concatenate([[0.0], np.cumsum(step)])
        bounds = [0.0, *self.changes[: max(len(self.dividers) - 1, 0)], float(along[-1])]
        parts = zip(self.dividers, pairwise(bounds), strict=False)
        return [(kind, _part(self.points, along, *place)) for kind, place in parts if place[0] < place[1] <= along[-1]]


class LaneSides(NamedTuple):
    """Left and right side of a lane, with points in driving direction."""

    left: LaneSide
    right: LaneSide

    @property
    def ends(self) -> Float64:
        """(2, 2) start and end of the lane [m]."""
        return (self.left.points[[0, -1]] + self.right.points[[0, -1]]) / 2.0

    def turned_around(self) -> LaneSides:
        """The lane in the opposite direction, with left and right swapped if needed."""
        left, right = self.left.reversed(), self.right.reversed()
        outline = np.concatenate([left.points, right.points[::-1]])
        return LaneSides(left, right) if _is_clockwise(outline) else LaneSides(right, left)


def in_driving_direction(
    lanes: Mapping[str, LaneSides], is_backward: Mapping[str, bool], ahead: Mapping[str, Sequence[str]]
) -> dict[str, LaneSides]:
    """Orient lanes in driving direction.

    According to the map's description the points of a side follow the road segment, so those of lanes against the
    segment would be reversed; l5kit does not reverse them. They are reversed here if the ends of lanes then fit the
    starts of their successors better.

    Args:
        lanes: Lanes as stored, by id.
        is_backward: Whether a lane leads against its segment.
        ahead: Ids of the successors of each lane.
    """
    if not any(is_backward[lane] for lane in lanes):
        return dict(lanes)
    turned = {lane: sides.turned_around() if is_backward[lane] else sides for lane, sides in lanes.items()}
    return turned if _gaps(turned, ahead) < _gaps(lanes, ahead) else dict(lanes)


def _gaps(lanes: Mapping[str, LaneSides], ahead: Mapping[str, Sequence[str]]) -> float:
    """Sum of the distances from the ends of lanes to the starts of their successors [m]."""
    links = [(lane, other) for lane in lanes for other in ahead[lane] if other in lanes]
    ends = {lane: sides.ends for lane, sides in lanes.items()}
    return sum(float(np.hypot(*(ends[lane][1] - ends[other][0]))) for lane, other in links)


def _is_clockwise(outline: Float64) -> bool:
    x, y = (outline - outline[0]).T
    return bool((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() < 0.0)


def _part(points: Float64, along: Float64, first: float, last: float) -> Float64:
    """(m, 2) part of a line between two arc lengths [m]."""
    inner = (along > first) & (along < last)
    places = np.concatenate([[first], along[inner], [last]])
    return np.column_stack([np.interp(places, along, points[:, axis]) for axis in range(2)])
