"""Read TFRecord files: byte strings framed by their length and two masked CRC-32C checksums.

A frame is: uint64 length, uint32 masked crc of those 8 bytes, the payload, uint32 masked crc of the payload; all
little-endian (tensorflow/core/lib/io/record_writer.h). Checksums run at memory speed, so every byte is checked.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import google_crc32c
import numpy as np

from scenarionet_data.errors import CorruptSource

_HEADER = struct.Struct("<QI")
_FOOTER = struct.Struct("<I")
_SEARCHED = 2**20
"""Bytes that are searched at a time for a sound header."""
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

    A payload with a wrong checksum is yielded and marked: its length is intact, so the next record can be read. After
    a damaged length, the next header is searched; what lies between is yielded as one damaged record.

    Raises:
        CorruptSource: The file is empty, not a TFRecord file, truncated, or has no sound header after a damaged one.
    """
    size = path.stat().st_size
    if not size:
        raise CorruptSource(f"{path}: empty file; {_REMEDY}")
    offset = 0
    with path.open("rb") as file:
        while offset < size:
            length = _length(path, offset, file.read(_HEADER.size))
            if length is None:
                after = _next_header(file, offset, size)
                if after is None or not offset:
                    what = "damaged record length" if offset else "not a TFRecord file"
                    raise CorruptSource(f"{path}: {what}: wrong checksum of the length at byte {offset}; {_REMEDY}")
                yield TfRecord(offset, b"", is_intact=False)
                offset = after
                file.seek(offset)
                continue
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


def _length(path: Path, offset: int, header: bytes) -> int | None:
    """Parse the payload length from a frame's header; None if its checksum is wrong."""
    if len(header) < _HEADER.size:
        raise CorruptSource(f"{path}: truncated inside the record header at byte {offset}; {_REMEDY}")
    length, checksum = _HEADER.unpack(header)
    return int(length) if masked_crc(header[:8]) == checksum else None


def _next_header(file: BinaryIO, offset: int, size: int) -> int | None:
    """Position of the next header after ``offset`` whose checksum is right and whose record fits into the file."""
    start, kept = offset + 1, b""
    file.seek(start)
    while chunk := file.read(_SEARCHED):
        data = kept + chunk
        is_zero = np.frombuffer(data, np.uint8) == 0
        # Bytes 5 to 7 of a length are 0 in files below a terabyte: few places are left to check.
        for at in np.flatnonzero(is_zero[5:-6] & is_zero[6:-5] & is_zero[7:-4]).tolist():
            length, checksum = _HEADER.unpack_from(data, at)
            is_inside = start + at + _HEADER.size + length + _FOOTER.size <= size
            if is_inside and masked_crc(data[at : at + 8]) == checksum:
                return start + at
        kept = data[-(_HEADER.size - 1) :]
        start += len(data) - len(kept)
    return None


def masked_crc(data: bytes) -> int:
    """CRC-32C of ``data``, rotated right by 15 bits plus a constant, as TFRecord stores it."""
    crc: int = google_crc32c.value(data)
    return (((crc >> 15) | (crc << 17)) + 0xA282EAD8) & 0xFFFFFFFF
