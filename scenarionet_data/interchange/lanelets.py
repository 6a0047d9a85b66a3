"""From a lane graph to lanelets: the step that formats whose lanes have two sides share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building.polylines import directions
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.lane_graph import LaneLines, along, is_beside, read_lanes
from scenarionet_data.scenario.description import MapFeatures

_NOTICED = 0.001  # [m] deviations that are reported


@dataclass(frozen=True)
class Beside:
    """The lane on a side of another: its row, and whether it runs in the opposite direction."""

    row: int
    is_opposite: bool


@dataclass(frozen=True)
class Lanelet:
    """A lane with two sides.

    Attributes:
        row: Its row in the map.
        left, right: (P, 3) its sides, point by point beside its centre [m].
        before, after: Rows of the lanes that lead to it, and that continue it.
        on_left, on_right: The lane on each side.
    """

    row: int
    left: Float64
    right: Float64
    before: tuple[int, ...]
    after: tuple[int, ...]
    on_left: Beside | None
    on_right: Beside | None


def make_lanelets(features: MapFeatures, losses: Losses) -> list[Lanelet]:
    """Make a lanelet of every lane of a map.

    Args:
        features: The map.
        losses: Collects lanes that are no lines, links that lead out of the map, neighbours beyond one on each side,
            and lanes whose centre is not in the middle.
    """
    graph = read_lanes(features, losses)
    if not graph.lines:
        return []
    before: dict[int, list[int]] = {row: [] for row in graph.lines}
    after: dict[int, list[int]] = {row: [] for row in graph.lines}
    for row, other in graph.links:
        after[row].append(other)
        before[other].append(row)
    lines = list(graph.lines.values())
    ahead = directions(Ragged.from_flat([len(line) for line in lines], np.concatenate(lines)))
    starts = np.cumsum([0, *map(len, lines)])
    found = []
    for (row, line), start in zip(graph.lines.items(), starts[:-1].tolist(), strict=True):
        part, sides = along(line), graph.sides[row]
        left, right = (np.interp(part / part[-1], sides.shares, side) for side in (sides.left, sides.right))
        off_centre = 0.5 * float(np.abs(left - right).max())
        losses.approximate("lanes whose centre is not in the middle", int(off_centre > _NOTICED), off_centre, "m")
        tangent = ahead[start : start + len(line)]
        across = np.column_stack([-tangent[:, 1], tangent[:, 0], np.zeros(len(line))])
        found.append(
            Lanelet(
                row, line + left[:, None] * across, line - right[:, None] * across,
                tuple(before[row]), tuple(after[row]),
                _beside(features, graph, row, losses, is_left=True),
                _beside(features, graph, row, losses, is_left=False),
            )
        )  # fmt: skip
    return found


def _beside(features: MapFeatures, graph: LaneLines, row: int, losses: Losses, *, is_left: bool) -> Beside | None:
    ids = features.left_neighbors[row] if is_left else features.right_neighbors[row]
    rows = [other for other in dict.fromkeys(graph.row_of.get(each, row) for each in ids) if other != row]
    what = "neighbours of lanes beyond one on each side, or outside of the map"
    losses.leave_out(what, len(set(ids)) - min(len(rows), 1))
    if not rows:
        return None
    line = graph.lines[row]
    fitting = [
        other
        for other in rows
        if (is_beside(graph.lines[other], line) if is_left else is_beside(line, graph.lines[other]))
    ]
    other = (fitting or rows)[0]
    ends, beside = line[[0, -1], :2], graph.lines[other][[0, -1], :2]
    apart = [float(np.hypot(*(ends - each).T).sum()) for each in (beside, beside[::-1])]
    return Beside(other, apart[1] < apart[0])
