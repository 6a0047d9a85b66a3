"""Parsing arbitrary bytes as page headers never reads out of bounds."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.storage.read.parquet import thrift_kernels as kernels


@kernel
def read_header(data, at):
    """Make the device function callable from Python."""
    return kernels.read_header(data, at)


def varint(value, is_zigzag=False):
    """Encode a non-negative number as a zigzag varint of Thrift's compact protocol."""
    value, parts = value if is_zigzag else value << 1, []
    while value > 127:
        parts.append(value & 127 | 128)
        value >>= 7
    return bytes([*parts, value])


def header_of(kind, numbers, checksum=None):
    """Encode a page header: type, sizes, checksum, and a struct with the number of values and the encoding."""
    size, stored_size, values, encoding = (b"\x15" + varint(number) for number in numbers)
    struct = 0x4C if kind == kernels.DICTIONARY_PAGE else 0x2C  # field 7 (or 5) follows field 3
    crc = b""
    if checksum is not None:
        signed = checksum - (checksum >> 31 << 32)
        crc, struct = b"\x15" + varint(signed << 1 ^ signed >> 63, is_zigzag=True), struct - 0x10
    inner = bytes([struct]) + values + encoding
    return b"\x15" + varint(kind) + size + stored_size + crc + inner + b"\x15\x06\x00\x00"


@given(header=st.binary(max_size=60))
def test_arbitrary_bytes_are_rejected(header):
    kind, *others = read_header(np.frombuffer(header, np.uint8), 0)
    assert kind in (kernels.UNKNOWN, kernels.DATA_PAGE, kernels.DICTIONARY_PAGE)
    assert [value == kernels.UNKNOWN for value in others] == [kind == kernels.UNKNOWN] * 4
    assert kind == kernels.UNKNOWN or min(others) >= 0


@given(
    numbers=st.lists(st.integers(0, 2**31 - 1), min_size=4, max_size=4),
    checksum=st.none() | st.integers(0, 2**32 - 1),
    is_dictionary=st.booleans(),
)
def test_required_header_fields_are_read(numbers, checksum, is_dictionary):
    kind = kernels.DICTIONARY_PAGE if is_dictionary else kernels.DATA_PAGE
    header = header_of(kind, numbers, checksum)
    assert read_header(np.frombuffer(header, np.uint8), 0) == (kind, *numbers)
    cut = np.frombuffer(header[: len(header) - 5], np.uint8)  # truncated before the encoding
    assert read_header(cut, 0)[0] == kernels.UNKNOWN


@pytest.mark.parametrize("first", [b"\x15", b"\x06", b"\x18", b"\x1c\x08", b"\x19\xfc"])
@pytest.mark.parametrize("rest", [b"\xff" * 9 + b"\x01", b"\xff" * 20, b"\x80" * 9 + b"\x01\x15\x02"])
def test_sizes_of_64_bits_are_bounded_by_file_size(first, rest):
    data = np.frombuffer(first + rest + b"\x00", np.uint8)
    assert read_header(data, 0)[0] == kernels.UNKNOWN


@pytest.mark.parametrize("field", range(5))
def test_fields_of_other_types_are_rejected(field):
    header = bytearray(header_of(kernels.DATA_PAGE, (40, 30, 10, 2)))
    places = [place for place, byte in enumerate(header) if byte == 0x15]
    assert len(places) == 6 and read_header(np.frombuffer(header, np.uint8), 0) == (0, 40, 30, 10, 2)
    header[places[field]] = 0x16  # a number of 64 bits
    assert read_header(np.frombuffer(header, np.uint8), 0)[0] == kernels.UNKNOWN
