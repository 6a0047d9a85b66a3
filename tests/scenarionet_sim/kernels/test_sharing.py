"""Items shared out to threads: each is taken once, whatever the threads do."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data.arrays.compiled import kernel
from scenarionet_sim.kernels.sharing import ranges_of, take
from scenarionet_sim.threads import Threads


@kernel(nogil=True, allocates=False)
def take_all(ranges, own, taken):
    """Take items until none is left, and count how often each is taken; return the number."""
    count, item = 0, take(ranges, own)
    while item >= 0:
        taken[item] += 1
        count += 1
        item = take(ranges, own)
    return count


@pytest.mark.parametrize("total", [1, 7, 100_000])
def test_threads_take_every_item_once(total):
    threads, taken = Threads(3), np.zeros(total, np.int64)
    for turn in range(1, 4):
        counts = threads.share(lambda own, ranges: take_all(ranges, own, taken), total)
        assert sum(counts) == total
        np.testing.assert_array_equal(taken, turn)
    threads.close()


def test_a_thread_begins_with_its_own_range_and_takes_what_others_leave():
    ranges, taken = ranges_of(10, 3), np.zeros(10, np.int64)
    assert take_all(ranges, 1, taken) == 10
    np.testing.assert_array_equal(taken, 1)
    assert take_all(ranges, 0, taken) == 0

    @kernel(allocates=False)
    def take_one(ranges, own):
        return take(ranges, own)

    ranges = ranges_of(10, 3)
    assert [take_one(ranges, own) for own in (0, 1, 2, 0, 1, 1, 1)] == [0, 3, 6, 1, 4, 5, 7]
