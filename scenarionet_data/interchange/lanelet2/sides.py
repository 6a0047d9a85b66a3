"""Sides of lanelets that share their points and lines: what Lanelet2 knows links and neighbours by.

A lanelet follows another if it begins at the two points where that ends, and is beside another if they share a line.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.lanelets import Lanelet

_NOTICED = 0.001  # [m] deviations that are reported
_FAR = 2.5  # [m] between the corners of lanes that lie beside each other from end to end


class Corner(NamedTuple):
    """An end of a side of a lane: row of the map, whether it is the left side, and whether it is the end."""

    row: int
    is_left: bool
    is_end: bool


class Corners:
    """Corners of lanes that are one point."""

    def __init__(self, lanelets: list[Lanelet]) -> None:
        self.place: dict[Corner, Float64] = {}
        for lanelet in lanelets:
            for is_left, line in ((True, lanelet.left), (False, lanelet.right)):
                self.place[Corner(lanelet.row, is_left, False)] = line[0]
                self.place[Corner(lanelet.row, is_left, True)] = line[-1]
        self._same = {corner: [corner] for corner in self.place}

    def join(self, *pairs: tuple[Corner, Corner]) -> bool:
        """Make one point of the corners of each pair, of all pairs or none; return whether it was done.

        It is not where a lane would begin or end with both its sides, or begin where it ends, in one point.
        """
        before = dict(self._same)
        for one, other in pairs:
            if self._same[one] is self._same[other]:
                continue
            together = [*self._same[one], *self._same[other]]
            if len({corner.row for corner in together}) < len(together):
                self._same = before
                return False
            self._same |= dict.fromkeys(together, together)
        return True

    def points(self, losses: Losses) -> dict[Corner, tuple[Corner, Float64]]:
        """Return the first corner of each point and where it is, the middle of its corners (3,) [m], by corner."""
        found: dict[Corner, tuple[Corner, Float64]] = {}
        for corner, same in self._same.items():
            middle = np.mean([self.place[each] for each in same], axis=0)
            moved = float(np.hypot(*(middle - self.place[corner])[:2]))
            what = "corners of lanes, which are moved to those of others"
            losses.approximate(what, int(moved > _NOTICED), moved, "m")
            found[corner] = same[0], middle
        return found


def share_sides(lanelets: list[Lanelet], losses: Losses) -> tuple[Corners, dict[int, int]]:
    """Join the corners of lanes that follow each other or lie beside each other.

    Args:
        lanelets: The lanes.
        losses: Collects links and neighbours that cannot be kept, and how far lines are from those that they share.

    Returns:
        The corners, and by row of a lane the row of the lane whose right side is its left side.
    """
    corners, lane_of = Corners(lanelets), {lanelet.row: lanelet for lanelet in lanelets}
    for lanelet in lanelets:
        for row in lanelet.after:
            pairs = [(Corner(lanelet.row, side, True), Corner(row, side, False)) for side in (True, False)]
            losses.leave_out("links of lanes whose sides would meet", int(not corners.join(*pairs)))
    left_of: dict[int, int] = {}
    for lanelet in lanelets:
        beside = lanelet.on_right
        if beside is None:
            continue
        other = lane_of[beside.row]
        is_mutual = other.on_left is not None and other.on_left.row == lanelet.row
        pairs = [(Corner(lanelet.row, False, end), Corner(other.row, True, end)) for end in (False, True)]
        apart = max(float(np.hypot(*(corners.place[a] - corners.place[b])[:2])) for a, b in pairs)
        if beside.is_opposite or not is_mutual or apart > _FAR or not corners.join(*pairs):
            losses.leave_out("neighbours of lanes that join, part, or lie beside each other in part only")
            continue
        left_of[other.row] = lanelet.row
        off = float(shapely.distance(shapely.points(other.left[:, :2]), shapely.LineString(lanelet.right[:, :2])).max())
        losses.approximate("sides of neighbouring lanes, which become one", int(off > _NOTICED), off, "m")
    return corners, left_of
