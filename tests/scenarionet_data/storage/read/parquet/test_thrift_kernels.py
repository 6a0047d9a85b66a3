"""No bytes whatever lead compiled code out of them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.storage.read.parquet import thrift
from scenarionet_data.storage.read.parquet import thrift_kernels as kernels


@given(header=st.binary(max_size=60))
def test_no_header_whatever_is_taken_for_a_page_it_is_not(header):
    kind, *others = kernels.read_header(np.frombuffer(header, np.uint8), 0)
    assert kind in (kernels.UNKNOWN, kernels.DATA_PAGE, kernels.DICTIONARY_PAGE)
    assert [value == kernels.UNKNOWN for value in others] == [kind == kernels.UNKNOWN] * 4
    assert kind == kernels.UNKNOWN or min(others) >= 0


@given(numbers=st.lists(st.integers(0, 2**31 - 1), min_size=4, max_size=4), is_dictionary=st.booleans())
def test_reads_what_a_header_begins_with(numbers, is_dictionary):
    size, stored_size, values, encoding = ((thrift.I32, number) for number in numbers)
    kind = kernels.DICTIONARY_PAGE if is_dictionary else kernels.DATA_PAGE
    own = (thrift.STRUCT, {1: values, 2: encoding, 3: (thrift.I32, 3)})
    header = thrift.encode({1: (thrift.I32, kind), 2: size, 3: stored_size, 7 if is_dictionary else 5: own})
    assert kernels.read_header(np.frombuffer(header, np.uint8), 0) == (kind, *numbers)
    cut = np.frombuffer(header[: len(header) - 5], np.uint8)  # before the encoding's end
    assert kernels.read_header(cut, 0)[0] == kernels.UNKNOWN


@pytest.mark.parametrize("first", [b"\x15", b"\x06", b"\x18", b"\x1c\x08", b"\x19\xfc"])
@pytest.mark.parametrize("rest", [b"\xff" * 9 + b"\x01", b"\xff" * 20, b"\x80" * 9 + b"\x01\x15\x02"])
def test_numbers_of_64_bits_stay_within_the_file(first, rest):
    data = np.frombuffer(first + rest + b"\x00", np.uint8)
    assert kernels.read_header(data, 0)[0] == kernels.UNKNOWN
    assert kernels.struct_end(data, 0) <= len(data)
