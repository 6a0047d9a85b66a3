"""Encode fields of protobuf messages (https://protobuf.dev/programming-guides/encoding)."""

from __future__ import annotations

_VARINT, _BYTES = 0, 2  # wire types


def varint(value: int) -> bytes:
    """Return a whole number, 7 bits a byte, lowest first; a negative one as 64 bits."""
    value &= 2**64 - 1
    encoded = bytearray()
    while value > 127:
        encoded.append(value & 127 | 128)
        value >>= 7
    encoded.append(value)
    return bytes(encoded)


def number_field(number: int, value: int) -> bytes:
    """Return a field with a whole number.

    Args:
        number: Number of the field.
        value: Its value.
    """
    return varint(number << 3 | _VARINT) + varint(value)


def bytes_field(number: int, content: bytes) -> bytes:
    """Return a field of bytes, a text or a message, with its length before it.

    Args:
        number: Number of the field.
        content: The bytes.
    """
    return varint(number << 3 | _BYTES) + varint(len(content)) + content
