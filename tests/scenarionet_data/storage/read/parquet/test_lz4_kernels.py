"""LZ4 blocks are decompressed as by Arrow; damaged ones never reach beyond their page."""

import numpy as np
import pyarrow as pa
from hypothesis import example, given
from hypothesis import strategies as st

from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.storage.read.parquet import lz4_kernels

GUARD = 8


@kernel
def decompress(block, start, end, target, first, stop):
    return lz4_kernels.decompress(block, start, end, target, first, stop)


def decompressed(block, size):
    """Decompress into the middle of an array; the bytes, or None if it is damaged."""
    data, target = np.frombuffer(block, np.uint8), np.full(size + 2 * GUARD, 7, np.uint8)
    is_complete = decompress(data, 0, len(data), target, GUARD, GUARD + size)
    assert (target[:GUARD] == 7).all()
    assert (target[GUARD + size :] == 7).all()
    return target[GUARD : GUARD + size].tobytes() if is_complete else None


def compressed(content):
    return pa.Codec("lz4_raw").compress(content, asbytes=True)


PERIODS = st.tuples(st.binary(min_size=1, max_size=20), st.integers(1, 80))
CONTENT = st.lists(PERIODS, max_size=30).map(lambda parts: b"".join(part * count for part, count in parts))


@given(content=CONTENT)
@example(content=b"".join(bytes(range(period)) * 30 for period in range(1, 24)))
def test_decompresses_what_arrow_compresses(content):
    assert decompressed(compressed(content), len(content)) == content


@given(content=CONTENT, other=st.integers(-70, 70).filter(bool))
def test_blocks_of_another_size_are_damaged(content, other):
    size = max(len(content) + other, 0)
    assert size == len(content) or decompressed(compressed(content), size) is None


@given(block=st.binary(max_size=80), size=st.integers(0, 200))
def test_arbitrary_blocks_stay_in_their_page(block, size):
    decompressed(block, size)


@given(content=CONTENT, changes=st.lists(st.tuples(st.integers(0, 2000), st.integers(0, 255)), min_size=1, max_size=4))
def test_damaged_blocks_stay_in_their_page(content, changes):
    block = bytearray(compressed(content))
    for place, byte in changes:
        if block:
            block[place % len(block)] = byte
    decompressed(bytes(block), len(content))
