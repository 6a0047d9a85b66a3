"""The lanes that drives are on, and what nuPlan's metrics derive from them.

Source: nuplan-devkit, ``planning/metrics/utils/route_extractor.py``, ``ego_lane_change.py``,
``driving_direction_compliance.py`` and ``speed_limit_compliance.py`` (definitions). In nuPlan's maps only lane
connectors overlap, in those of other datasets any lanes do: all that contain a point are candidates, and the one
along the heading counts first.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int8, Int32, Int64
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.metrics.drive import Drives
from scenarionet_sim.metrics.lane_kernels import SHARED, LaneMemory, find_routes, share_lanes
from scenarionet_sim.metrics.lane_links import LaneLinks, LaneRows, nearest_arc
from scenarionet_sim.roads.roads import Roads


@dataclass(frozen=True)
class LaneChange:
    """A lane change: nuPlan's ``ego_lane_change``.

    Attributes:
        start, end: Moment at which the first corner has left the lane, and at which all are in one again.
        is_completed: Whether it ends in a lane that is neither the first one nor a follower of it; not in the first
            one again, off all lanes, or with the drive.
    """

    start: int
    end: int
    is_completed: bool


@dataclass(frozen=True, eq=False)
class DrivenLanes:
    """Lanes of drives on one map, of S moments in total.

    Attributes:
        drives: The drives.
        links: The lanes of the map.
        lanes: (S, most) the lanes that the centre is on, of which the first one counts; -1 after the last.
        shared: (S,) ``SHARED`` where the corners of the box are in one lane, or in lanes that follow one another;
            ``APART`` where they are in others, and ``OFF`` where all are off the lanes.
        on_lane: (S, 4) whether each corner is on a lane.
        changes: (S, 3) from the first moment of each drive on: first and last moment of its lane changes, and whether
            they are completed.
        num_changes: (B,) number of the lane changes.
    """

    drives: Drives
    links: LaneLinks
    lanes: Int32
    shared: Int8
    on_lane: Bool
    changes: Int32
    num_changes: Int64

    @classmethod
    def of(cls, drives: Drives, roads: Roads) -> DrivenLanes:
        """Find the lanes of drives."""
        links, (count, moments) = roads.once(LaneLinks.of), (len(drives.box), len(drives.heading))
        memory = LaneMemory.of(int(np.diff(drives.offsets).max(initial=0)), links)
        shared, on_lane = np.empty(moments, np.int8), np.empty((moments, 4), np.bool_)
        changes, num_changes = np.empty((moments, 3), np.int32), np.zeros(count, np.int64)
        share_lanes(drives.offsets, drives.corners, links, memory, shared, on_lane, changes, num_changes)
        return cls(drives, links, lanes_of(drives, links, memory), shared, on_lane, changes, num_changes)

    @property
    def route(self) -> list[LaneRows]:
        """The lanes that the centre is on, for each of S moments."""
        ended = np.where(np.cumsum(self.lanes < 0, axis=1) > 0, np.int32(-1), self.lanes)
        return [tuple(lane for lane in lanes if lane >= 0) for lanes in ended.tolist()]

    @property
    def is_in_lane(self) -> Bool:
        """(S,) whether the corners of the box are in one lane, or in lanes that follow one another."""
        is_in: Bool = self.shared == SHARED
        return is_in

    def lane_changes(self, drive: int = 0) -> list[LaneChange]:
        """Lane changes of a drive, also those that are not completed."""
        first = int(self.drives.offsets[drive])
        found = self.changes[first : first + int(self.num_changes[drive])].tolist()
        return [LaneChange(start, end, bool(is_completed)) for start, end, is_completed in found]

    def progress(self) -> Float64:
        """Movement (S,) along the lane since the moment before [m]; 0 where the lane is new, or there is none."""
        progress = np.zeros(len(self.lanes))
        _find_progress(self.drives.offsets, self.drives.centre, self.lanes, self.links, progress)
        return progress

    def speed_limit(self) -> Float64:
        """Limit (S,) of the lane [m/s]: of a connector the highest of the lanes it connects; NaN where unknown."""
        limits = np.full(len(self.lanes), np.nan)
        find_limits(self.lanes, self.links, limits)
        return limits


def lanes_of(drives: Drives, links: LaneLinks, memory: LaneMemory | None = None) -> Int32:
    """Return the lanes (S, most) that drives are on, see ``DrivenLanes.lanes``."""
    lanes = np.empty((len(drives.heading), links.most), np.int32)
    memory = memory or LaneMemory.of(int(np.diff(drives.offsets).max(initial=0)), links)
    find_routes(drives.offsets, drives.centre, drives.heading, links, memory, lanes)
    return lanes


@kernel(allocates=False)
def _find_progress(offsets: Int64, centre: Float64, lanes: Int32, links: LaneLinks, progress: Float64) -> None:
    """Write the movement along the lane since the last moment on one, by the nearest points on the lanes.

    The arc where the lane is new counts as unknown, and, as the owner has it, an arc of 0.

    Args:
        offsets, centre, lanes, links: See ``DrivenLanes``.
        progress: (S,) output, zeros before.
    """
    last = 0  # row of the nearest segment of the moment before
    for drive in range(len(offsets) - 1):
        before, arc_before, was_same = lanes[offsets[drive], 0], np.nan, False
        for t in range(offsets[drive], offsets[drive + 1]):
            lane = lanes[t, 0]
            if lane < 0:
                continue
            is_same = lane == before
            first, end = links.offsets[lane], links.offsets[lane + 1]
            arc, _, last = nearest_arc(centre[t, 0, 0], centre[t, 0, 1], links.points, links.arcs, first, end, last)
            if is_same and was_same and arc != 0.0 and np.isfinite(arc - arc_before):
                progress[t] = arc - arc_before
            before, arc_before, was_same = lane, arc, is_same


@kernel(allocates=False)
def find_limits(lanes: Int32, links: LaneLinks, limits: Float64) -> None:
    """Write the speed limits (S,) of lanes, NaN before; a highest of several is unknown if one of them is."""
    for t in range(len(lanes)):
        if lanes[t, 0] < 0:
            continue
        if t and lanes[t, 0] == lanes[t - 1, 0] and not links.is_connector[lanes[t, 0]]:
            limits[t] = limits[t - 1]
            continue
        limit = links.speed_limit[lanes[t, 0]]
        if links.is_connector[lanes[t, 0]]:
            limit = np.float32(-np.inf)
            for lane in lanes[t]:
                if lane < 0:
                    break
                limit = _highest(limit, lane, links.follower_offsets, links.followers, links.speed_limit)
                limit = _highest(limit, lane, links.leader_offsets, links.leaders, links.speed_limit)
        if limit > -np.inf:
            limits[t] = limit


@device_function
def _highest(limit: np.float32, lane: int, offsets: Int32, edges: Int32, limits: Float32) -> np.float32:
    """Return the highest of a limit and those of the lanes that a lane is joined to; NaN if one is."""
    for k in range(offsets[lane], offsets[lane + 1]):
        other = np.float32(limits[edges[k]])
        limit = other if np.isnan(other) or other > limit else limit
    return limit
