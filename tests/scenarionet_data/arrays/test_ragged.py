"""Ragged arrays: lists of different lengths in two flat arrays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.arrays.ragged import Ragged

words = st.lists(st.lists(st.text("abé", max_size=3), max_size=4), max_size=5)


@given(words)
def test_ids_round_trip(lists):
    ragged = Ragged.from_ids(lists)
    assert [list(ids) for ids in ragged] == lists
    assert ragged.lengths.tolist() == [len(ids) for ids in lists]
    assert ragged.offsets.dtype == np.int32
    assert ragged.values.dtype == object
    assert ragged.is_equal(Ragged.from_ids(lists))


@given(st.lists(st.integers(0, 4), max_size=5))
def test_points_round_trip(lengths):
    lists = [np.arange(3 * n, dtype=np.float64).reshape(n, 3) for n in lengths]
    ragged = Ragged.from_lists(lists, width=3)
    assert len(ragged) == len(lists)
    for index, points in enumerate(lists):
        assert ragged[index].dtype == np.float32
        assert np.array_equal(ragged[index], points)
        assert np.array_equal(ragged[index - len(lists)], points)


def test_index_beyond_the_end_is_refused():
    ragged = Ragged.empty(2, width=3)
    for index in (2, -3):
        with pytest.raises(IndexError, match="of 2"):
            ragged[index]


def test_equality_is_bitwise():
    ragged = Ragged.from_lists([[[0, 0, 0]], []], width=3)
    assert not ragged.is_equal(Ragged.from_lists([[], [[0, 0, 0]]], width=3))
    assert not ragged.is_equal(Ragged.from_lists([[[0, 0, 1]], []], width=3))
    assert not ragged.is_equal(Ragged(ragged.offsets, ragged.values.astype(np.float64)))
    assert Ragged.empty(3).values.dtype == object
