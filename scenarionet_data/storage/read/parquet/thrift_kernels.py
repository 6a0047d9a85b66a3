"""Thrift's compact protocol in compiled code: a Parquet page's header, and where a struct ends.

Format: https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md
"""

from __future__ import annotations

from numba import njit

from scenarionet_data.arrays.dtypes import Array

UNKNOWN = -1
"""What is not what our writer makes."""

DATA_PAGE, DICTIONARY_PAGE = 0, 2

_BEYOND = 1 << 40
_STOP, _BINARY, _STRUCT = 0, 8, 12
_VARINTS = (4, 5, 6)
_NEXT_NUMBER, _DATA_HEADER, _DICTIONARY_HEADER = 0x15, 0x2C, 0x4C
"""Heads of fields: a number in the next one, and after the third field a struct in the fifth or the seventh."""


@njit(nogil=True)
def read_header(data: Array, at: int) -> tuple[int, int, int, int, int]:
    """A page's type, uncompressed and compressed size, values and encoding: what its header begins with.

    Args:
        data: (n,) uint8 the file.
        at: Where the header begins.

    Returns:
        All UNKNOWN when the header begins otherwise than those of dictionaries and data pages of version 1.
    """
    kind, at = _number(data, at)
    size, at = _number(data, at)
    stored_size, at = _number(data, at)
    inner = _DATA_HEADER if kind == DATA_PAGE else _DICTIONARY_HEADER
    if at < len(data) and data[at] == inner and kind in (DATA_PAGE, DICTIONARY_PAGE):
        num_values, at = _number(data, at + 1)
        encoding, at = _number(data, at)
        if at < len(data):
            return kind, size, stored_size, num_values, encoding
    return UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN


@njit(nogil=True)
def _number(data: Array, at: int) -> tuple[int, int]:
    """A number of 32 bits in the field after the last one, not negative; else the end of the data."""
    if at < len(data) and data[at] == _NEXT_NUMBER:
        value, at = count_at(data, at + 1)
        if value & 1 == 0:
            return value >> 1, at
    return UNKNOWN, len(data)


@njit(nogil=True)
def _varint(data: Array, at: int) -> tuple[int, int]:
    value, shift = 0, 0
    while at < len(data) and shift < 70:  # ten bytes hold 64 bits
        byte = int(data[at])
        at += 1
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            break
    return value, at


@njit(nogil=True)
def count_at(data: Array, at: int) -> tuple[int, int]:
    """A number of bytes or values; what no file can hold, or is negative, becomes a number beyond every end."""
    if at < len(data) and data[at] < 128:  # as most are
        return int(data[at]), at + 1
    value, at = _varint(data, at)
    return value if 0 <= value < _BEYOND else _BEYOND, at
