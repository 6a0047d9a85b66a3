"""Thrift's compact protocol, as far as Parquet's footers use it: decoded, and encoded to the same bytes again.

Format: https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md
A struct is a dict of field number to (kind, value); a list is (kind of its elements, elements).
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import Any

import numpy as np

from scenarionet_data.storage.read.parquet import thrift_kernels as kernels

TRUE, FALSE, BYTE, I16, I32, I64, DOUBLE, BINARY, LIST, STRUCT = 1, 2, 3, 4, 5, 6, 7, 8, 9, 12

Struct = dict[int, tuple[int, Any]]


class BadThrift(ValueError):
    """The bytes are no struct of Thrift's compact protocol."""


def decode(data: bytes, unopened: Iterable[int] = ()) -> Struct:
    """A struct from the bytes that begin with it.

    Args:
        data: The bytes.
        unopened: Fields with lists of structs whose elements stay bytes: decoding takes 100 times as long.

    Raises:
        BadThrift: The bytes are none.
    """
    try:
        return _Reader(data).struct(frozenset(unopened))
    except (IndexError, struct.error) as error:
        raise BadThrift("its metadata ends too early") from error


def encode(content: Struct | bytes) -> bytes:
    """The bytes of a struct; what is bytes already was not taken apart."""
    if isinstance(content, bytes):
        return content
    parts, last = [], 0
    for number, (kind, value) in content.items():
        step = number - last
        parts.append(bytes([step << 4 | kind]) if 0 < step < 16 else bytes([kind]) + _zigzag(number))
        parts.append(b"" if kind in (TRUE, FALSE) else _value(kind, value))
        last = number
    return b"".join(parts) + b"\0"


class _Reader:
    """Reads one value after the other."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self._bytes = np.frombuffer(data, np.uint8)
        self._at = 0

    def struct(self, unopened: frozenset[int] = frozenset()) -> Struct:
        content: Struct = {}
        number = 0
        while head := self._byte():
            kind, step = head & 15, head >> 4
            number = number + step if step else self._zigzag()
            content[number] = kind, self._value(kind, is_opened=number not in unopened)
        return content

    def _value(self, kind: int, *, is_opened: bool = True) -> Any:
        if kind in (TRUE, FALSE):
            return kind == TRUE
        if kind == BYTE:
            return self._byte()
        if kind in (I16, I32, I64):
            return self._zigzag()
        if kind == DOUBLE:
            return self._take(8)
        if kind == BINARY:
            return self._take(self._varint())
        if kind == LIST:
            return self._list(is_opened)
        if kind == STRUCT:
            return self.struct()
        raise BadThrift(f"its metadata holds a value of kind {kind}")

    def _list(self, is_opened: bool) -> tuple[int, list[Any]]:
        head = self._byte()
        kind, count = head & 15, head >> 4
        count = self._varint() if count == 15 else count
        if kind == STRUCT and not is_opened:
            return kind, [self._span() for _ in range(count)]
        # In a list a truth value is a byte of its own.
        return kind, [self._byte() if kind in (TRUE, FALSE) else self._value(kind) for _ in range(count)]

    def _span(self) -> bytes:
        """A struct as it is."""
        start, end = self._at, kernels.struct_end(self._bytes, self._at)
        if end == kernels.UNKNOWN:
            raise BadThrift("its metadata ends too early")
        self._at = end
        return self._data[start:end]

    def _byte(self) -> int:
        self._at += 1
        return self._data[self._at - 1]

    def _take(self, size: int) -> bytes:
        self._at += size
        if self._at > len(self._data):
            raise BadThrift("its metadata ends too early")
        return self._data[self._at - size : self._at]

    def _varint(self) -> int:
        value = shift = 0
        while True:
            byte = self._byte()
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    def _zigzag(self) -> int:
        value = self._varint()
        return value >> 1 ^ -(value & 1)


def _value(kind: int, value: Any) -> bytes:
    if kind == BYTE:
        return bytes([value])
    if kind in (I16, I32, I64):
        return _zigzag(value)
    if kind == DOUBLE:
        return bytes(value)
    if kind == BINARY:
        return _varint(len(value)) + bytes(value)
    if kind == LIST:
        return _list(*value)
    return encode(value)


def _list(kind: int, elements: list[Any]) -> bytes:
    count = len(elements)
    head = bytes([count << 4 | kind]) if count < 15 else bytes([240 | kind]) + _varint(count)
    inner = BYTE if kind in (TRUE, FALSE) else kind
    return head + b"".join(_value(inner, element) for element in elements)


def _varint(value: int) -> bytes:
    parts = []
    while value > 127:
        parts.append(value & 127 | 128)
        value >>= 7
    return bytes([*parts, value])


def _zigzag(value: int) -> bytes:
    return _varint(value << 1 if value >= 0 else -value * 2 - 1)
