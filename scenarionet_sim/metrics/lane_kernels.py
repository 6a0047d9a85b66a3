"""The lanes of drives, moment by moment, as nuPlan's metrics follow them; compiled for many drives on one map.

Source: nuplan-devkit, ``planning/metrics/utils/route_extractor.py`` and ``ego_lane_change.py`` (definitions).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int8, Int32, Int64
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.containment import is_around, is_near_outline, polygon_at, stays_between
from scenarionet_sim.metrics.lane_links import LaneLinks, cosine_along

NEAR_CONNECTOR = 5.0
"""Distance from a connector within which a vehicle is still assigned to it, while in an intersection [m]."""

APART, OFF, SHARED = -1, 0, 1
"""The corners of a box are in different lanes, off all lanes, or in one lane or in lanes that follow one another."""


class LaneMemory(NamedTuple):
    """Memory for the lanes of a drive of up to T moments: lists of lanes, of which one has up to M."""

    first: Int32
    starts: Int32
    around: Int32
    keys: Float64
    corners: Int32
    counts: Int64
    candidates: Int32
    earlier: Int32
    shared: Int32
    before: Int32
    left: Int32

    @classmethod
    def of(cls, num_moments: int, links: LaneLinks) -> LaneMemory:
        """Allocate the memory."""
        most, lanes = links.most, len(links.offsets)
        candidates, earlier = np.empty((2, 8 * most), np.int32)
        shared, before, left = np.empty((3, lanes), np.int32)
        return cls(
            np.empty(num_moments, np.int32), np.zeros(4 * num_moments + 1, np.int32),
            np.empty(4 * num_moments * most, np.int32), np.empty(most), np.empty((4, most), np.int32),
            np.zeros(4, np.int64), candidates, earlier, shared, before, left,
        )  # fmt: skip


@kernel(allocates=False)
def find_routes(
    offsets: Int64, centre: Float64, heading: Float64, links: LaneLinks, memory: LaneMemory, route: Int32
) -> None:
    """Write the lanes that drives are on: the same, a follower, or else any around the centre.

    Args:
        offsets: (B + 1,) first moment of each drive.
        centre: (S, 1, 2) [m].
        heading: (S,) [rad].
        links: The lanes.
        memory: Memory.
        route: (S, most) output: lanes of each moment, the one along the heading first; -1 after the last.
    """
    for drive in range(len(offsets) - 1):
        begin, count = offsets[drive], offsets[drive + 1] - offsets[drive]
        stays = _find_stays(begin, begin + count, centre, links, memory)
        num_last = 0
        for stay in range(stays):
            here = memory.around[memory.starts[stay] : memory.starts[stay + 1]]
            end = memory.first[stay + 1] if stay + 1 < stays else count
            t = memory.first[stay]
            while t < end:  # each moment depends on the one before
                last, found = route[begin + max(t - 1, 0)], route[begin + t]
                if num_last == 1 and _has(here, len(here), last[0]):  # so until the end of the stay
                    for later in range(t, end):
                        route[begin + later, 0] = last[0]
                        _end_list(route[begin + later], 1)
                    break
                num_found = _continue(last, num_last, here, links, found)
                x, y = centre[begin + t, 0, 0], centre[begin + t, 0, 1]
                if num_found == 0:
                    num_found = _enter(x, y, last, num_last if t > 1 else 0, here, links, found)
                _sort_by_heading(x, y, heading[begin + t], links, memory.keys, found, num_found)
                _end_list(found, num_found)
                num_last = num_found
                t += 1
        for t in range(begin + count - 2, begin - 1, -1):
            _leave_other_branches(route[t], route[t + 1], links)


@device_function
def _find_stays(begin: int, end: int, points: Float64, links: LaneLinks, memory: LaneMemory) -> int:
    """Fill the memory with the spans of moments at which points stay in the same lanes; return how many they are."""
    lanes = len(links.speed_limit)
    return stays_between(begin, end, points, links.polygons, lanes, memory.first, memory.starts, memory.around)


@device_function
def _has(lanes: Int32, count: int, lane: int) -> bool:
    found = False
    for k in range(count):
        found |= lanes[k] == lane
    return found


@device_function
def _copy(lanes: Int32, count: int, copied: Int32) -> None:
    for k in range(count):
        copied[k] = lanes[k]


@device_function
def _end_list(lanes: Int32, count: int) -> None:
    if count < len(lanes):
        lanes[count] = -1


@device_function
def _length(lanes: Int32) -> int:
    count = 0
    while count < len(lanes) and lanes[count] >= 0:
        count += 1
    return count


@device_function
def _follows(later: int, lane: int, links: LaneLinks) -> bool:
    """Return whether a lane follows another one."""
    start, end = links.follower_offsets[lane], links.follower_offsets[lane + 1]
    return _has(links.followers[start:end], end - start, later)


@device_function
def _continue(lanes: Int32, count: int, here: Int32, links: LaneLinks, found: Int32) -> int:
    """Write those of some lanes around a point, or of the followers of the only one; return their number."""
    num_found = 0
    for k in range(count):
        if _has(here, len(here), lanes[k]):
            found[num_found] = lanes[k]
            num_found += 1
    if num_found == 0 and count == 1:
        lane = lanes[0]
        for k in range(links.follower_offsets[lane], links.follower_offsets[lane + 1]):
            if _has(here, len(here), links.followers[k]):
                found[num_found] = links.followers[k]
                num_found += 1
    return num_found


@device_function
def _lanes_at(here: Int32, links: LaneLinks, found: Int32) -> int:
    """Write the lanes around a point that are no connectors, or else all, in order; return their number."""
    num_found = 0
    for lane in here:
        if not links.is_connector[lane]:
            found[num_found] = lane
            num_found += 1
    if num_found == 0:
        for lane in here:
            found[num_found] = lane
            num_found += 1
    return num_found


@device_function
def _enter(x: float, y: float, last: Int32, num_last: int, here: Int32, links: LaneLinks, found: Int32) -> int:
    """Write the lanes of a moment that do not continue those of the moment before; return their number."""
    num_found = _lanes_at(here, links, found)
    if num_last == 0 or not links.is_connector[last[0]]:
        return num_found
    is_crossing = polygon_at(x, y, links.polygons, links.is_crossing) >= 0
    if links.is_connector[found[0]] if num_found else is_crossing:
        kept, outlines, offsets = 0, links.polygons.outlines, links.polygons.offsets
        for k in range(num_last):
            lane, square = last[k], NEAR_CONNECTOR * NEAR_CONNECTOR
            if is_around(links.polygons, lane, x, y) or is_near_outline(
                x, y, outlines, offsets[lane], offsets[lane + 1], square
            ):
                found[kept] = lane
                kept += 1
        return kept if kept else num_found
    return num_found


@device_function
def _sort_by_heading(
    x: float, y: float, heading: float, links: LaneLinks, keys: Float64, found: Int32, count: int
) -> None:
    """Sort lanes by how far they turn from a heading; those that turn equally stay in order."""
    for k in range(count if count > 1 else 0):
        lane, key = found[k], cosine_along(links.points, links.offsets, found[k], x, y, heading)
        place = k
        while place > 0 and keys[place - 1] < key:
            keys[place], found[place] = keys[place - 1], found[place - 1]
            place -= 1
        keys[place], found[place] = key, lane


@device_function
def _leave_other_branches(lanes: Int32, later: Int32, links: LaneLinks) -> None:
    """Of several lanes keep those on which the drive goes on."""
    count, num_later = _length(lanes), _length(later)
    if count < 2:
        return
    is_part = num_later < count
    for k in range(num_later):
        is_part &= _has(lanes, count, later[k])
    goes_on = num_later > 0 and not links.is_connector[later[0]]
    if goes_on:
        kept = 0
        for k in range(count):
            kept += _follows(later[0], lanes[k], links)
        goes_on = kept > 0
    if goes_on:
        kept = 0
        for k in range(count):
            if _follows(later[0], lanes[k], links):
                lanes[kept] = lanes[k]
                kept += 1
        _end_list(lanes, kept)
    elif is_part:
        for k in range(num_later):
            lanes[k] = later[k]
        _end_list(lanes, num_later)


@kernel(allocates=False)
def share_lanes(
    offsets: Int64, corners: Float64, links: LaneLinks, memory: LaneMemory, shared: Int8, on_lane: Bool,
    changes: Int32, num_changes: Int64,
) -> None:  # fmt: skip
    """Write which lanes the corners of boxes share, and when these change.

    Args:
        offsets: (B + 1,) first moment of each drive.
        corners: (S, 4, 2) front left, rear left, rear right, front right [m].
        links: The lanes.
        memory: Memory.
        shared: (S,) output: APART, OFF or SHARED.
        on_lane: (S, 4) output: whether each corner is on a lane.
        changes: (S, 3) output, from the first moment of the drive on: first and last moment of each lane change, and
            1 if it is completed.
        num_changes: (B,) output: number of lane changes.
    """
    for drive in range(len(offsets) - 1):
        begin, count = offsets[drive], offsets[drive + 1] - offsets[drive]
        stays = _find_stays(begin, begin + count, corners, links, memory)
        num_candidates = num_before = num_left = start = num_changes[drive] = 0
        for stay in range(stays):
            end, t = memory.first[stay + 1] if stay + 1 < stays else count, memory.first[stay]
            for k in range(4):
                is_on = memory.starts[4 * stay + k + 1] > memory.starts[4 * stay + k]
                for moment in range(begin + t, begin + end):
                    on_lane[moment, k] = is_on
            while t < end:  # candidates are the lanes of the moment before
                num_earlier = num_candidates
                _copy(memory.candidates, num_earlier, memory.earlier)
                num_candidates = _find_candidates(stay, num_candidates, t == 1, links, memory)
                state, num_shared = _find_shared(links, memory)
                shared[begin + t] = state
                if t and num_left == 0 and state == APART and num_before:
                    start, num_left = t, num_before
                    _copy(memory.before, num_left, memory.left)
                elif num_left and state != APART:
                    is_new = num_shared > 0
                    for k in range(num_shared):
                        for n in range(num_left):
                            lane, now = memory.left[n], memory.shared[k]
                            is_new &= lane != now and not _follows(now, lane, links)
                    _note_change(begin + num_changes[drive], start, t, is_new, changes)
                    num_changes[drive] += 1
                    num_left = 0
                num_before = num_shared
                _copy(memory.shared, num_before, memory.before)
                is_same = num_candidates == num_earlier and t > 1
                for k in range(num_candidates if is_same else 0):
                    is_same &= memory.candidates[k] == memory.earlier[k]
                t += 1
                if is_same:  # so until the end of the stay
                    for later in range(begin + t, begin + end):
                        shared[later] = state
                    break
        if num_left:
            _note_change(begin + num_changes[drive], start, count - 1, False, changes)
            num_changes[drive] += 1


@device_function
def _note_change(row: int, start: int, end: int, is_completed: bool, changes: Int32) -> None:
    changes[row, 0], changes[row, 1], changes[row, 2] = start, end, is_completed


@device_function
def _find_candidates(stay: int, num_candidates: int, is_second: bool, links: LaneLinks, memory: LaneMemory) -> int:
    """Write the lanes of each corner, and all of them as the next candidates; return the number of these."""
    candidates = memory.candidates
    for k in range(4):
        start, end, of_corner = memory.starts[4 * stay + k], memory.starts[4 * stay + k + 1], memory.corners[k]
        here = memory.around[start:end]
        memory.counts[k] = _continue(candidates, num_candidates, here, links, of_corner)
        if memory.counts[k] == 0:
            memory.counts[k] = _lanes_at(here, links, of_corner)
            if is_second:
                num_candidates = _add_lanes(candidates, num_candidates, of_corner, memory.counts[k])
    num_candidates = 0
    for k in range(4):
        num_candidates = _add_lanes(candidates, num_candidates, memory.corners[k], memory.counts[k])
    return num_candidates


@device_function
def _add_lanes(lanes: Int32, count: int, more: Int32, num_more: int) -> int:
    """Add the lanes that are not in a list yet; return their number."""
    for k in range(num_more):
        if not _has(lanes, count, more[k]):
            lanes[count] = more[k]
            count += 1
    return count


@device_function
def _find_shared(links: LaneLinks, memory: LaneMemory) -> tuple[int, int]:
    """Write the lanes that all corners are in, or are between in lanes that follow one another, crosswise.

    Returns:
        APART, OFF or SHARED, and the number of lanes.
    """
    corners, counts, num_shared = memory.corners, memory.counts, 0
    if max(counts[0], counts[1], counts[2], counts[3]) == 0:
        return OFF, 0
    if min(counts[0], counts[1], counts[2], counts[3]) == 0:
        return APART, 0
    for n in range(counts[0]):
        lane = corners[0, n]
        if _is_of(1, lane, memory) and _is_of(2, lane, memory) and _is_of(3, lane, memory):
            memory.shared[num_shared] = lane
            num_shared += 1
    if num_shared:
        return SHARED, num_shared
    crosses = False
    for n in range(counts[1]):
        crosses |= _comes_from(2, corners[1, n], links, memory)
    for n in range(counts[2]):
        crosses |= _comes_from(1, corners[2, n], links, memory)
    for n in range(counts[1] if crosses else 0):
        lane = corners[1, n]
        num_shared = _add_if_between(lane, num_shared, links, memory)
        for k in range(links.follower_offsets[lane], links.follower_offsets[lane + 1]):
            num_shared = _add_if_between(links.followers[k], num_shared, links, memory)
    return SHARED if num_shared else APART, num_shared


@device_function
def _is_of(corner: int, lane: int, memory: LaneMemory) -> bool:
    return _has(memory.corners[corner], memory.counts[corner], lane)


@device_function
def _comes_from(corner: int, lane: int, links: LaneLinks, memory: LaneMemory) -> bool:
    """Return whether a lane is one of a corner, or follows one."""
    found = _is_of(corner, lane, memory)
    for n in range(memory.counts[corner]):
        found |= _follows(lane, memory.corners[corner, n], links)
    return found


@device_function
def _leads_to(corner: int, lane: int, links: LaneLinks, memory: LaneMemory) -> bool:
    """Return whether a lane is one of a corner, or one follows it."""
    found = _is_of(corner, lane, memory)
    for n in range(memory.counts[corner]):
        found |= _follows(memory.corners[corner, n], lane, links)
    return found


@device_function
def _add_if_between(lane: int, num_shared: int, links: LaneLinks, memory: LaneMemory) -> int:
    """Add a lane that comes from a left rear corner, if it comes from the right one and leads to both front corners."""
    if (
        _comes_from(2, lane, links, memory)
        and _leads_to(0, lane, links, memory)
        and _leads_to(3, lane, links, memory)
        and not _has(memory.shared, num_shared, lane)
    ):
        memory.shared[num_shared] = lane
        num_shared += 1
    return num_shared
