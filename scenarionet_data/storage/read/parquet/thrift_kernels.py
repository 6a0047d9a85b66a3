"""Compiled reader of Parquet page headers, in Thrift's compact protocol.

Format: https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md
"""

from __future__ import annotations

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import device_function

UNKNOWN = -1
"""Result for bytes that differ from what our writer produces."""

DATA_PAGE, DICTIONARY_PAGE = 0, 2

_BEYOND = 1 << 40
_NEXT_NUMBER, _DATA_HEADER, _DICTIONARY_HEADER = 0x15, 0x2C, 0x4C
"""Field headers: a number in the next field; after the third field a struct in the fifth or seventh."""
_ONE_FIELD = 0x10
"""Less in a field header when the field before it is the fourth, the checksum."""


@device_function
def read_header(data: Array, at: int) -> tuple[int, int, int, int, int]:
    """Read the first fields of a page header: type, both sizes, number of values, encoding.

    Args:
        data: (n,) uint8 bytes of the file.
        at: Start of the header.

    Returns:
        UNKNOWN in all fields unless it is the header of a dictionary or a data page of version 1.
    """
    kind, at = _number(data, at)
    size, at = _number(data, at)
    stored_size, at = _number(data, at)
    inner = _DATA_HEADER if kind == DATA_PAGE else _DICTIONARY_HEADER
    if at < len(data) and data[at] == _NEXT_NUMBER:  # a checksum
        _, at = _varint(data, at + 1)
        inner -= _ONE_FIELD
    if at < len(data) and data[at] == inner and kind in (DATA_PAGE, DICTIONARY_PAGE):
        num_values, at = _number(data, at + 1)
        encoding, at = _number(data, at)
        if at < len(data):
            return kind, size, stored_size, num_values, encoding
    return UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN


@device_function
def _number(data: Array, at: int) -> tuple[int, int]:
    """Read a non-negative 32-bit number from the next field; if it is none, moves to the end of the data."""
    if at < len(data) and data[at] == _NEXT_NUMBER:
        value, at = count_at(data, at + 1)
        if value & 1 == 0:
            return value >> 1, at
    return UNKNOWN, len(data)


@device_function
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


@device_function
def count_at(data: Array, at: int) -> tuple[int, int]:
    """Read a number of bytes or values; negative and implausibly large ones become a number beyond any end."""
    if at < len(data) and data[at] < 128:  # the common case
        return int(data[at]), at + 1
    value, at = _varint(data, at)
    return value if 0 <= value < _BEYOND else _BEYOND, at
