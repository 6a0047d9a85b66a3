"""Thrift's compact protocol in compiled code: a Parquet page's header, and where a struct ends.

Format: https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from numba import njit

Array = npt.NDArray[Any]

UNKNOWN = -1
"""What is not what our writer makes."""

DATA_PAGE, DICTIONARY_PAGE = 0, 2

_BEYOND = 1 << 40
_STOP, _BINARY, _STRUCT = 0, 8, 12
_VARINTS = (4, 5, 6)
_PAGE_HEADERS = (5, 7)
"""Fields with what only data pages and only dictionary pages have; both begin with values and encoding."""


@njit(nogil=True)
def read_header(data: Array, at: int) -> tuple[int, int, int, int, int, int]:
    """A page's header: where the page begins, its compressed and uncompressed size, type, values and encoding.

    Args:
        data: (n,) uint8 the file.
        at: Where the header begins.

    Returns:
        All UNKNOWN when the header holds what neither a data page of version 1 nor a dictionary does.
    """
    kind_of_page, size, stored_size = UNKNOWN, UNKNOWN, UNKNOWN  # fields 1 to 3
    num_values, encoding = UNKNOWN, UNKNOWN  # fields 1 and 2 of the page's own header
    depth, outer, inner = 0, 0, 0
    while at < len(data):
        byte = data[at]
        at += 1
        kind, step = byte & 15, byte >> 4
        if kind == _STOP:
            if depth == 0:
                return at, stored_size, size, kind_of_page, num_values, encoding
            depth -= 1
            continue
        if step == 0:
            field, at = _zigzag(data, at)
        else:
            field = int(step) + (outer if depth == 0 else inner)
        if depth == 0:
            outer = field
        elif depth == 1:  # deeper it does not matter
            inner = field
        if kind in _VARINTS:
            value, at = _zigzag(data, at)
            if depth == 0 and field == 1:
                kind_of_page = value
            elif depth == 0 and field == 2:
                size = value
            elif depth == 0 and field == 3:
                stored_size = value
            elif depth == 1 and outer in _PAGE_HEADERS and field == 1:
                num_values = value
            elif depth == 1 and outer in _PAGE_HEADERS and field == 2:
                encoding = value
        elif kind == _BINARY:
            length, at = count_at(data, at)
            at += length
        elif kind == _STRUCT and depth < 7:
            depth, inner = depth + 1, 0
        elif kind > 2:  # 1 and 2 are true and false, without a value
            break
    return UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN, UNKNOWN


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


@njit(nogil=True)
def _zigzag(data: Array, at: int) -> tuple[int, int]:
    value, at = _varint(data, at)
    return (value >> 1) ^ -(value & 1), at


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
