"""TFRecord files: a sequence of byte strings, each framed by its length and two masked CRC-32C checksums.

A frame is: uint64 length, uint32 masked crc of those 8 bytes, the payload, uint32 masked crc of the payload; all
little-endian (tensorflow/core/lib/io/record_writer.h). The checksum runs at memory speed, so every byte is checked.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt
from numba import njit

from scenarionet_data.errors import CorruptSource

_HEADER = struct.Struct("<QI")
_FOOTER = struct.Struct("<I")
_POLYNOMIAL = 0x82F63B78  # Castagnoli, bits reversed
_REMEDY = "download it again, or remove it and convert the rest"


@dataclass(frozen=True)
class Record:
    """One payload of a TFRecord file.

    Attributes:
        offset: Byte in the file at which its frame begins.
        payload: As stored.
        is_intact: Whether the payload has the checksum it was written with.
    """

    offset: int
    payload: bytes
    is_intact: bool


def read_records(path: Path) -> Iterator[Record]:
    """The records of a file one by one; holds one payload at a time.

    A payload with a wrong checksum is handed out, marked: its length is sound, so the next record can be read.

    Raises:
        CorruptSource: The file is empty, is no TFRecord file, is damaged where a length should stand, or ends
            inside a record.
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
            yield Record(offset, payload, masked_crc(payload) == checksum)
            offset = end


def _length(path: Path, offset: int, header: bytes) -> int:
    """Payload length from a frame's header."""
    if len(header) < _HEADER.size:
        raise CorruptSource(f"{path}: truncated inside the record header at byte {offset}; {_REMEDY}")
    length, checksum = _HEADER.unpack(header)
    if masked_crc(header[:8]) != checksum:
        what = "damaged record length" if offset else "not a TFRecord file"
        raise CorruptSource(f"{path}: {what}: wrong checksum of the length at byte {offset}; {_REMEDY}")
    return int(length)


def masked_crc(data: bytes) -> int:
    """CRC-32C of ``data``, turned right by 15 bits plus a constant, as TFRecord stores it."""
    crc = crc32c(data)
    return (((crc >> 15) | (crc << 17)) + 0xA282EAD8) & 0xFFFFFFFF


def crc32c(data: bytes) -> int:
    """CRC-32C (Castagnoli; RFC 3720, appendix B.4).

    Example:
        >>> hex(crc32c(b"123456789"))
        '0xe3069283'
    """
    return int(_crc32c(np.frombuffer(data, dtype=np.uint8), _TABLES))


def _tables() -> npt.NDArray[np.uint32]:
    """(16, 256): row k advances the checksum of one byte over k more bytes ("slicing by 16")."""
    first = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        first = np.where(first & 1, (first >> 1) ^ np.uint32(_POLYNOMIAL), first >> 1)
    rows = [first]
    for _ in range(15):
        rows.append((rows[-1] >> 8) ^ first[rows[-1] & 0xFF])
    return np.stack(rows)


_TABLES = _tables()


@njit(cache=True)
def _crc32c(data: npt.NDArray[np.uint8], tables: npt.NDArray[np.uint32]) -> np.uint32:
    # Sixteen bytes a turn; written out because the sixteen independent look-ups are what makes it fast.
    t = tables
    crc = np.uint32(0xFFFFFFFF)
    whole = len(data) // 16 * 16
    for i in range(0, whole, 16):
        late = t[11, data[i + 4]] ^ t[10, data[i + 5]] ^ t[9, data[i + 6]] ^ t[8, data[i + 7]]
        late ^= t[7, data[i + 8]] ^ t[6, data[i + 9]] ^ t[5, data[i + 10]] ^ t[4, data[i + 11]]
        late ^= t[3, data[i + 12]] ^ t[2, data[i + 13]] ^ t[1, data[i + 14]] ^ t[0, data[i + 15]]
        early = t[15, data[i] ^ (crc & 0xFF)] ^ t[14, data[i + 1] ^ (crc >> 8 & 0xFF)]
        early ^= t[13, data[i + 2] ^ (crc >> 16 & 0xFF)] ^ t[12, data[i + 3] ^ (crc >> 24)]
        crc = early ^ late
    for i in range(whole, len(data)):
        crc = t[0, (crc ^ data[i]) & 0xFF] ^ (crc >> 8)
    return crc ^ np.uint32(0xFFFFFFFF)
