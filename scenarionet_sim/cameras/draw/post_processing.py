"""What is done to drawn pictures, one number at a time: smaller pictures, and noise."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Int32, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.minmax import larger, smaller
from scenarionet_sim.cameras.draw.single_precision import single, single_of


@device_function(divides_by_zero=True)
def root_mean_square(picture: UInt8, row: int, column: int, channel: int, factor: int) -> int:
    """Return the mean of a square of pixels of a picture (H, W, 3), with roughly linear light."""
    total = 0
    for y in range(row, row + factor):
        for x in range(column, column + factor):
            level = int(picture[y, x, channel])
            total += level * level
    return round(math.sqrt(total / (factor * factor)))


@kernel(allocates=False, divides_by_zero=True, is_wide=True)
def shrink(fine: UInt8, factor: int, sums: Int32, pictures: UInt8) -> None:
    """Write pictures (B, H, W, 3) as the means of squares of pixels of finer ones.

    Args:
        fine: (B, H * factor, W * factor * 3) the finer pictures.
        factor: Pixels along a side of a square.
        sums: (W * factor * 3,) memory.
        pictures: (B, H, W * 3) output.
    """
    for k in range(len(pictures)):
        for row in range(pictures.shape[1]):
            sums[:] = 0
            for line in range(row * factor, row * factor + factor):
                _add_squares(fine[k, line], sums)
            if factor == 2:  # known to the compiler
                _take_roots(sums, 2, pictures[k, row])
            else:
                _take_roots(sums, factor, pictures[k, row])


@device_function(divides_by_zero=True, in_lanes=True)
def _add_squares(levels: UInt8, sums: Int32) -> None:
    for k in range(len(sums)):
        level = np.int32(levels[k])
        sums[k] += level * level


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _take_roots(sums: Int32, factor: int, levels: UInt8) -> None:
    """Write the levels of a row of pixels from squares that are added down the columns of the finer picture."""
    for column in range(len(levels) // 3):
        first = 3 * factor * column
        levels[3 * column] = _root_of_mean(sums, first, factor)
        levels[3 * column + 1] = _root_of_mean(sums, first + 1, factor)
        levels[3 * column + 2] = _root_of_mean(sums, first + 2, factor)


@device_function(forceinline=True, divides_by_zero=True, in_lanes=True)
def _root_of_mean(sums: Int32, first: int, factor: int) -> int:
    total = 0
    for place in range(factor):
        total += sums[first + 3 * place]
    return np.int32(np.rint(math.sqrt(single_of(total) * single(1.0 / (factor * factor)))))  # type: ignore[return-value]


@device_function(divides_by_zero=True)
def noisy_level(level: int, spread: float, seed: int, number: int) -> int:
    """Return a level with Gaussian noise of a standard deviation, a function of seed and number.

    Uniform numbers by SplitMix64 (Steele, Lea, Flood: Fast splittable pseudorandom number generators, 2014), normal
    ones by the method of Box and Muller.
    """
    first = _uniform(np.uint64(seed) ^ np.uint64(2 * number))
    second = _uniform(np.uint64(seed) ^ np.uint64(2 * number + 1))
    normal = math.sqrt(-2.0 * math.log(first)) * math.cos(2.0 * math.pi * second)
    return round(smaller(larger(level + spread * normal, 0.0), 255.0))


@device_function(divides_by_zero=True)
def _uniform(state: np.uint64) -> float:
    """Return a number above 0 and up to 1."""
    mixed = state * np.uint64(0x9E3779B97F4A7C15)
    mixed = (mixed ^ (mixed >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    mixed = mixed ^ (mixed >> np.uint64(31))
    return float((mixed >> np.uint64(11)) + np.uint64(1)) * (1.0 / 9007199254740992.0)
