"""Compiled decoder of LZ4 blocks, https://github.com/lz4/lz4/blob/dev/doc/lz4_Block_format.md.

Copies move 8 to 32 bytes at a time. They may write more than they have to, which the next ones overwrite, but nothing
outside of the page.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.storage.read.parquet.byte_kernels import (
    byte_at,
    copy_8,
    copy_16,
    copy_32,
    double_at,
    short_at,
    store_8,
)

_MULTIPLES = np.array([0, 8, 8, 9, 8, 10, 12, 14])
"""The smallest multiple of each distance that is at least 8."""
_FAR = 64
"""More bytes than the literals and the match of a sequence with short ones, and what is copied behind them."""


@device_function
def decompress(data: Array, at: int, end: int, target: Array, first: int, stop: int) -> bool:
    """Decompress the block ``data[at:end]`` into ``target[first:stop]``; returns whether it fills exactly this."""
    at, to = _decompress_most(data, at, end, target, first, stop)
    while 0 <= at < end:
        token = byte_at(data, at)
        length, at = _extended(data, at + 1, end, token >> 4)
        if length > end - at or length > stop - to:
            return False
        _copy(data, at, target, to, length, stop)
        at, to = at + length, to + length
        if at == end:  # the last sequence has no match
            return bool(to == stop)
        if end - at < 2:
            return False
        distance = short_at(data, at)
        length, at = _extended(data, at + 2, end, token & 15)
        length += 4
        if distance == 0 or distance > to - first or length > stop - to:
            return False
        if distance >= 16:
            _copy(target, to - distance, target, to, length, stop)
        else:  # repeats bytes that it writes
            _repeat(target, to, distance, length, stop)
        to += length
    return False


@device_function
def _decompress_most(data: Array, at: int, end: int, target: Array, first: int, stop: int) -> tuple[int, int]:
    """The sequences that end far from both ends, between which bytes can be copied without being counted.

    Returns:
        Where the next sequence begins, or -1 if the block is damaged, and its place in the target.
    """
    to, last_at, last_to = first, end - _FAR, stop - _FAR
    while at < last_at and to < last_to:
        begin, start = at, to
        token = byte_at(data, at)
        at, length = at + 1, token >> 4
        if length < 15:
            copy_16(target, to, data, at)
        else:
            length, at = _extended(data, at, end, length)
            if length > last_at - at or length > last_to - to:
                return begin, start
            for done in range(0, length, 32):
                copy_32(target, to + done, data, at + done)
        at, to = at + length, to + length
        distance, length = short_at(data, at), token & 15
        at += 2
        if distance == 0 or distance > to - first:
            return -1, to
        if length < 15:
            source = to - distance
            if distance >= 8:
                copy_8(target, to, target, source)
            else:
                store_8(target, to, _repeated(double_at(target, source), 8 * distance))
                source = to - _MULTIPLES[distance]
            copy_8(target, to + 8, target, source + 8)
            copy_8(target, to + 16, target, source + 16)
        else:
            length, at = _extended(data, at, end, length)
            if length > last_to - to:
                return begin, start
            if distance >= 16:
                _copy(target, to - distance, target, to, length + 4, stop)
            else:
                _repeat(target, to, distance, length + 4, stop)
        to += length + 4
    return at, to


@device_function
def _extended(data: Array, at: int, end: int, nibble: int) -> tuple[int, int]:
    """A length that continues in further bytes when its four bits are set."""
    length = nibble
    if length == 15:
        while at < end:
            byte = byte_at(data, at)
            at += 1
            length += byte
            if byte != 255:
                break
    return length, at


@device_function
def _copy(source: Array, at: int, target: Array, to: int, length: int, stop: int) -> None:
    """Copy bytes from another array, or from at least 16 bytes before; the page ends at ``stop``."""
    done, last = 0, min(length, stop - to - 16, len(source) - at - 16)
    while done < last:
        copy_16(target, to + done, source, at + done)
        done += 16
    while done < length:
        target[to + done] = source[at + done]
        done += 1


@device_function
def _repeat(target: Array, to: int, distance: int, length: int, stop: int) -> None:
    """Repeat the last ``distance`` bytes, fewer than 16; the page ends at ``stop``."""
    done, last, step = 0, min(length, stop - to - 8), distance
    if distance < 8 and last > 0:
        step = _MULTIPLES[distance]
        value = _repeated(double_at(target, to - distance), 8 * distance)
        while done < last and (step == 8 or done == 0):  # does not wait for bytes that it wrote
            store_8(target, to + done, value)
            done += 8
    while done < last:
        copy_8(target, to + done, target, to + done - step)
        done += 8
    while done < length:
        target[to + done] = target[to + done - distance]
        done += 1


@device_function
def _repeated(value: Any, bits: int) -> Any:
    """Eight bytes that repeat the lowest bits of a value."""
    found = value & ((np.uint64(1) << np.uint64(bits)) - np.uint64(1))
    while bits < 64:
        found |= found << np.uint64(bits)
        bits *= 2
    return found
