"""Compiled search for the lanes on which objects are: millions of positions in outlines of forty corners."""

from __future__ import annotations

from math import cos, inf, sin, sqrt
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import device_function, kernel

_STRAIGHT_ON = 0.15
"""Largest mean yaw rate [rad/s] of what goes straight on."""


class PlacedSteps(NamedTuple):
    """Positions of N objects, one after the other.

    Attributes:
        offsets: (N + 1,) int64 where each begins.
        x, y: (S,) float64 [m].
        yaw_rate: (S,) float64 [rad/s].
    """

    offsets: Array
    x: Array
    y: Array
    yaw_rate: Array


class NearLanes(NamedTuple):
    """The lanes near each of N objects, best names first, with outlines and centrelines.

    Attributes:
        offsets: (N + 1,) int64 where those of each object begin.
        turns: (L,) int64 1 for a lane that turns left, -1 to the right.
        in_intersection: (L,) int64 1 or 0, or -1 where the map does not say.
        outline: (L + 1,) int64 where the corners of each begin.
        xs, ys: (P,) float64 [m].
        line: (L + 1,) int64 where the points of its centreline begin.
        line_xs, line_ys: (Q,) float64 [m].
    """

    offsets: Array
    turns: Array
    in_intersection: Array
    outline: Array
    xs: Array
    ys: Array
    line: Array
    line_xs: Array
    line_ys: Array


@device_function
def _is_inside(px: float, py: float, xs: Array, ys: Array) -> bool:
    """Whether a point is in a polygon, by the even-odd rule."""
    inside, last = False, len(xs) - 1
    is_above = len(xs) > 0 and ys[last] > py
    for corner in range(len(xs)):
        was_above, is_above = is_above, ys[corner] > py
        if was_above != is_above:
            share = (py - ys[last]) * (xs[corner] - xs[last]) / (ys[corner] - ys[last])
            inside ^= px < xs[last] + share
        last = corner
    return inside


@device_function
def _aside(px: float, py: float, xs: Array, ys: Array) -> float:
    """How far a point is to the left of the nearest segment of a line [m]."""
    nearest, aside, bound = inf, 0.0, inf
    for start in range(len(xs) - 1):
        dx, dy, x, y = xs[start + 1] - xs[start], ys[start + 1] - ys[start], px - xs[start], py - ys[start]
        squared = dx * dx + dy * dy
        share = min(max((x * dx + y * dy) / squared, 0.0), 1.0) if squared > 0 else 0.0
        apart = (x - share * dx) ** 2 + (y - share * dy) ** 2
        if apart > bound:  # roots are dear
            continue
        gap, left = sqrt(apart), (dx * y - dy * x) / max(sqrt(squared), 1e-9)
        if gap < nearest or (gap == nearest and left < aside):
            nearest, aside, bound = gap, left, apart * (1 + 1e-12)
    return aside


@kernel
def choose_lanes(steps: PlacedSteps, lanes: NearLanes, chosen: Array, aside: Array) -> None:
    """Find the lane that each object is on at each step; see the view ``walked_lanes``.

    Args:
        steps: Positions of N objects.
        lanes: The lanes near them.
        chosen: (S,) int64 filled with the number of the lane among those near the object, from 0; -1 for none.
        aside: (S,) float64 filled with how far it is to the left of the lane's centreline [m].
    """
    for track in range(len(steps.offsets) - 1):
        start, stop = steps.offsets[track], steps.offsets[track + 1]
        first, last = lanes.offsets[track], lanes.offsets[track + 1]
        is_held = np.zeros((last - first, stop - start), np.bool_)
        held = np.zeros(last - first, np.int64)
        fits = np.zeros(last - first, np.int64)
        for near in range(last - first):
            lane = first + near
            xs = lanes.xs[lanes.outline[lane] : lanes.outline[lane + 1]]
            ys = lanes.ys[lanes.outline[lane] : lanes.outline[lane + 1]]
            left, right, low, high = xs.min(), xs.max(), ys.min(), ys.max()
            turned = 0.0
            for step in range(start, stop):
                px, py = steps.x[step], steps.y[step]
                if left <= px <= right and low <= py <= high and _is_inside(px, py, xs, ys):
                    is_held[near, step - start] = True
                    held[near] += 1
                    turned += steps.yaw_rate[step]
            if held[near]:
                rate = turned / held[near]
                side = 0 if abs(rate) <= _STRAIGHT_ON else 1 if rate > 0 else -1
                fits[near] = lanes.in_intersection[lane] if lanes.turns[lane] == side else 0
        while True:
            best = 0
            for near in range(last - first):
                if (held[near], fits[near]) > (held[best], fits[best]):
                    best = near
            if last == first or held[best] == 0:
                break
            lane = first + best
            line = slice(lanes.line[lane], lanes.line[lane + 1])
            for step in range(start, stop):
                if is_held[best, step - start]:
                    chosen[step] = best
                    aside[step] = _aside(steps.x[step], steps.y[step], lanes.line_xs[line], lanes.line_ys[line])
                    for near in range(last - first):
                        held[near] -= is_held[near, step - start]
                        is_held[near, step - start] = False


class BoxSteps(NamedTuple):
    """Boxes of N objects at S steps, one object after the other.

    Attributes:
        offsets: (N + 1,) int64 where each begins.
        x, y, heading, length, width: (S,) float64 centre, direction and size, 0 for points [m, rad].
    """

    offsets: Array
    x: Array
    y: Array
    heading: Array
    length: Array
    width: Array


class Outlines(NamedTuple):
    """Polygons near each of N objects.

    Attributes:
        offsets: (N + 1,) int64 where those of each object begin.
        outline: (L + 1,) int64 where the corners of each begin.
        xs, ys: (P,) float64 [m].
    """

    offsets: Array
    outline: Array
    xs: Array
    ys: Array


@device_function
def gap_to_outline(x: float, y: float, xs: Array, ys: Array) -> float:
    """Distance from a point to the line around a polygon [m]."""
    least = inf
    for start in range(len(xs)):
        end = start + 1 if start + 1 < len(xs) else 0
        dx, dy, ahead, left = xs[end] - xs[start], ys[end] - ys[start], x - xs[start], y - ys[start]
        squared = dx * dx + dy * dy
        share = min(max((ahead * dx + left * dy) / squared, 0.0), 1.0) if squared > 0 else 0.0
        least = min(least, (ahead - share * dx) ** 2 + (left - share * dy) ** 2)
    return sqrt(least)


@kernel
def measure_gaps(steps: BoxSteps, outlines: Outlines, reach: float, gaps: Array) -> None:
    """Measure how far each box is from the nearest outline at each step.

    Args:
        steps: Boxes of N objects.
        outlines: The outlines near them.
        reach: Outlines that are certainly further away [m] are left out.
        gaps: (S,) float64 filled with distances [m], 0 where they touch; infinite without outlines.
    """
    gaps[:] = inf
    ahead, left = np.empty(len(outlines.xs)), np.empty(len(outlines.xs))
    for track in range(len(steps.offsets) - 1):
        for near in range(outlines.offsets[track], outlines.offsets[track + 1]):
            corners = slice(outlines.outline[near], outlines.outline[near + 1])
            xs, ys = outlines.xs[corners], outlines.ys[corners]
            low_x, high_x, low_y, high_y = xs.min(), xs.max(), ys.min(), ys.max()
            for step in range(steps.offsets[track], steps.offsets[track + 1]):
                x, y, half_length, half_width = (
                    steps.x[step],
                    steps.y[step],
                    steps.length[step] / 2,
                    steps.width[step] / 2,
                )
                away = max(max(low_x - x, x - high_x), max(low_y - y, y - high_y)) - half_length - half_width
                if away > reach or away >= gaps[step]:
                    continue
                c, s = cos(steps.heading[step]), sin(steps.heading[step])
                for corner in range(len(xs)):  # in the frame of the box
                    dx, dy = xs[corner] - x, ys[corner] - y
                    ahead[corner], left[corner] = dx * c + dy * s, dy * c - dx * s
                aheads, lefts = ahead[: len(xs)], left[: len(xs)]
                if _is_inside(0.0, 0.0, aheads, lefts):
                    gaps[step] = 0.0
                    continue
                gap = inf
                for side_x, side_y in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                    corner_x, corner_y = side_x * half_length, side_y * half_width
                    if _is_inside(corner_x, corner_y, aheads, lefts):
                        gap = 0.0
                    else:
                        gap = min(gap, gap_to_outline(corner_x, corner_y, aheads, lefts))
                    if half_length == 0 and half_width == 0:
                        break
                for corner in range(len(xs)):
                    beyond = max(abs(aheads[corner]) - half_length, 0.0), max(abs(lefts[corner]) - half_width, 0.0)
                    gap = min(gap, sqrt(beyond[0] ** 2 + beyond[1] ** 2))
                gaps[step] = min(gaps[step], gap)
