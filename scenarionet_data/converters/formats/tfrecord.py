"""Read TFRecord files: byte strings framed by their length and two masked CRC-32C checksums.

A frame is: uint64 length, uint32 masked crc of those 8 bytes, the payload, uint32 masked crc of the payload; all
little-endian (tensorflow/core/lib/io/record_writer.h). Checksums run at memory speed, so every byte is checked.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import google_crc32c

from scenarionet_data.errors import CorruptSource

_HEADER = struct.Struct("<QI")
_FOOTER = struct.Struct("<I")
_REMEDY = "download it again, or remove it and convert the rest"


@dataclass(frozen=True)
class TfRecord:
    """One payload of a TFRecord file.

    Attributes:
        offset: First byte of its frame in the file.
        payload: Its bytes.
        is_intact: Whether the payload matches its checksum.
    """

    offset: int
    payload: bytes
    is_intact: bool


def read_records(path: Path) -> Iterator[TfRecord]:
    """Yield the records of a file, with one payload in memory at a time.

    A payload with a wrong checksum is yielded and marked: its length is intact, so the next record can be read.

    Raises:
        CorruptSource: The file is empty, not a TFRecord file, truncated, or has a damaged length.
    """
    size = path.stat().st_size
    if not size:
        raise CorruptSource(f"{path}: empty file; {_REMEDY}")
    offset = 0
    with path.open("rb") as file:
        while offset < size:
            length = _length(path, offset, file.read(_HEADER.size))
            end = offset + _HEADER.size + length + _FOOTER.size
            if end > size:
                raise CorruptSource(
                    f"{path}: truncated: the record at byte {offset} should end at byte {end}, "
                    f"the file ends at byte {size}; {_REMEDY}"
                )
            payload = file.read(length)
            (checksum,) = _FOOTER.unpack(file.read(_FOOTER.size))
            yield TfRecord(offset, payload, masked_crc(payload) == checksum)
            offset = end


def _length(path: Path, offset: int, header: bytes) -> int:
    """Parse the payload length from a frame's header."""
    if len(header) < _HEADER.size:
        raise CorruptSource(f"{path}: truncated inside the record header at byte {offset}; {_REMEDY}")
    length, checksum = _HEADER.unpack(header)
    if masked_crc(header[:8]) != checksum:
        what = "damaged record length" if offset else "not a TFRecord file"
        raise CorruptSource(f"{path}: {what}: wrong checksum of the length at byte {offset}; {_REMEDY}")
    return int(length)


def masked_crc(data: bytes) -> int:
    """CRC-32C of ``data``, rotated right by 15 bits plus a constant, as TFRecord stores it."""
    crc: int = google_crc32c.value(data)
    return (((crc >> 15) | (crc << 17)) + 0xA282EAD8) & 0xFFFFFFFF
