"""Encode a ``tf.train.Example``, the named lists of numbers or texts that TensorFlow reads, and frame it as a TFRecord.

Messages (tensorflow/core/example/example.proto and feature.proto): an Example holds Features, a map from names to a
Feature, which is a BytesList, a FloatList or an Int64List. The map is written in the order of names.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarionet_data.converters.formats.tfrecord import masked_crc

_BYTES, _FLOATS, _INTEGERS = 1, 2, 3  # fields of a Feature
_DELIMITED = 2  # wire type


def encode_record(features: Mapping[str, NDArray[Any] | bytes]) -> bytes:
    """Return a TFRecord file with one example.

    Args:
        features: Arrays by name, flattened: floats become 32 bits, integers and flags 64; or one text.
    """
    entries = (_field(1, _field(1, name.encode()) + _field(2, _feature(features[name]))) for name in sorted(features))
    payload = _field(1, b"".join(entries))
    length = struct.pack("<Q", len(payload))
    return b"".join((length, struct.pack("<I", masked_crc(length)), payload, struct.pack("<I", masked_crc(payload))))


def packed_varints(values: NDArray[Any]) -> bytes:
    """Return whole numbers as varints one after another: 7 bits a byte, lowest first, negative ones as 64 bits.

    Args:
        values: Any shape; int64 after conversion.
    """
    numbers = values.ravel().astype(np.int64).view(np.uint64)
    if not (numbers >> np.uint64(7)).any():
        return numbers.astype(np.uint8).tobytes()
    shifts = np.arange(0, 70, 7, dtype=np.uint64)
    groups = numbers[:, None] >> shifts
    has_more = np.zeros(groups.shape, np.bool_)
    has_more[:, :-1] = groups[:, 1:] != 0
    is_written = np.ones(groups.shape, np.bool_)
    is_written[:, 1:] = has_more[:, :-1]
    encoded = (groups & np.uint64(0x7F)).astype(np.uint8) | (has_more.astype(np.uint8) << 7)
    return encoded[is_written].tobytes()


def _feature(values: NDArray[Any] | bytes) -> bytes:
    if isinstance(values, bytes):
        return _field(_BYTES, _field(1, values))
    if values.dtype.kind == "f":
        return _field(_FLOATS, _field(1, values.astype("<f4").tobytes()))
    return _field(_INTEGERS, _field(1, packed_varints(values)))


def _field(number: int, content: bytes) -> bytes:
    """Return a field of bytes with its length before it."""
    head, length = bytearray([number << 3 | _DELIMITED]), len(content)
    while length > 0x7F:
        head.append(length & 0x7F | 0x80)
        length >>= 7
    head.append(length)
    return bytes(head) + content
