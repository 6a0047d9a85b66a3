"""Thrift's compact protocol in compiled code: a Parquet page's header, and where a struct ends.

Format: https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md
"""

from __future__ import annotations

import numpy as np
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


@njit(cache=True)
def struct_end(data: Array, at: int) -> int:
    """Where a struct of Thrift's compact protocol ends: nothing in it is kept.

    Args:
        data: (n,) uint8.
        at: Where it begins.

    Returns:
        UNKNOWN when it goes on after the data, holds maps, or is nested deeper than Parquet's footers are.
    """
    kinds = np.zeros(16, np.int64)  # of the elements of the list at each depth
    left = np.zeros(16, np.int64)  # elements to come of the list at each depth; -1 for a struct
    left[0] = -1
    depth = 0
    while depth >= 0 and at < len(data):
        if left[depth] == 0:
            depth -= 1
            continue
        if left[depth] > 0:
            left[depth] -= 1
            kind = kinds[depth]
            if kind <= 2:  # a truth value: a byte in a list, part of the head in a struct
                kind = 3
        else:
            head = data[at]
            at += 1
            kind = np.int64(head & 15)
            if kind == _STOP:
                depth -= 1
                continue
            if head >> 4 == 0:
                _, at = _varint(data, at)
        if kind == 3:
            at += 1
        elif kind in _VARINTS:
            _, at = _varint(data, at)
        elif kind == 7:
            at += 8
        elif kind == _BINARY:
            length, at = count_at(data, at)
            at += length
        elif kind == 9 and depth < 15 and at < len(data):
            head = data[at]
            at += 1
            depth += 1
            kinds[depth], left[depth] = head & 15, head >> 4
            if head >> 4 == 15:
                left[depth], at = count_at(data, at)
        elif kind == _STRUCT and depth < 15:
            depth += 1
            left[depth] = -1
        elif kind > 2:
            return UNKNOWN
    return at if depth < 0 else UNKNOWN
