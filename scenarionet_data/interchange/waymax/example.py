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

from scenarionet_data.converters.formats.protobuf import bytes_field
from scenarionet_data.converters.formats.tfrecord import masked_crc

_BYTES, _FLOATS, _INTEGERS = 1, 2, 3  # fields of a Feature


def encode_record(features: Mapping[str, NDArray[Any] | bytes]) -> bytes:
    """Return a TFRecord file with one example.

    Args:
        features: Arrays by name, flattened: floats become 32 bits, integers and flags 64; or one text.
    """
    entries = (bytes_field(1, name.encode()) + bytes_field(2, _feature(features[name])) for name in sorted(features))
    payload = bytes_field(1, b"".join(bytes_field(1, entry) for entry in entries))
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
        return bytes_field(_BYTES, bytes_field(1, values))
    if values.dtype.kind == "f":
        return bytes_field(_FLOATS, bytes_field(1, values.astype("<f4").tobytes()))
    return bytes_field(_INTEGERS, bytes_field(1, packed_varints(values)))
