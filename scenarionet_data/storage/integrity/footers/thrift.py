"""Bounds-checked decoder of structs in Thrift's compact protocol, by declared fields.

Format: https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md. Everything that is not
declared is refused: other fields, other types, values out of range, lists and texts longer than the bytes left.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

_TRUE, _FALSE, _BYTE, _I16, _I32, _I64, _BINARY, _LIST, _STRUCT = 1, 2, 3, 4, 5, 6, 8, 9, 12
_MAX_DEPTH = 16
"""Structs inside structs; footers of Parquet files have 6."""


class Malformed(ValueError):
    """Bytes that are not the declared struct; the message is the finding."""


@dataclass(frozen=True)
class Kind:
    """A type of a field.

    Attributes:
        wires: Type numbers with which it is encoded.
        read: Reads a value from a decoder, given the type number of the field.
    """

    wires: tuple[int, ...]
    read: Callable[[Decoder, int], Any]


@dataclass(frozen=True)
class Field:
    """A declared field of a struct.

    Attributes:
        name: Key of the value in the result.
        kind: Type.
        is_required: Whether it must be present.
    """

    name: str
    kind: Kind
    is_required: bool = False


StructFields: TypeAlias = Mapping[int, Field]
"""StructFields of a struct by number."""


class Decoder:
    """Reads values from bytes, from a position on.

    Args:
        data: The bytes.
        at: Position of the first value.
        end: Position after the last byte that may be read; the end of the data by default.

    Attributes:
        at: Position of the next value.
    """

    def __init__(self, data: bytes | memoryview, at: int = 0, end: int | None = None) -> None:
        self._data = data
        self.at = at
        self._end = len(data) if end is None else min(end, len(data))
        self._depth = 0

    @property
    def left(self) -> int:
        """Bytes that are left."""
        return self._end - self.at

    def struct(self, name: str, fields: StructFields) -> dict[str, Any]:
        """Read a struct.

        Args:
            name: Its name, for messages.
            fields: Its fields.

        Raises:
            Malformed: The bytes are no such struct.
        """
        self._depth += 1
        if self._depth > _MAX_DEPTH:
            raise Malformed(f"{name} is nested more than {_MAX_DEPTH} deep")
        found: dict[str, Any] = {}
        number = 0
        while header := self.byte():
            wire, step = header & 15, header >> 4
            number = number + step if step else self.integer()
            field = fields.get(number)
            if field is None or wire not in field.kind.wires:
                raise Malformed(f"{name} has a field {number} of type {wire} that this format does not have")
            if field.name in found:
                raise Malformed(f"{name} has {field.name} twice")
            found[field.name] = field.kind.read(self, wire)
        for field in fields.values():
            if field.is_required and field.name not in found:
                raise Malformed(f"{name} has no {field.name}")
        self._depth -= 1
        return found

    def integer(self) -> int:
        """Read a signed integer of at most 64 bits."""
        value = self._varint()
        return (value >> 1) ^ -(value & 1)

    def binary(self) -> bytes:
        """Read bytes that are preceded by their number."""
        size = self._varint()
        if size > self.left:
            raise Malformed(f"a text of {size:,} bytes where {self.left:,} are left")
        start, self.at = self.at, self.at + size
        return bytes(self._data[start : self.at])

    def list(self, kind: Kind) -> list[Any]:
        """Read a list; each value takes at least one byte."""
        header = self.byte()
        size, wire = header >> 4, header & 15
        size = self._varint() if size == 15 else size
        if size > self.left:
            raise Malformed(f"a list of {size:,} values where {self.left:,} bytes are left")
        if wire not in kind.wires:
            raise Malformed(f"a list of values of type {wire} where {kind.wires[0]} is expected")
        return [kind.read(self, wire) for _ in range(size)]

    def byte(self) -> int:
        """Read a byte."""
        if self.at >= self._end:
            raise Malformed("it ends within a value")
        self.at += 1
        return self._data[self.at - 1]

    def _varint(self) -> int:
        value = shift = 0
        while True:
            byte = self.byte()
            value |= (byte & 127) << shift
            if byte < 128:
                break
            shift += 7
            if shift > 63:
                raise Malformed("a number of more than 64 bits")
        return value & 0xFFFFFFFFFFFFFFFF


def integers(bits: int, low: int, high: int) -> Kind:
    """Integers of 16, 32 or 64 bits in a range, bounds included."""

    def read(decoder: Decoder, _: int) -> int:
        value = decoder.integer()
        if not low <= value <= high:
            raise Malformed(f"a number {value:,} that is not from {low:,} to {high:,}")
        return value

    return Kind(({16: _I16, 32: _I32, 64: _I64}[bits],), read)


def one_of(*values: int) -> Kind:
    """A value of an enumeration."""
    known = frozenset(values)

    def read(decoder: Decoder, _: int) -> int:
        value = decoder.integer()
        if value not in known:
            raise Malformed(f"a value {value:,} that its enumeration does not have")
        return value

    return Kind((_I32,), read)


def structs(name: str, fields: StructFields) -> Kind:
    """Structs with these fields."""
    return Kind((_STRUCT,), lambda decoder, _: decoder.struct(name, fields))


def lists(kind: Kind) -> Kind:
    """Lists of values of one kind."""
    return Kind((_LIST,), lambda decoder, _: decoder.list(kind))


def _text(decoder: Decoder, _: int) -> str:
    found = decoder.binary()
    try:
        return found.decode()
    except UnicodeDecodeError as error:
        raise Malformed("a text that is not UTF-8") from error


BYTE = Kind((_BYTE,), lambda decoder, _: decoder.byte())
BINARY = Kind((_BINARY,), lambda decoder, _: decoder.binary())
TEXT = Kind((_BINARY,), _text)
TRUTH = Kind((_TRUE, _FALSE), lambda _, wire: wire == _TRUE)
"""A field's truth value is its type number."""
SIZE = integers(64, 0, 2**62)
COUNT = integers(32, 0, 2**31 - 1)
ANY_INT = integers(32, -(2**31), 2**31 - 1)
