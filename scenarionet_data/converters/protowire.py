"""Reads protobuf messages column by column: all messages of one type at once, into arrays, without any runtime.

A record of traffic holds tens of thousands of small messages; one Python object each would cost more than the rest
of a conversion. One compiled walk lists the fields of messages and picks their numbers, another unpacks lists. The
encoding is protobuf.dev/programming-guides/encoding. As in every reader, fields of another number or wire type are
skipped, lists may be packed or not, and of single fields the last one counts. Groups, which the language gave up,
count as damage.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numba import njit

Bools = npt.NDArray[np.bool_]
Bytes = npt.NDArray[np.uint8]
Ints = npt.NDArray[np.int64]
Places = npt.NDArray[np.int32]
Bits = npt.NDArray[np.uint64]

_VARINT, _DOUBLE, _BYTES, _FLOAT = 0, 1, 2, 5
_WIRE_TYPES = {"v": _VARINT, "d": _DOUBLE, "f": _FLOAT, "-": -1}
_BAD = 1 << 62
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

    buffer: Bytes
    first: Places
    end: Places
    owner: Places

    def __len__(self) -> int:
        return len(self.first)

    @classmethod
    def of(cls, payload: bytes) -> Messages:
        """The one message that ``payload`` is."""
        zero = np.zeros(1, np.int32)
        return cls(np.frombuffer(payload, dtype=np.uint8), zero, np.array([len(payload)], np.int32), zero)

    def __getitem__(self, rows: Ints) -> Messages:
        """Some of them."""
        return Messages(self.buffer, self.first[rows], self.end[rows], self.owner[rows])

    def texts(self) -> list[bytes]:
        """Each one's bytes."""
        return [self.buffer[first:end].tobytes() for first, end in zip(self.first, self.end, strict=True)]

    def scalars(self, layout: str, missing: int = 0) -> Bits:
        """Their single numbers as bits; see :func:`doubles`, :func:`floats`, :func:`int64s`, ....

        Args:
            layout: What field 1, 2, ... is: ``v`` varint (integer, enum, bool), ``d`` double, ``f`` float, ``-`` not
                wanted.
            missing: Stands where a message lacks the field.

        Returns:
            (n, len(layout)).

        Raises:
            DamagedMessage: One of them is no message.
        """
        values = np.full((len(self), len(layout)), missing, np.int64).view(np.uint64)
        wires = np.array([_WIRE_TYPES[letter] for letter in layout], dtype=np.int64)
        _require_sound(_walk(self.buffer, self.first, self.end, wires, values, np.empty((5, 0), np.int32)))
        return values

    def fields(self) -> Fields:
        """Everything that stands in them.

        Raises:
            DamagedMessage: One of them is no message.
        """
        nothing = np.empty(0, np.int64), np.empty((0, 0), np.uint64)
        room = _ROOM + int((self.end - self.first).sum()) // 16
        columns = np.empty((5, room), np.int32)
        count = _require_sound(_walk(self.buffer, self.first, self.end, *nothing, columns))
        if count > room:
            columns = np.empty((5, count), np.int32)
            _walk(self.buffer, self.first, self.end, *nothing, columns)
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

    buffer: Bytes
    owner: Places
    number: Places
    wire: Places
    first: Places
    end: Places

    @property
    def is_part(self) -> Bools:
        """(k,) whether it is a message, a text or a packed list."""
        return self.wire == _BYTES

    def where(self, mask: Bools) -> Fields:
        """Those where ``mask`` (k,) holds."""
        columns = (self.owner, self.number, self.wire, self.first, self.end)
        return Fields(self.buffer, *(column.compress(mask) for column in columns))

    def messages(self, mask: Bools) -> Messages:
        """The messages and texts where ``mask`` (k,) holds."""
        mask = mask & self.is_part
        return Messages(self.buffer, self.first.compress(mask), self.end.compress(mask), self.owner.compress(mask))

    def parts(self, number: int) -> Messages:
        """The messages under one field number."""
        return self.messages(self.number == number)

    def lists(self, number: int, kind: str) -> tuple[Places, Bits]:
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
        runs = self.where((self.number == number) & ((self.wire == wire) | self.is_part))
        elements = np.empty((2, int((runs.end - runs.first).sum())), np.int64)  # each takes a byte or more
        count = _require_sound(_unpack(self.buffer, runs.first, runs.end, wire, elements))
        run, bits = elements[:, :count]
        return runs.owner[run], bits.view(np.uint64)

    def column(self, number: int, kind: str, size: int) -> Bits:
        """A single number of each message.

        Args:
            number, kind: As in :meth:`lists`.
            size: How many messages there are.

        Returns:
            (size,) bits, 0 where a message lacks the field.
        """
        values = np.zeros(size, np.uint64)
        owner, bits = self.lists(number, kind)
        values[owner] = bits
        return values


def doubles(bits: Bits) -> npt.NDArray[np.float64]:
    """Bits as float64."""
    return bits.view(np.float64)


def floats(bits: Bits) -> npt.NDArray[np.float32]:
    """Bits as float32."""
    return bits.astype(np.uint32).view(np.float32)


def int64s(bits: Bits) -> Ints:
    """Bits as int64."""
    return bits.view(np.int64)


def int32s(bits: Bits) -> Ints:
    """Bits as the int32 that the message declares, widened."""
    return bits.astype(np.int32).astype(np.int64)


def enums(bits: Bits, size: int) -> Ints:
    """Bits as values of an enum that counts from 0 to ``size`` - 1; 0 where they are none of them."""
    values = int32s(bits)
    return np.where((values >= 0) & (values < size), values, 0)


def _require_sound(result: int) -> int:
    if result < 0:
        raise DamagedMessage(f"no protobuf message at byte {-1 - result}")
    return result


# --- compiled -------------------------------------------------------------------------------------------
# Reading never leaves a message: damage moves the position to _BAD, beyond every end, so that loops stop by themselves,
# and a loop that does not stop exactly at its end has met damage. Indices are unsigned because testing for Python's
# negative ones takes time, and the walk is one function because handing its arrays on to others takes four times as
# long. Both fill tables only as far as they reach: with empty ones they just count.


@njit(cache=True)
def _walk(buffer: Bytes, firsts: Places, ends: Places, wires: Ints, values: Bits, fields: Places) -> int:
    """Goes through the fields of messages.

    Args:
        buffer: All bytes.
        firsts, ends: (n,) where each message begins and ends.
        wires: (w,) wire types; number f of message m goes to ``values[m, f - 1]`` if ``wires[f - 1]`` is its own.
        values: (n, w).
        fields: (5, k) the columns of :class:`Fields`; may be too short.

    Returns:
        How many fields there are; -1 - b if the message that begins at byte b is damaged.
    """
    count = 0
    for message in range(len(firsts)):
        pos, end = np.int64(firsts[message]), np.int64(ends[message])
        while pos < end:
            tag, pos = _read_varint(buffer, pos, end)
            number, wire = tag >> 3, tag & 7
            is_wanted = 0 < number <= len(wires) and wires[number - 1] == wire
            first = pos
            if wire == _VARINT:
                value, pos = _read_varint(buffer, pos, end)
                if is_wanted:
                    values[message, number - 1] = np.uint64(value)
            elif wire == _DOUBLE and end - pos >= 8:
                if is_wanted:
                    values[message, number - 1] = _bits(buffer, pos, 8)
                pos += 8
            elif wire == _FLOAT and end - pos >= 4:
                if is_wanted:
                    values[message, number - 1] = _bits(buffer, pos, 4)
                pos += 4
            elif wire == _BYTES:
                size, first = _read_varint(buffer, pos, end)
                pos = first + size if 0 <= size <= end - first else _BAD
            else:
                pos = _BAD
            if number < 1 or number >= 1 << 29:
                pos = _BAD
            if count < fields.shape[1]:
                fields[0, count] = message
                fields[1, count] = number
                fields[2, count] = wire
                fields[3, count] = first
                fields[4, count] = pos
            count += 1
        if pos != end:
            return -1 - np.int64(firsts[message])
    return count


@njit(cache=True)
def _unpack(buffer: Bytes, firsts: Places, ends: Places, wire: int, elements: Ints) -> int:
    """Elements of lists into ``elements`` (2, k) row of the list, bits; returns as :func:`_walk` does."""
    count = 0
    for run in range(len(firsts)):
        pos, end = np.int64(firsts[run]), np.int64(ends[run])
        while pos < end:
            bits = np.int64(0)
            if wire == _VARINT:
                bits, pos = _read_varint(buffer, pos, end)
            elif end - pos >= 8:
                bits, pos = np.int64(_bits(buffer, pos, 8)), pos + 8
            else:
                pos = _BAD
            elements[0, count] = run
            elements[1, count] = bits
            count += 1
        if pos != end:
            return -1 - np.int64(firsts[run])
    return count


@njit(cache=True, forceinline=True)
def _read_varint(buffer: Bytes, pos: int, end: int) -> tuple[int, int]:
    """Value, as 64 signed bits, and the position behind it; nearly all are one byte long."""
    if pos < end and buffer[np.uint64(pos)] < 0x80:
        return np.int64(buffer[np.uint64(pos)]), pos + 1
    return _read_long_varint(buffer, pos, end)


@njit(cache=True)
def _read_long_varint(buffer: Bytes, pos: int, end: int) -> tuple[int, int]:
    value, shift = np.int64(0), np.int64(0)
    while pos < end and shift < 70:
        byte = np.int64(buffer[np.uint64(pos)])
        pos += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80 and (shift < 63 or byte < 2):
            return value, pos
        shift += 7
    return np.int64(0), _BAD


@njit(cache=True, forceinline=True)
def _bits(buffer: Bytes, pos: int, size: int) -> np.uint64:
    """``size`` bytes as a number, the lowest first; becomes a single load."""
    bits = np.uint64(0)
    for i in range(size):
        bits |= np.uint64(buffer[np.uint64(pos) + np.uint64(i)]) << np.uint64(8 * i)
    return bits
