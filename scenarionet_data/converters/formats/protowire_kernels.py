"""Compiled part of ``protowire``: walk the fields of messages and the elements of lists.

Reads stay within a message. Damage sets the position to ``_BAD``, beyond every end, so that loops terminate; a loop
that does not stop exactly at its end has found damage. Indices are unsigned to avoid the check for negative ones.
Each walk is one long function because passing arrays to others makes it four times slower.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Int32, Int64, UInt8, UInt64
from scenarionet_data.compiled.decorators import device_function, kernel

VARINT, DOUBLE, BYTES, FLOAT = 0, 1, 2, 5
"""Wire types."""

_BAD = np.int64(1 << 62)


@kernel
def walk(buffer: UInt8, firsts: Int32, ends: Int32, wires: Int64, values: UInt64, fields: Int32) -> np.int64:
    """Walk the fields of messages.

    Args:
        buffer: All bytes.
        firsts, ends: (n,) first byte and end of each message.
        wires: (w,) wire types; field f of message m is stored in ``values[m, f - 1]`` if its type is ``wires[f - 1]``.
        values: (n, w).
        fields: (5, k) message, field number, wire type, first byte and end of the content; k may be too small.

    Returns:
        Number of fields; -1 - b if the message at byte b is damaged.
    """
    count = np.int64(0)
    for message in range(len(firsts)):
        pos, end = np.int64(firsts[message]), np.int64(ends[message])
        while pos < end:
            tag, pos = _read_varint(buffer, pos, end)
            number, wire = tag >> 3, tag & 7
            is_wanted = 0 < number <= len(wires) and wires[number - 1] == wire
            first = pos
            if wire == VARINT:
                value, pos = _read_varint(buffer, pos, end)
                if is_wanted:
                    values[message, number - 1] = np.uint64(value)
            elif wire == DOUBLE and end - pos >= 8:
                if is_wanted:
                    values[message, number - 1] = _bits(buffer, pos, 8)
                pos += 8
            elif wire == FLOAT and end - pos >= 4:
                if is_wanted:
                    values[message, number - 1] = _bits(buffer, pos, 4)
                pos += 4
            elif wire == BYTES:
                size, first = _read_varint(buffer, pos, end)
                pos = first + size if 0 <= size <= end - first else _BAD
            else:
                pos = _BAD
            if number < 1 or number >= 1 << 29:
                pos = _BAD
            if count < fields.shape[1] and pos <= end:
                fields[0, count] = message
                fields[1, count] = number
                fields[2, count] = wire
                fields[3, count] = first
                fields[4, count] = pos
            count += 1
        if pos != end:
            return -1 - np.int64(firsts[message])
    return count


@kernel
def unpack(buffer: UInt8, firsts: Int32, ends: Int32, wire: int, elements: Int64) -> np.int64:
    """Walk the elements of lists.

    Args:
        buffer: All bytes.
        firsts, ends: (n,) first byte and end of each list.
        wire: Wire type of an element, VARINT, DOUBLE or FLOAT.
        elements: (2, k) row of the list and bits of each element; k is at least the number of bytes.

    Returns:
        Number of elements; -1 - b if the list at byte b is damaged.
    """
    count, size = np.int64(0), 4 if wire == FLOAT else 8
    for run in range(len(firsts)):
        pos, end = np.int64(firsts[run]), np.int64(ends[run])
        while pos < end:
            bits = np.int64(0)
            if wire == VARINT:
                bits, pos = _read_varint(buffer, pos, end)
            elif end - pos >= size:
                bits, pos = np.int64(_bits(buffer, pos, size)), pos + size
            else:
                pos = _BAD
            elements[0, count] = run
            elements[1, count] = bits
            count += 1
        if pos != end:
            return -1 - np.int64(firsts[run])
    return count


@device_function(forceinline=True)
def _read_varint(buffer: UInt8, pos: np.int64, end: np.int64) -> tuple[np.int64, np.int64]:
    """Return a varint as 64 signed bits, and the position after it; nearly all are one byte long."""
    if pos < end and buffer[np.uint64(pos)] < 0x80:
        return np.int64(buffer[np.uint64(pos)]), pos + 1
    return _read_long_varint(buffer, pos, end)


@device_function
def _read_long_varint(buffer: UInt8, pos: np.int64, end: np.int64) -> tuple[np.int64, np.int64]:
    value, shift = np.int64(0), np.int64(0)
    while pos < end and shift < 70:
        byte = np.int64(buffer[np.uint64(pos)])
        pos += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80 and (shift < 63 or byte < 2):
            return value, pos
        shift += 7
    return np.int64(0), _BAD


@device_function(forceinline=True)
def _bits(buffer: UInt8, pos: np.int64, size: int) -> np.uint64:
    """Read ``size`` little-endian bytes; compiles to a single load."""
    bits = np.uint64(0)
    for i in range(size):
        bits |= np.uint64(buffer[np.uint64(pos) + np.uint64(i)]) << np.uint64(8 * i)
    return bits
