"""Memory that arrays use again: never while another array, view or tensor refers to it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.arrays import memory as memory_module
from scenarionet_data.arrays.memory import Memory

LARGE = 5000


@given(sizes=st.lists(st.tuples(st.integers(1, 3 * LARGE), st.booleans()), max_size=30))
def test_arrays_in_use_keep_their_values(sizes):
    memory = Memory(limit=2**19)
    in_use = []
    for number, (size, is_dropped) in enumerate(sizes):
        array = memory.empty(size, np.int32)
        array[:] = number
        in_use.append((number, array[size // 2 :].reshape(1, -1)))
        if is_dropped:
            in_use.pop(len(in_use) // 2)
        del array
        assert all((values == label).all() for label, values in in_use)
        assert memory.num_bytes <= 2**19


def test_memory_is_used_again():
    memory = Memory()
    first = memory.empty((2, LARGE), np.float64)
    place = first.ctypes.data
    assert memory.empty((2, LARGE), np.float64).ctypes.data != place
    held = first.view(np.uint8)[:, ::3]
    del first
    assert memory.empty((2, LARGE), np.float64).ctypes.data != place
    del held
    before = memory.num_bytes
    again = {memory.empty((2, LARGE), np.float64).ctypes.data for _ in range(9)}
    assert place in again and memory.num_bytes == before


@pytest.mark.parametrize("shape", [(), 0, 3, (3, 0), (LARGE, 4)])
def test_zeros_are_zeros(shape):
    memory = Memory()
    used = memory.empty(shape, np.float32)
    used[...] = 7
    del used
    found = memory.zeros(shape, np.float32)
    assert found.shape == np.zeros(shape).shape and found.dtype == np.float32 and not found.any()


def test_blocks_of_other_sizes_make_room():
    memory = Memory(limit=2**16)
    for size in (2**14, 2**15, 2**16, 2**14):
        zeros = memory.zeros(size, np.uint8)
        assert memory.num_bytes <= 2**16 and not zeros.any()
        del zeros
    assert memory.num_bytes == 2**14
    held = [memory.empty(2**14, np.uint8) for _ in range(9)]
    assert memory.num_bytes == 2**16 and len({array.ctypes.data for array in held}) == 9


def test_many_arrays_are_made_of_the_same_memory():
    memory = Memory()
    for _ in range(3):
        arrays = [memory.empty(2**14, np.uint8) for _ in range(64)]
        assert len({array.ctypes.data for array in arrays}) == 64
        del arrays
    assert memory.num_bytes == 64 * 2**14


def test_room_is_found_some_time_after_arrays_were_dropped():
    memory = Memory(limit=2**16)
    in_use = [memory.empty(2**14, np.uint8) for _ in range(4)]
    refused = [memory.empty(2**15, np.uint8) for _ in range(2)]
    assert memory.num_bytes == 2**16 and len({array.ctypes.data for array in in_use + refused}) == 6
    del in_use
    for _ in range(4):
        memory.empty(2**15, np.uint8)
    assert memory.num_bytes == 2**15


def test_scratch_is_the_same_until_more_is_needed():
    memory = Memory()
    small = memory.scratch(100)
    assert memory.scratch(60) is small
    assert len(memory.scratch(LARGE)) >= LARGE


@pytest.mark.parametrize("miscounted", [0, 1, None], ids=["never in use", "always in use", "hot code"])
def test_memory_is_not_used_again_by_a_python_that_counts_otherwise(monkeypatch, miscounted):
    count, calls = memory_module._references, []

    def miscount(blocks, place):
        calls.append(place)
        if miscounted is None and len(calls) < 50:
            return count(blocks, place)
        return memory_module._UNUSED + (miscounted or 0)

    monkeypatch.setattr(memory_module, "_references", miscount)
    memory_module._tells_use.cache_clear()
    try:
        memory = Memory()
        arrays = [memory.empty(LARGE, np.float64) for _ in range(4)]
        for number, array in enumerate(arrays):
            array[:] = number
        assert [array[0] for array in arrays] == [0.0, 1.0, 2.0, 3.0]
        assert memory.num_bytes == 0
    finally:
        monkeypatch.undo()
        memory_module._tells_use.cache_clear()
    assert memory_module._tells_use()
