"""Compiled copies of the texts of Parquet pages, which are checked to be UTF-8: only then are they ever made str.

UTF-8 is that of the Unicode standard, table 3-7, as Python decodes it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.compiled.decorators import device_function
from scenarionet_data.storage.read.parquet.byte_kernels import byte_at, double_at, store_8

_NOT_ASCII = np.uint64(0x8080808080808080)
_ALL = np.uint64(0xFFFFFFFFFFFFFFFF)


@device_function(forceinline=True)
def copy_text(data: Array, at: int, length: int, target: Array, to: int, limit: int) -> bool:
    """Copy a text; returns whether it is UTF-8. It must be within both arrays.

    Up to 16 bytes behind it may be written as well, before ``limit``.
    """
    if length > 16 or at + 16 > len(data) or to + 16 > limit:
        return _copy_long(data, at, length, target, to)
    low, high = double_at(data, at), double_at(data, at + 8)  # without loops, as most are
    store_8(target, to, low)
    store_8(target, to + 8, high)
    bits = low & _first_bytes(min(length, 8)) | high & _first_bytes(max(length - 8, 0))
    return bool(bits & _NOT_ASCII == 0 or _is_utf8(data, at, at + length))


@device_function
def _copy_long(data: Array, at: int, length: int, target: Array, to: int) -> bool:
    done, bits = 0, np.uint64(0)
    while done + 8 <= length:
        eight = double_at(data, at + done)
        store_8(target, to + done, eight)
        bits |= eight
        done += 8
    while done < length:
        byte = byte_at(data, at + done)
        target[to + done] = byte
        bits |= np.uint64(byte)
        done += 1
    return bool(bits & _NOT_ASCII == 0 or _is_utf8(data, at, at + length))


@device_function
def _first_bytes(count: int) -> Any:
    """Mask of up to 8 bytes."""
    return _ALL >> np.uint64(64 - 8 * count) if count else np.uint64(0)


@device_function
def _is_utf8(data: Array, at: int, end: int) -> bool:
    while at < end:
        lead = byte_at(data, at)
        size = _size(lead)
        if size == 0 or size > end - at:
            return False
        if size > 1:
            second = byte_at(data, at + 1)
            # The shortest form only, no surrogates, nothing beyond U+10FFFF.
            low = 0xA0 if lead == 0xE0 else 0x90 if lead == 0xF0 else 0x80
            high = 0x9F if lead == 0xED else 0x8F if lead == 0xF4 else 0xBF
            if not low <= second <= high:
                return False
        for place in range(at + 2, at + size):
            if byte_at(data, place) >> 6 != 0b10:
                return False
        at += size
    return True


@device_function
def _size(lead: Any) -> int:
    """Bytes of a character by its first one; 0 for a byte that begins none."""
    if lead < 0x80:
        return 1
    if lead < 0xC2 or lead > 0xF4:
        return 0
    return 2 if lead < 0xE0 else 3 if lead < 0xF0 else 4
