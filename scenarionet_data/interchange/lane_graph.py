"""The lanes of a map as the formats with roads or lanelets need them: lines, sides and links by row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.curves import distinct
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane

ASSUMED_WIDTH = 3.5  # [m] of lanes whose width is not known
_FAR = 10.0  # [m] sides farther from a lane's centre are measured to something else
_AHEAD = 0.6  # [m] by which the ends of parallel lanes may lie ahead of each other
_BESIDE = (1.5, 6.0)  # [m] between the centres of parallel lanes


@dataclass(frozen=True)
class Sides:
    """The distance of the left and right side of a lane from its centre.

    Attributes:
        shares: (W,) places as shares of the lane's length.
        left, right: (W,) [m].
    """

    shares: Float64
    left: Float64
    right: Float64


@dataclass(frozen=True)
class LaneLines:
    """The lanes of a map that are lines.

    Attributes:
        lines: (P, 3) points of each lane's centre, without repeated ones [m], by row of the map.
        sides: Its width.
        row_of: Rows by id.
        links: Pairs of rows of which the second continues the first.
    """

    lines: dict[int, Float64]
    sides: dict[int, Sides]
    row_of: dict[str, int]
    links: list[tuple[int, int]]


def read_lanes(features: MapFeatures, losses: Losses) -> LaneLines:
    """Read the lanes of a map.

    Args:
        features: The map.
        losses: Collects lanes that are no lines, widths that are assumed, and links that lead out of the map.
    """
    lines: dict[int, Float64] = {}
    for row in np.flatnonzero(is_lane(features.feature_type)).tolist():
        points = (
            distinct(features.polyline[row].astype(np.float64)) if len(features.polyline[row]) else np.zeros((0, 3))
        )
        if len(points) >= 2 and np.isfinite(points).all():
            lines[row] = points
        else:
            losses.leave_out("lanes without two points")
    row_of = {features.ids[row]: row for row in lines}
    sides = {row: _sides(features, row, losses) for row in lines}
    links: dict[tuple[int, int], None] = {}  # from the successors of one lane or the predecessors of the other
    for row in lines:
        for other in features.exit_lanes[row]:
            if other in row_of:
                links[row, row_of[other]] = None
            else:
                losses.leave_out("links to lanes outside of the map")
        links |= {(row_of[other], row): None for other in features.entry_lanes[row] if other in row_of}
    return LaneLines(lines, sides, row_of, list(links))


def _sides(features: MapFeatures, row: int, losses: Losses) -> Sides:
    widths = features.width[row].astype(np.float64)
    if len(widths) and np.isfinite(widths).all() and (widths.sum(axis=1) > 1.0).all() and widths.max() < _FAR:
        part = along(features.polyline[row]) if len(widths) == len(features.polyline[row]) else np.zeros(1)
        shares = part / part[-1] if part[-1] > 0 else np.linspace(0.0, 1.0, len(widths))
        return Sides(shares, widths[:, 0], widths[:, 1])
    found = f"that the map does not have, or with a side beyond {_FAR:g} m; {ASSUMED_WIDTH} m are assumed"
    losses.leave_out(f"widths of lanes {found}")
    half = np.array([0.5 * ASSUMED_WIDTH])
    return Sides(np.zeros(1), half, half)


def boundary_type(features: MapFeatures, row: int, *, is_left: bool) -> MapFeatureType | None:
    """Return the type of the first line or edge on a side of a lane; None without one."""
    ids = features.left_boundaries[row] if is_left else features.right_boundaries[row]
    rows = np.flatnonzero(features.ids == ids[0]).tolist() if len(ids) else []
    return MapFeatureType(features.feature_type[rows[0]]) if rows else None


def along(points: Float64) -> Float64:
    """Return the length in the plane up to each point of a polyline (P, 2 or more) [m]."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2].astype(np.float64), axis=0).T))])


def is_beside(line: Float64, other: Float64) -> bool:
    """Whether another line begins and ends to the right of a line, and runs in its direction.

    Args:
        line, other: (P, 3) [m].
    """
    for end, step in ((0, 1), (-1, -2)):
        ahead = line[1, :2] - line[0, :2] if end == 0 else line[-1, :2] - line[step, :2]
        towards = other[1, :2] - other[0, :2] if end == 0 else other[-1, :2] - other[step, :2]
        ahead, towards = ahead / np.hypot(*ahead), towards / np.hypot(*towards)
        offset = other[end, :2] - line[end, :2]
        right = offset[0] * ahead[1] - offset[1] * ahead[0]
        if abs(offset @ ahead) > _AHEAD or not _BESIDE[0] < right < _BESIDE[1] or ahead @ towards < 0.95:
            return False
    return True
