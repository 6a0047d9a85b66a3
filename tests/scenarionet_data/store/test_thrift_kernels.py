"""No bytes whatever lead compiled code out of them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.store import thrift_kernels as kernels


@given(header=st.binary(max_size=60))
def test_no_header_whatever_is_taken_for_a_page_it_is_not(header):
    start = kernels.read_header(np.frombuffer(header, np.uint8), 0)[0]
    assert start <= len(header)


@pytest.mark.parametrize("first", [b"\x15", b"\x06", b"\x18", b"\x1c\x08", b"\x19\xfc"])
@pytest.mark.parametrize("rest", [b"\xff" * 9 + b"\x01", b"\xff" * 20, b"\x80" * 9 + b"\x01\x15\x02"])
def test_numbers_of_64_bits_stay_within_the_file(first, rest):
    data = np.frombuffer(first + rest + b"\x00", np.uint8)
    assert kernels.read_header(data, 0)[0] <= len(data)
    assert kernels.struct_end(data, 0) <= len(data)
