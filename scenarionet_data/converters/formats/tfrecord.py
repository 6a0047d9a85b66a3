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
        damage: What is wrong with it; None if it matches its checksums.
    """

    offset: int
    payload: bytes
    damage: str | None = None


def read_records(path: Path) -> Iterator[TfRecord]:
    """Yield the records of a file, with one payload in memory at a time.

    A payload with a wrong checksum is yielded and marked: its length is intact, so the next record can be read. After
    a damaged length, the next header is searched; what lies between is yielded as one damaged record, and so is the
    rest of a file that is cut off or has no sound header any more.

    Raises:
        CorruptSource: The file is empty, not a TFRecord file, or ends within its first record.
    """
    size = path.stat().st_size
    if not size:
        raise CorruptSource(f"{path}: empty file; {_REMEDY}")
    offset = 0
    with path.open("rb") as file:
        while offset < size:
            header = file.read(_HEADER.size)
            length = _length(header)
            end = offset + _HEADER.size + (length or 0) + _FOOTER.size
            after = _next_header(file, offset, size) if length is None else end
            if after is None or after > size:
                damage = _end(header, length, offset, size)
                if not offset:
                    raise CorruptSource(f"{path}: {damage}; {_REMEDY}")
                yield TfRecord(offset, b"", damage)
                return
            if length is None:
                yield TfRecord(offset, b"", "damaged record length")
            else:
                payload = file.read(length)
                (checksum,) = _FOOTER.unpack(file.read(_FOOTER.size))
                yield TfRecord(offset, payload, None if masked_crc(payload) == checksum else "wrong checksum")
            offset = after
            file.seek(offset)


def _length(header: bytes) -> int | None:
    """Parse the payload length from a frame's header; None if it is incomplete or its checksum is wrong."""
    if len(header) < _HEADER.size:
        return None
    length, checksum = _HEADER.unpack(header)
    return int(length) if masked_crc(header[:8]) == checksum else None


def _end(header: bytes, length: int | None, offset: int, size: int) -> str:
    """What is wrong with the last record of a file."""
    if len(header) < _HEADER.size:
        return f"truncated inside the record header at byte {offset}"
    if length is not None:
        end = offset + _HEADER.size + length + _FOOTER.size
        return f"truncated: the record at byte {offset} should end at byte {end}, the file ends at byte {size}"
    what = "damaged record length" if offset else "not a TFRecord file"
    return f"{what}: wrong checksum of the length at byte {offset}"


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
