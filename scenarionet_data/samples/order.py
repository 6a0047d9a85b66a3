"""The order of samples in an epoch, the same for any number of workers, and after a restart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Int64, is_count
from scenarionet_data.errors import BadParameter


@dataclass(frozen=True)
class Shuffling:
    """Shuffling that reads mostly neighbouring files: blocks of neighbours in random order, then within a buffer.

    Attributes:
        block: Number of samples that stay together in the first step.
        buffer: Number of consecutive samples that are shuffled among themselves in the second one.
        seed: Seed of the order.
    """

    block: int = 256
    buffer: int = 8192
    seed: int = 0

    def __post_init__(self) -> None:
        if not (is_count(self.block, 1) and is_count(self.buffer, 1)):
            raise BadParameter(f"block, buffer: expected at least 1 sample, found {self.block} and {self.buffer}")
        if not is_count(self.seed, 0):
            raise BadParameter(f"seed: expected a whole number of 0 or more, found {self.seed!r}")


def epoch_order(places: Int64, shuffling: Shuffling | None, epoch: int) -> Int64:
    """Numbers of all samples in the order of an epoch.

    Args:
        places: (n,) place on disk of each sample's scenario.
        shuffling: None for the order of the samples.
        epoch: Number of the epoch.
    """
    count = len(places)
    if shuffling is None:
        return np.arange(count)
    rng = np.random.default_rng([shuffling.seed, epoch])
    on_disk = np.argsort(places, kind="stable")
    starts = np.arange(0, count, shuffling.block)
    blocks = [on_disk[start : start + shuffling.block] for start in rng.permutation(starts).tolist()]
    order = np.concatenate(blocks) if blocks else on_disk
    for start in range(0, count, shuffling.buffer):
        rng.shuffle(order[start : start + shuffling.buffer])
    return order


def batches_of(order: Int64, size: int, rank: int, world_size: int, *, drop_last: bool) -> list[Int64]:
    """The batches of one rank: all ranks have equally many, so that none waits for another.

    Args:
        order: Numbers of all samples.
        size: Samples of a batch.
        rank, world_size: Number of this process among those that train together.
        drop_last: Leave out a last batch that is smaller than the others.
    """
    per_rank = len(order) // world_size
    own = order[rank : per_rank * world_size : world_size]
    found = [own[start : start + size] for start in range(0, len(own), size)]
    return found[:-1] if drop_last and found and len(found[-1]) < size else found
