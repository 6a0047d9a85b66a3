"""Compiled derivatives and medians of positions, for ``track_motion``."""

from __future__ import annotations

from math import floor, inf, pi

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import device_function, kernel


@device_function(forceinline=True)
def in_order(a: float, b: float, c: float) -> tuple[float, float, float]:
    """Sort three numbers."""
    low, high = min(a, b), max(a, b)
    return min(low, c), max(low, min(high, c)), max(high, c)


@device_function
def median_around(values: Array, at: int, first: int, last: int) -> float:
    """Return the median of a value, the three before and the three after it, the outermost of a part repeated.

    Of two sorted triples, the k-th number is the least, over i + j = k, of the greater one of the i-th of one and the
    j-th of the other; the median lies between the third and the fourth.
    """
    a, b, c = in_order(values[max(at - 3, first)], values[max(at - 2, first)], values[max(at - 1, first)])
    d, e, f = in_order(values[min(at + 1, last)], values[min(at + 2, last)], values[min(at + 3, last)])
    third = min(min(c, f), min(max(a, e), max(b, d)))
    fourth = min(max(a, f), min(max(c, d), max(b, e)))
    median: float = max(third, min(values[at], fourth))
    return median


@kernel(allocates=False)
def smooth(ends: Array, seconds: Array, recorded: Array, rates: Array, smoothed: Array) -> None:
    """Derive velocities and accelerations of N objects from their positions, and smooth all of them.

    Args:
        ends: (N + 1,) int64 where the observations of each object begin.
        seconds: (S,) float64 their times [s].
        recorded: (4, S) float64 x, y, z and heading [m, rad].
        rates: (3, S) float64 filled with velocities along x and y, not smoothed, and yaw rates [m/s, rad/s].
        smoothed: (7, S) float64 filled with medians of seven of x, y, their first and their second derivatives, and z.
    """
    for track in range(len(ends) - 1):
        first, last = ends[track], ends[track + 1] - 1
        for axis in range(2):
            for at in range(first, last + 1):
                before, after = max(at - 1, first), min(at + 1, last)
                between = seconds[after] - seconds[before] if seconds[after] != seconds[before] else inf
                rates[axis, at] = (recorded[axis, after] - recorded[axis, before]) / between
            for at in range(first, last + 1):
                before, after = max(at - 1, first), min(at + 1, last)
                between = seconds[after] - seconds[before] if seconds[after] != seconds[before] else inf
                smoothed[6, at] = (rates[axis, after] - rates[axis, before]) / between
            for at in range(first, last + 1):
                smoothed[axis, at] = median_around(recorded[axis], at, first, last)
                smoothed[2 + axis, at] = median_around(rates[axis], at, first, last)
                smoothed[4 + axis, at] = median_around(smoothed[6], at, first, last)
        for at in range(first, last + 1):
            before, after = max(at - 1, first), min(at + 1, last)
            between = seconds[after] - seconds[before] if seconds[after] != seconds[before] else inf
            turned = recorded[3, after] - recorded[3, before]
            rates[2, at] = (turned - 2 * pi * floor((turned + pi) / (2 * pi))) / between
            smoothed[6, at] = median_around(recorded[2], at, first, last)


@kernel(allocates=False)
def mark_turns(ends: Array, seconds: Array, yaw_rate: Array, sides: Array) -> None:
    """Mark the observations of N objects at which they turn; see the view ``turning_steps``.

    Args:
        ends: (N + 1,) int64 where the observations of each object begin.
        seconds, yaw_rate: (S,) float64 [s, rad/s].
        sides: (S,) uint8 filled with 1 for left, 2 for right, 3 where one turn ends and the other begins, else 0.
    """
    sides[:] = 0
    for track in range(len(ends) - 1):
        first, end = ends[track], ends[track + 1]
        step = seconds[first + 1] - seconds[first] if end - first > 1 else 0.0
        start = first
        while start < end:
            stop, sign = start + 1, np.sign(yaw_rate[start])
            while stop < end and sign != 0 and np.sign(yaw_rate[stop]) == sign:
                stop += 1
            last = min(stop, end - 1)  # the first observation of the next run, at which the turn ends
            total, leftmost, rightmost = 0.0, 0.0, 0.0  # the two of the first and the last observation of the object
            for at in range(start, last + 1):
                rate = yaw_rate[at] * (180 / pi)
                total += rate
                if at == first or at == end - 1:
                    leftmost, rightmost = max(leftmost, rate), min(rightmost, rate)
            turned, mean = total * step, total / (last + 1 - start)
            is_left = turned > 45 or (turned > 15 and mean > 5 and leftmost > 5)
            is_right = turned < -45 or (turned < -15 and mean < -5 and rightmost < -5)
            if is_left or is_right:
                for at in range(start, last + 1):
                    sides[at] |= 1 if is_left else 2
            start = stop
