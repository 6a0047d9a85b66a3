"""Compiled search for the lanes on which objects are: millions of positions in outlines of forty corners."""

from __future__ import annotations

from math import inf, sqrt
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
    inside = False
    for corner in range(len(xs)):
        following = corner + 1 if corner + 1 < len(xs) else 0
        if (ys[corner] > py) != (ys[following] > py):
            share = (py - ys[corner]) * (xs[following] - xs[corner]) / (ys[following] - ys[corner])
            inside ^= px < xs[corner] + share
    return inside


@device_function
def _aside(px: float, py: float, xs: Array, ys: Array) -> float:
    """How far a point is to the left of the nearest segment of a line [m]."""
    nearest, aside = inf, 0.0
    for start in range(len(xs) - 1):
        dx, dy, x, y = xs[start + 1] - xs[start], ys[start + 1] - ys[start], px - xs[start], py - ys[start]
        squared = dx * dx + dy * dy
        share = min(max((x * dx + y * dy) / squared, 0.0), 1.0) if squared > 0 else 0.0
        gap = sqrt((x - share * dx) ** 2 + (y - share * dy) ** 2)
        left = (dx * y - dy * x) / max(sqrt(squared), 1e-9)
        if gap < nearest or (gap == nearest and left < aside):
            nearest, aside = gap, left
    return aside


@kernel
def choose_lanes(steps: PlacedSteps, lanes: NearLanes, chosen: Array, aside: Array) -> None:
    """Find the lane that each object is on at each step; see the view ``object_lanes``.

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
