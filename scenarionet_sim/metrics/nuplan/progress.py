"""Progress along the lanes of the recorded drive: nuPlan's ``ego_progress_along_expert_route``.

Source: nuplan-devkit, ``planning/metrics/evaluation_metrics/common/ego_progress_along_expert_route.py`` (definitions).
Its maps know road blocks, the lanes of one direction side by side; here whatever is beside a lane within 10 m is in
its road block.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64, Int32, Int64
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.metrics.drive import Drives
from scenarionet_sim.metrics.lane_links import LaneLinks, nearest_arc
from scenarionet_sim.metrics.nuplan.scoring import progress_ratio

_BESIDE = 10.0  # [m]


@dataclass(frozen=True, eq=False)
class ExpertRoutes:
    """Lines that recordings drive along, one after another.

    Attributes:
        points, offsets: Lines of the map: line i is ``points[offsets[i]:offsets[i + 1]]`` (n, 2) [m].
        arcs: (P,) arc length of every point along its line [m].
        first: (B,) first row of each recording in the following.
        counts: (B,) number of the lines that it drives along.
        lines: (S,) which lines these are.
        starts: (S,) progress at the start of each [m].
    """

    points: Float32 | Float64
    offsets: Int32
    arcs: Float64
    first: Int64
    counts: Int64
    lines: Int32
    starts: Float64

    @classmethod
    def of(cls, recorded: Drives, lanes: Int32, links: LaneLinks) -> ExpertRoutes:
        """Return the routes of recordings.

        Args:
            recorded: The recordings.
            lanes: (S, most) their lanes, see ``DrivenLanes``.
            links: The lanes of the map.
        """
        first, counts = recorded.offsets[:-1], np.zeros(len(recorded.dt), np.int64)
        lines, starts = np.empty(len(lanes), np.int32), np.empty(len(lanes))
        find_lines(recorded.offsets, recorded.centre, lanes, links, counts, lines, starts)
        return cls(links.points, links.offsets, links.arcs, first, counts, lines, starts)

    @classmethod
    def without_map(cls, recorded: Drives) -> ExpertRoutes:
        """Return the ways of recordings themselves."""
        points, offsets = recorded.centre[:, 0], recorded.offsets.astype(np.int32)
        arcs, number = np.zeros(len(points)), np.arange(len(recorded.dt))
        for start, end in pairwise(offsets):
            arcs[start + 1 : end] = np.cumsum(np.hypot(*np.diff(points[start:end], axis=0).T))
        return cls(points, offsets, arcs, number, np.ones_like(number), number.astype(np.int32), np.zeros(len(number)))

    def progress(self, drives: Drives) -> Float64:
        """Progress (B,) of drives [m]: to where each was last beside a line, in the order of the lines; NaN without."""
        found = np.full(len(self.counts), np.nan)
        lines = self.first, self.counts, self.lines, self.starts
        _find_progress(drives.offsets, drives.centre, (self.points, self.offsets, self.arcs), lines, found)
        return found

    def ratios(self, driven: Drives, recorded: Drives) -> list[float]:
        """Shares of the recorded progress; 1 if the recording is on no lane, which gives no route.

        Args:
            driven, recorded: The drives, and the recordings.
        """
        both = zip(self.progress(driven).tolist(), self.progress(recorded).tolist(), self.counts, strict=True)
        return [progress_ratio(own, other) if count else 1.0 for own, other, count in both]


@kernel(allocates=False)
def find_lines(
    offsets: Int64, centre: Float64, lanes: Int32, links: LaneLinks, counts: Int64, lines: Int32, starts: Float64
) -> None:
    """Write the centrelines that recordings drive along; see ``ExpertRoutes``."""
    for b in range(len(counts)):
        last, count, first, leave_x, leave_y = -1, 0, offsets[b], 0.0, 0.0  # where it was last on the lane
        for t in range(first, offsets[b + 1]):
            lane = lanes[t, 0]
            if lane >= 0 and lane != last and links.offsets[lane + 1] - links.offsets[lane] > 1:
                start, begin, end = 0.0, links.offsets[lane], links.offsets[lane + 1]
                if count:
                    before, before_end = links.offsets[last], links.offsets[last + 1]
                    x, y, joint = leave_x, leave_y, links.points[before_end - 1]
                    for k in range(links.follower_offsets[last], links.follower_offsets[last + 1]):
                        if links.followers[k] == lane:
                            x, y = np.float64(joint[0]), np.float64(joint[1])
                    arc, _, _ = nearest_arc(x, y, links.points, links.arcs, before, before_end, before)
                    own_arc, _, _ = nearest_arc(x, y, links.points, links.arcs, begin, end, begin)
                    start = starts[first + count - 1] + arc - own_arc
                lines[first + count], starts[first + count], last = lane, start, lane
                count += 1
            if lane == last:
                leave_x, leave_y = centre[t, 0, 0], centre[t, 0, 1]
        counts[b] = count


@kernel(allocates=False)
def _find_progress(
    offsets: Int64,
    centre: Float64,
    table: tuple[Float32 | Float64, Int32, Float64],
    routes: tuple[Int64, Int64, Int32, Float64],
    found: Float64,
) -> None:
    """Write the progress (B,) of drives with a route.

    Args:
        offsets, centre: See ``Drives``.
        table: Points, offsets and arcs of the lines, see ``ExpertRoutes``.
        routes: The first row, number, lines and starts there.
        found: Output.
    """
    (points, line_offsets, arcs), (firsts, counts, lines, starts) = table, routes
    for b in range(len(found)):
        current, reached, began, last = 0, 0.0, 0.0, 0
        if counts[b] == 0:
            continue
        for t in range(offsets[b], offsets[b + 1]):
            for k in range(current, counts[b]):  # a line that was left is not entered again
                line = lines[firsts[b] + k]
                begin, end = line_offsets[line], line_offsets[line + 1]
                arc, apart, last = nearest_arc(centre[t, 0, 0], centre[t, 0, 1], points, arcs, begin, end, last)
                if t == offsets[b]:
                    began = reached = arc
                    break
                if 0.0 < arc < arcs[end - 1] and apart < _BESIDE:
                    current, reached = k, starts[firsts[b] + k] + arc
                    break
        found[b] = reached - began
