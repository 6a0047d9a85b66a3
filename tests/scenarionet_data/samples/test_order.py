"""Each sample once an epoch; ranks share them; the order depends on seed and epoch only."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.samples.order import Shuffling, batches_of, epoch_order

COUNTS = st.integers(0, 300)


@given(COUNTS, st.integers(1, 40), st.integers(1, 90), st.integers(0, 3))
def test_an_epoch_has_each_sample_once(count, block, buffer, epoch):
    places = np.random.default_rng(count).integers(0, 50, count)
    order = epoch_order(places, Shuffling(block, buffer), epoch)
    assert sorted(order) == list(range(count))
    np.testing.assert_array_equal(order, epoch_order(places, Shuffling(block, buffer), epoch))


@given(COUNTS, st.integers(1, 40), st.integers(1, 5), st.booleans())
def test_ranks_have_equally_many_batches_without_a_common_sample(count, size, ranks, drop_last):
    order = np.random.default_rng(1).permutation(count)
    parts = [batches_of(order, size, rank, ranks, drop_last=drop_last) for rank in range(ranks)]
    assert len({tuple(map(len, part)) for part in parts}) == 1
    seen = [number for part in parts for batch in part for number in batch]
    assert len(seen) == len(set(seen))
    assert drop_last or count - len(seen) < ranks


def test_other_epochs_have_other_orders_of_neighbouring_blocks():
    places = np.arange(1000) // 4
    first, second = (epoch_order(places, Shuffling(50, 200), epoch) for epoch in (0, 1))
    assert not np.array_equal(first, second)
    assert len(set(places[first[:200]] // 12)) < 30  # of 84: blocks stay together
