"""What is done to drawn pictures, one number at a time: smaller pictures, and noise."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.arrays.minmax import larger, smaller


@device_function(divides_by_zero=True)
def root_mean_square(picture: UInt8, row: int, column: int, channel: int, factor: int) -> int:
    """Return the mean of a square of pixels of a picture (H, W, 3), with roughly linear light."""
    total = 0
    for y in range(row, row + factor):
        for x in range(column, column + factor):
            level = int(picture[y, x, channel])
            total += level * level
    return round(math.sqrt(total / (factor * factor)))


@kernel
def shrink(fine: UInt8, factor: int, pictures: UInt8) -> None:
    """Write pictures (B, H, W, 3) as the means of squares of pixels of finer ones."""
    for k in range(len(pictures)):
        for row in range(pictures.shape[1]):
            for column in range(pictures.shape[2]):
                for channel in range(3):
                    if factor == 2:  # known to the compiler, which takes a third of the time
                        level = root_mean_square(fine[k], row * 2, column * 2, channel, 2)
                    else:
                        level = root_mean_square(fine[k], row * factor, column * factor, channel, factor)
                    pictures[k, row, column, channel] = level


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
