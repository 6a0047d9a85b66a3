"""Reads protobuf messages column by column: all messages of one type at once, into arrays, without any runtime.

A record of traffic holds tens of thousands of small messages; one Python object each would cost more than the rest
of a conversion. The encoding is protobuf.dev/programming-guides/encoding. As in every reader, fields of another
number or wire type are skipped, lists may be packed or not, and of single fields the last one counts. Groups, which
the language gave up, count as damage.
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


class DamagedMessage(ValueError):
    """Bytes that are no protobuf message; says where."""


@dataclass(frozen=True, eq=False)
class Messages:
    """n messages of one type.

    Attributes:
        buffer: (B,) uint8 bytes in which all of them lie.
        first, end: (n,) int32 byte at which each begins, and the one behind it.
        owner: (n,) int32 row of the message that each is part of, ascending.

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
        """The one message that ``payload`` is."""
        zero = np.zeros(1, np.int32)
        return cls(np.frombuffer(payload, dtype=np.uint8), zero, np.array([len(payload)], np.int32), zero)

    def __getitem__(self, rows: Int64) -> Messages:
        """Some of them."""
        return Messages(self.buffer, self.first[rows], self.end[rows], self.owner[rows])

    def contents(self) -> list[bytes]:
        """Each one's bytes."""
        return [self.buffer[first:end].tobytes() for first, end in zip(self.first, self.end, strict=True)]

    def scalars(self, layout: str, missing: int = 0) -> UInt64:
        """Their single numbers as bits; see :func:`doubles`, :func:`floats`, :func:`int64s`, ....

        Args:
            layout: What field 1, 2, ... is: ``v`` varint (integer, enum, bool), ``d`` double, ``f`` float,
                ``-`` not wanted.
            missing: Stands where a message lacks the field.

        Returns:
            (n, len(layout)).

        Raises:
            DamagedMessage: One of them is no message.
        """
        values = np.zeros((len(self), len(layout)), np.uint64)
        if missing:
            int64s(values).fill(missing)
        wires = np.array([_WIRE_TYPES[letter] for letter in layout], dtype=np.int64)
        _require_sound(walk(self.buffer, self.first, self.end, wires, values, np.empty((5, 0), np.int32)))
        return values

    def fields(self) -> Fields:
        """Everything that stands in them.

        Raises:
            DamagedMessage: One of them is no message.
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
    """The k fields of some messages, in the order in which they stand there.

    Attributes:
        buffer: (B,) uint8 bytes in which the messages lie.
        owner: (k,) int32 row of the message that has the field.
        number: (k,) int32 field number.
        wire: (k,) int32 wire type.
        first, end: (k,) int32 byte at which the content begins, and the one behind it.
    """

    buffer: UInt8
    owner: Int32
    number: Int32
    wire: Int32
    first: Int32
    end: Int32

    @property
    def is_part(self) -> Bool:
        """(k,) whether it is a message, a text or a packed list."""
        is_part: Bool = self.wire == BYTES
        return is_part

    def where(self, mask: Bool) -> Fields:
        """Those where ``mask`` (k,) holds."""
        columns = (self.owner, self.number, self.wire, self.first, self.end)
        return Fields(self.buffer, *(column[mask] for column in columns))

    def messages(self, mask: Bool) -> Messages:
        """The messages and texts where ``mask`` (k,) holds."""
        mask = mask & self.is_part
        return Messages(self.buffer, self.first[mask], self.end[mask], self.owner[mask])

    def parts(self, number: int) -> Messages:
        """The messages under one field number."""
        return self.messages(self.number == number)

    def lists(self, number: int, kind: str) -> tuple[Int32, UInt64]:
        """Elements of a repeated number.

        Args:
            number: Its field number.
            kind: ``v`` or ``d``, as in :meth:`Messages.scalars`.

        Returns:
            (k,) row of the message that each element belongs to, ascending, and (k,) its bits.

        Raises:
            DamagedMessage: A packed list ends inside an element.
        """
        wire = _WIRE_TYPES[kind]
        return self.where((self.number == number) & ((self.wire == wire) | self.is_part))._elements(wire)

    def column(self, number: int, kind: str, size: int) -> UInt64:
        """A single number of each message.

        Args:
            number, kind: As in :meth:`lists`.
            size: How many messages there are.

        Returns:
            (size,) bits, 0 where a message lacks the field.
        """
        wire = _WIRE_TYPES[kind]
        owner, bits = self.where((self.number == number) & (self.wire == wire))._elements(wire)
        values = np.zeros(size, np.uint64)
        values[owner] = bits
        return values

    def _elements(self, wire: int) -> tuple[Int32, UInt64]:
        """What :meth:`lists` returns, of fields that are numbers of this type or packed lists of them."""
        elements = np.empty((2, int((self.end - self.first).sum())), np.int64)  # each takes a byte or more
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
    """Bits as the int32 that the message declares, widened."""
    return bits.astype(np.int32).astype(np.int64)


def enums(bits: UInt64, size: int) -> Int64:
    """Bits as values of an enum that counts from 0 to ``size`` - 1; 0 where they are none of them."""
    values = int32s(bits)
    return np.where((values >= 0) & (values < size), values, 0)


def _require_sound(result: np.int64) -> int:
    if result < 0:
        raise DamagedMessage(f"no protobuf message at byte {-1 - result}")
    return int(result)
