"""Decode protobuf messages into arrays column by column, for all messages of one type together.

A traffic record has tens of thousands of small messages; a Python object for each would cost more than the rest of a
conversion. The encoding is protobuf.dev/programming-guides/encoding. As in every parser, fields with another number
or wire type are skipped, lists may be packed or not, and the last occurrence of a singular field counts. Groups, which
are deprecated, are treated as damage.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Int64, UInt8, UInt64
from scenarionet_data.converters.formats.protowire_kernels import (
    BYTES,
    DOUBLE,
    FLOAT,
    VARINT,
    unpack,
    walk,
)

_WIRE_TYPES = {"v": VARINT, "d": DOUBLE, "f": FLOAT, "-": -1}
_ROOM = 4096
_LONGEST = 2**31 - 1
"""Bytes of a message, by protobuf's own limit; positions are int32."""


class DamagedMessage(ValueError):
    """Bytes that are not a protobuf message; gives the position."""


@dataclass(frozen=True, eq=False)
class Messages:
    """n messages of one type.

    Attributes:
        buffer: (B,) uint8 bytes that contain all of them.
        first, end: (n,) int32 first byte of each, and the byte after its last.
        owner: (n,) int32 row of the parent message, ascending.

    Example:
        >>> pair = Messages.of(bytes([0x08, 150, 1, 0x12, 2, 0x08, 7]))  # {1: 150, 2: {1: 7}}
        >>> pair.scalars("v").tolist(), pair.fields().parts(2).scalars("v").tolist()
        ([[150]], [[7]])
    """

    buffer: UInt8
    first: Int32
    end: Int32
    owner: Int32

    def __len__(self) -> int:
        return len(self.first)

    @classmethod
    def of(cls, payload: bytes) -> Messages:
        """A single message.

        Raises:
            DamagedMessage: It is longer than protobuf allows.
        """
        if len(payload) > _LONGEST:
            raise DamagedMessage(f"{len(payload)} bytes")
        zero = np.zeros(1, np.int32)
        return cls(np.frombuffer(payload, dtype=np.uint8), zero, np.array([len(payload)], np.int32), zero)

    def __getitem__(self, rows: Int64) -> Messages:
        """Select messages."""
        return Messages(self.buffer, self.first[rows], self.end[rows], self.owner[rows])

    def contents(self) -> list[bytes]:
        """Bytes of each message."""
        return [self.buffer[first:end].tobytes() for first, end in zip(self.first, self.end, strict=True)]

    def scalars(self, layout: str, missing: int = 0) -> UInt64:
        """Singular numeric fields as bits; see :func:`doubles`, :func:`floats`, :func:`int64s`, ...

        Args:
            layout: Type of field 1, 2, ...: ``v`` varint (integer, enum, bool), ``d`` double, ``f`` float, ``-`` skip.
            missing: Value of fields that a message lacks.

        Returns:
            (n, len(layout)).

        Raises:
            DamagedMessage: One of them is not a valid message.
        """
        values = np.zeros((len(self), len(layout)), np.uint64)
        if missing:
            int64s(values).fill(missing)
        wires = np.array([_WIRE_TYPES[letter] for letter in layout], dtype=np.int64)
        _require_sound(walk(self.buffer, self.first, self.end, wires, values, np.empty((5, 0), np.int32)))
        return values

    def fields(self) -> Fields:
        """All fields of the messages.

        Raises:
            DamagedMessage: One of them is not a valid message.
        """
        nothing = np.empty(0, np.int64), np.empty((0, 0), np.uint64)
        room = _ROOM + int((self.end - self.first).sum()) // 16
        columns = np.empty((5, room), np.int32)
        count = _require_sound(walk(self.buffer, self.first, self.end, *nothing, columns))
        if count > room:
            columns = np.empty((5, count), np.int32)
            walk(self.buffer, self.first, self.end, *nothing, columns)
        return Fields(self.buffer, *columns[:, :count])


@dataclass(frozen=True, eq=False)
class Fields:
    """The k fields of some messages, in the order of the encoding.

    Attributes:
        buffer: (B,) uint8 bytes that contain the messages.
        owner: (k,) int32 row of the message of the field.
        number: (k,) int32 field number.
        wire: (k,) int32 wire type.
        first, end: (k,) int32 first byte of the content, and the byte after its last.
    """

    buffer: UInt8
    owner: Int32
    number: Int32
    wire: Int32
    first: Int32
    end: Int32

    @property
    def is_part(self) -> Bool:
        """(k,) whether each is length-delimited: a message, string or packed list."""
        is_part: Bool = self.wire == BYTES
        return is_part

    def where(self, mask: Bool) -> Fields:
        """Fields where ``mask`` (k,) is True."""
        columns = (self.owner, self.number, self.wire, self.first, self.end)
        return Fields(self.buffer, *(column[mask] for column in columns))

    def messages(self, mask: Bool) -> Messages:
        """Messages and strings where ``mask`` (k,) is True."""
        mask = mask & self.is_part
        return Messages(self.buffer, self.first[mask], self.end[mask], self.owner[mask])

    def parts(self, number: int) -> Messages:
        """Messages with one field number."""
        return self.messages(self.number == number)

    def lists(self, number: int, kind: str) -> tuple[Int32, UInt64]:
        """Elements of a repeated numeric field.

        Args:
            number: The field number.
            kind: ``v``, ``d`` or ``f``, as in :meth:`Messages.scalars`.

        Returns:
            (k,) row of the message of each element, ascending, and (k,) its bits.

        Raises:
            DamagedMessage: A packed list ends inside an element.
        """
        wire = _WIRE_TYPES[kind]
        return self.where((self.number == number) & ((self.wire == wire) | self.is_part))._elements(wire)

    def column(self, number: int, kind: str, size: int) -> UInt64:
        """A singular numeric field of each message.

        Args:
            number, kind: As in :meth:`lists`.
            size: Number of messages.

        Returns:
            (size,) bits, 0 if a message lacks the field.
        """
        wire = _WIRE_TYPES[kind]
        owner, bits = self.where((self.number == number) & (self.wire == wire))._elements(wire)
        values = np.zeros(size, np.uint64)
        values[owner] = bits
        return values

    def _elements(self, wire: int) -> tuple[Int32, UInt64]:
        """Implements :meth:`lists` for fields that are numbers of this type or packed lists of them."""
        elements = np.empty((2, int((self.end - self.first).sum())), np.int64)  # an element takes at least one byte
        count = _require_sound(unpack(self.buffer, self.first, self.end, wire, elements))
        run, bits = elements[:, :count]
        return self.owner[run], bits.view(np.uint64)


def doubles(bits: UInt64) -> Float64:
    """Bits as float64."""
    return bits.view(np.float64)


def floats(bits: UInt64) -> Float32:
    """Bits as float32."""
    return bits.astype(np.uint32).view(np.float32)


def int64s(bits: UInt64) -> Int64:
    """Bits as int64."""
    return bits.view(np.int64)


def int32s(bits: UInt64) -> Int64:
    """Bits as int32 values, widened to int64."""
    return bits.astype(np.int32).astype(np.int64)


def enums(bits: UInt64, size: int) -> Int64:
    """Bits as values 0 to ``size`` - 1 of an enum; 0 for others."""
    values = int32s(bits)
    return np.where((values >= 0) & (values < size), values, 0)


def _require_sound(result: np.int64) -> int:
    if result < 0:
        raise DamagedMessage(f"invalid data at byte {-1 - result}")
    return int(result)
