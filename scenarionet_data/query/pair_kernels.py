"""Compiled relations of two objects: the spans of timesteps at which one holds, of all pairs of a scenario."""

from __future__ import annotations

from math import atan2, cos, pi, sin, sqrt
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import device_function, kernel

NEAR, BESIDE, FACING, TOWARD, COURSES, CROSSED, ON_LANES, FOLLOWING = range(8)
"""Relations, see ``compiled_relations``."""
CONTINUES, SAME_SIDE, OPPOSITE_SIDE, EXIT, NEIGHBOUR = 1, 2, 4, 8, 16
"""What one lane is to another, added."""


class PairStates(NamedTuple):
    """Rows of the view ``smoothed``, those of an object one after the other, and the lane, -1 for none, of each.

    Attributes:
        scenarios: (N + 1,) int64 where the tracks of each scenario begin.
        tracks: (T, 2) int64 where the states of each track begin and end.
        bounds: (T, 4) float64 left, right, low, high of all that its boxes reach [m].
        timestep, lane: (S,) int64.
        x, y, vx, vy, speed, course, box_x, box_y, heading, heading_x, heading_y, length, width, radius: (S,) float64,
            as in the view.
        walks: (S,) bool whether it can move by itself (a vehicle, pedestrian or cyclist).
    """

    scenarios: Array
    tracks: Array
    bounds: Array
    timestep: Array
    lane: Array
    x: Array
    y: Array
    vx: Array
    vy: Array
    speed: Array
    course: Array
    box_x: Array
    box_y: Array
    heading: Array
    heading_x: Array
    heading_y: Array
    length: Array
    width: Array
    radius: Array
    walks: Array


class LinkedLanes(NamedTuple):
    """Lanes that have to do with each lane.

    Attributes:
        offsets: (L + 1,) int64 where those of each lane begin.
        others: (K,) int64 their numbers.
        kinds: (K,) int64 what they are, see CONTINUES.
    """

    offsets: Array
    others: Array
    kinds: Array


@device_function(forceinline=True)
def wrap_angle(angle: float) -> float:
    """Return an angle [rad] in [-pi, pi), as the macro of SQL."""
    wrapped: float = angle - 2 * pi * np.floor((angle + pi) / (2 * pi))
    return wrapped


@device_function
def corners_gap(
    ahead: float, left: float, c: float, s: float, size1: tuple[float, float], size2: tuple[float, float]
) -> float:
    """Return the square of the smallest distance [m^2] from the corners of the second box to the first."""
    least = np.inf
    for along, across in ((1.0, -1.0), (1.0, 1.0), (-1.0, -1.0), (-1.0, 1.0)):
        a, b = along * size2[0] / 2, across * size2[1] / 2
        x = max(abs(ahead + a * c - b * s) - size1[0] / 2, 0.0)
        y = max(abs(left + a * s + b * c) - size1[1] / 2, 0.0)
        least = min(least, x * x + y * y)
    return least


@device_function(forceinline=True)
def is_within(s: PairStates, i: int, j: int, distance: float, limit: float) -> bool:
    """Whether two boxes are at most a distance [m] apart, see the macro ``box_gap``; between centres it is larger."""
    if not distance <= limit + s.radius[i] + s.radius[j]:
        return False
    if distance <= limit:
        return True
    dx, dy = s.box_x[j] - s.box_x[i], s.box_y[j] - s.box_y[i]
    ahead, left = dx * s.heading_x[i] + dy * s.heading_y[i], dy * s.heading_x[i] - dx * s.heading_y[i]
    turn = wrap_angle(s.heading[j] - s.heading[i])
    c, n = cos(turn), sin(turn)
    size1, size2 = (s.length[i], s.width[i]), (s.length[j], s.width[j])
    behind, right = -ahead * c - left * n, ahead * n - left * c  # the first in the frame of the second
    apart = max(
        abs(ahead) - (size1[0] + abs(c) * size2[0] + abs(n) * size2[1]) / 2,
        abs(left) - (size1[1] + abs(n) * size2[0] + abs(c) * size2[1]) / 2,
        abs(behind) - (size2[0] + abs(c) * size1[0] + abs(n) * size1[1]) / 2,
        abs(right) - (size2[1] + abs(n) * size1[0] + abs(c) * size1[1]) / 2,
    )
    if apart <= 0:
        return True
    gap = min(corners_gap(ahead, left, c, n, size1, size2), corners_gap(behind, right, c, -n, size2, size1))
    return sqrt(gap) <= limit


@device_function
def link_kinds(links: LinkedLanes, lane: int, other: int) -> int:
    """What a lane is to another one: the sum of its kinds."""
    for at in range(links.offsets[lane], links.offsets[lane + 1]):
        if links.others[at] == other:
            return int(links.kinds[at])
    return 0


@device_function(forceinline=True)
def holds(relation: int, given: Array, s: PairStates, links: LinkedLanes, i: int, j: int) -> bool:
    """Whether a relation holds between the objects of two states of one timestep; as in ``sql/relations``."""
    if relation == COURSES:
        waits = s.speed[i] < 1 and s.speed[j] > 1 and s.walks[i]
        other_waits = not waits and s.speed[j] < 1 and s.speed[i] > 0.5 and s.walks[j]
        if not (waits or other_waits or (s.speed[i] >= 1 and s.speed[j] >= 1)):
            return False
        course = s.heading[i] if waits else s.course[i]
        angle = abs(wrap_angle(course - (s.heading[j] if other_waits else s.course[j])) * (180 / pi))
        return (given[0] <= angle <= given[1]) and (given[0] != 45 or 45 < angle < 135)
    dx, dy = s.box_x[j] - s.box_x[i], s.box_y[j] - s.box_y[i]
    distance = sqrt(dx * dx + dy * dy)
    if relation == NEAR:
        return is_within(s, i, j, distance, given[0])
    if relation != FOLLOWING and not distance <= given[0] + s.radius[i] + s.radius[j]:
        return False
    dx, dy = s.x[j] - s.box_x[i], s.y[j] - s.box_y[i]
    ahead, left = dx * s.heading_x[i] + dy * s.heading_y[i], dy * s.heading_x[i] - dx * s.heading_y[i]
    if relation == BESIDE:
        away, across = ahead * given[2] + left * given[3], left * given[2] - ahead * given[3]
        half, other = (s.width[i], s.length[i]) if given[2] == 0 else (s.length[i], s.width[i])
        is_beside = away > half / 2 and abs(across) < other / 2 + given[1]
        return is_beside and is_within(s, i, j, distance, given[0])
    if relation == FACING:
        is_ahead = given[1] >= pi / 2 or ahead > 0
        return is_ahead and abs(atan2(left, ahead)) <= given[1] and is_within(s, i, j, distance, given[0])
    if relation == TOWARD:
        vx, vy = s.vx[j] - s.vx[i], s.vy[j] - s.vy[i]
        closing = vx * s.heading_x[i] + vy * s.heading_y[i], vy * s.heading_x[i] - vx * s.heading_y[i]
        apart = sqrt(ahead * ahead + left * left)
        if not (apart > 0 and -(closing[0] * ahead + closing[1] * left) / apart >= given[2]):
            return False
        v_ahead = s.vx[i] * s.heading_x[i] + s.vy[i] * s.heading_y[i]
        v_left = s.vy[i] * s.heading_x[i] - s.vx[i] * s.heading_y[i]
        if given[1] < 90 and v_ahead * ahead + v_left * left < 0:  # angles take long
            return False
        angle = wrap_angle(atan2(v_left, v_ahead) - atan2(left, ahead)) * (180 / pi)
        return abs(angle) <= given[1] and is_within(s, i, j, distance, given[0])
    # FOLLOWING
    half = s.length[i] / 2
    if not (distance < 60 and ahead > half and ahead < 25 + half and abs(left) < 15 and s.lane[i] >= 0 <= s.lane[j]):
        return False
    course = s.course[i] if s.speed[i] > 0.5 else s.heading[i]
    other_course = s.course[j] if s.speed[j] > 0.5 else s.heading[j]
    kinds = link_kinds(links, s.lane[i], s.lane[j])
    nearest = min(abs(left + s.width[j] / 2), abs(left - s.width[j] / 2))
    is_behind = (s.lane[i] == s.lane[j] or kinds & EXIT != 0) and abs(left) < 5
    return cos(course - other_course) > 0.5 and (is_behind or (kinds & NEIGHBOUR != 0 and nearest <= s.width[i] / 2))


@device_function
def on_lanes(kinds: int, s: PairStates, links: LinkedLanes, rows: Array, held: Array) -> None:
    """Find the steps at which two objects are on lanes that have to do with each other in some ways, see CONTINUES."""
    lane, other, is_linked = -1, -1, False
    for at in range(len(rows)):
        i, j = rows[at]
        if s.lane[i] != lane or s.lane[j] != other:  # it takes long to look up, and lanes stay the same for long
            lane, other = s.lane[i], s.lane[j]
            is_linked = lane >= 0 and other >= 0 and (link_kinds(links, lane, other) & kinds) != 0
        held[at] = is_linked


@device_function
def crosses(given: Array, s: PairStates, rows: Array, held: Array) -> None:
    """Find the steps at which one object is crossed by another; see ``sql/relations/being_crossed_by.sql``.

    Args:
        given: forward_thresh, lateral_thresh, cosine and sine of the direction, and the side that counts; 0 for both.
        s: The states.
        rows: (N, 2) int64 those of the two objects at the steps at which both were observed.
        held: (N,) bool filled.
    """
    begun, running, is_crossing, comes_near, crossed, across = 0, 0.0, False, False, 0.0, np.nan
    for at in range(len(rows)):
        i, j = rows[at]
        dx, dy = s.x[j] - s.box_x[i], s.y[j] - s.box_y[i]
        ahead, left = dx * s.heading_x[i] + dy * s.heading_y[i], dy * s.heading_x[i] - dx * s.heading_y[i]
        away, before, across = ahead * given[2] + left * given[3], across, left * given[2] - ahead * given[3]
        v_left = s.vy[j] * s.heading_x[i] - s.vx[j] * s.heading_y[i]
        rate = v_left * given[2] - (s.vx[j] * s.heading_x[i] + s.vy[j] * s.heading_y[i]) * given[3]
        is_beyond = s.length[i] / 2 <= away <= s.length[i] / 2 + given[0]
        edge = s.width[i] / 2
        comes_near |= is_beyond and abs(across) < edge + 10
        is_moving = abs(rate) > 0.2
        side = np.sign(rate) if is_moving and np.sign(rate) * across < given[1] else 0.0
        has_passed = at > 0 and ((before < -edge) != (across < -edge) or (before > edge) != (across > edge))
        crossed = np.sign(across - before) if is_moving and is_beyond and has_passed else 0.0
        if at > 0 and running == crossed:  # which the last step of the run before sees, too
            is_crossing = True
        if at == 0 or side != running:
            held[begun:at] = running != 0 and is_crossing and (given[4] == 0 or running == given[4])
            begun, running, is_crossing = at, side, False
        is_crossing |= side == crossed
    held[begun:] = running != 0 and is_crossing and (given[4] == 0 or running == given[4])
    if not comes_near:
        held[:] = False


@device_function
def common_rows(s: PairStates, track: int, other: int, rows: Array) -> int:
    """Fill in the rows of two objects at the timesteps at which both were observed, and return how many they are."""
    i, end = s.tracks[track]
    j, other_end = s.tracks[other]
    later, both = s.timestep[j] - s.timestep[i], 0
    is_whole = s.timestep[end - 1] - s.timestep[i] == end - 1 - i
    if is_whole and s.timestep[other_end - 1] - s.timestep[j] == other_end - 1 - j:
        i, j = i + max(later, 0), j + max(-later, 0)
        both = max(min(end - i, other_end - j), 0)
        for at in range(both):
            rows[at, 0], rows[at, 1] = i + at, j + at
        return int(both)
    while i < end and j < other_end:
        if s.timestep[i] == s.timestep[j]:
            rows[both, 0], rows[both, 1] = i, j
            both += 1
        later = s.timestep[j] - s.timestep[i]
        i += later >= 0
        j += later <= 0
    return both


@kernel(divides_by_zero=True)
def find_spans(relation: int, given: Array, reach: float, s: PairStates, links: LinkedLanes) -> Array:
    """Find the uninterrupted spans of timesteps at which a relation holds.

    Args:
        relation: NEAR, BESIDE ...
        given: (5,) float64 its parameters.
        reach: Largest distance [m] of what the boxes of two objects reach at which it can hold.
        s: States of all objects.
        links: What lanes are to each other.

    Returns:
        (N, 4) int64 of numbers of the tracks, and the first and the last timestep.
    """
    found, count = np.empty((1024, 4), np.int64), 0
    rows = np.empty((s.timestep.max() + 1 if len(s.timestep) else 0, 2), np.int64)
    held = np.empty(len(rows), np.bool_)
    for scenario in range(len(s.scenarios) - 1):
        first_track, end = s.scenarios[scenario], s.scenarios[scenario + 1]
        for track in range(first_track, end):
            mine = s.bounds[track]
            for other in range(first_track, end):
                its = s.bounds[other]
                gap = max(max(mine[0] - its[1], its[0] - mine[1]), max(mine[2] - its[3], its[2] - mine[3]))
                if track == other or gap > reach:
                    continue
                both = common_rows(s, track, other, rows)
                if relation == CROSSED:
                    crosses(given, s, rows[:both], held[:both])
                elif relation == ON_LANES:
                    on_lanes(int(given[0]), s, links, rows[:both], held[:both])
                else:
                    for at in range(both):
                        held[at] = holds(relation, given, s, links, rows[at, 0], rows[at, 1])
                last = -2
                for at in range(both):
                    if held[at]:
                        timestep = s.timestep[rows[at, 0]]
                        if timestep != last + 1:
                            if count == len(found):
                                found = np.concatenate((found, np.empty_like(found)))
                            found[count] = np.array((track, other, timestep, timestep))
                            count += 1
                        last = timestep
                        found[count - 1, 3] = last
    return found[:count]
