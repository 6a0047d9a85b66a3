"""The compiled CRC-32 is that of zlib."""

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.storage.read.parquet import crc_kernels


@kernel
def crc32(data, start, end):
    """Make the device function callable from Python."""
    return crc_kernels.crc32(data, start, end)


@given(content=st.binary(max_size=300), start=st.integers(0, 20))
def test_is_that_of_zlib(content, start):
    start = min(start, len(content))
    assert crc32(np.frombuffer(content, np.uint8), start, len(content)) == zlib.crc32(content[start:])


@pytest.mark.parametrize("size", [15, 16, 31, 63, 64, 65, 79, 80, 127, 128, 129, 191, 192, 4096, 100_003])
def test_blocks_and_rest(size):
    content = np.random.default_rng(size).integers(256, size=size).astype(np.uint8)
    assert crc32(content, 0, size) == zlib.crc32(content)
