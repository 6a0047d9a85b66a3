"""Seals of Parquet files: a sealed file verifies its own bytes and its place in the lake.

The seal is between the last row group and the footer. Parquet readers find everything by absolute offsets and ignore
it::

    PAR1 | row groups | seal: magic (8), digest of the footer (16), digest of the body (16) | footer | length | PAR1

Both digests are XXH3-128. The first covers the footer with its length and the second everything before the seal, each
followed by the file's name relative to the lake, so that two files that were exchanged are found as well. The footer's
key-value metadata has the entry ``scenarionet.sealed``: a file whose seal is destroyed is not mistaken for a file of an
older lake, which has none.

Thrift's compact protocol, in which the entry is written:
https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq
from xxhash import xxh3_128

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.errors import damaged, reading

MARK = b"scenarionet.sealed"
"""Key in the footer of sealed files; the value is the version of the seal."""

WINDOW = 2**16
"""Bytes at the end of a file that show whether it is sealed, even if the length of its footer is damaged."""

_PARQUET = b"PAR1"
_TAIL = 8
_MAGIC = b"SNSEAL\x00\x01"
_DIGEST = 16
_SEAL = len(_MAGIC) + 2 * _DIGEST
_BLOCK = 2**18
"""Bytes read at once; of more, the system provides new memory for each block, which costs as much as the digest."""


@dataclass(frozen=True)
class FileEnd:
    """The end of a Parquet file.

    Attributes:
        footer: The footer, with its length and the magic bytes at the end.
        seal: Digests of footer and body; None in files of older lakes.
        body: Number of bytes before the seal, or before the footer of an unsealed file.
    """

    footer: bytes
    seal: tuple[bytes, bytes] | None
    body: int

    @property
    def is_sealed(self) -> bool:
        """Whether the file is sealed, and its footer therefore verified."""
        return self.seal is not None


@dataclass(frozen=True)
class Sealed:
    """A sealed file that is ready to be published.

    Attributes:
        name: Its name, relative to the lake.
        size: Bytes.
        checksum: SHA-256, hexadecimal.
    """

    name: str
    size: int
    checksum: str


# --- writing ----------------------------------------------------------------------------------------------


def seal(path: Path, name: str) -> None:
    """Seal a local file that is not published yet, in place; an existing seal is replaced.

    Args:
        path: The file.
        name: The name under which it will be published, relative to the lake.

    Raises:
        LakeError: It is not a Parquet file.
    """
    with path.open("r+b") as file:
        end = _split(*_last(file), path)
        body = xxh3_128()
        for block in _blocks(file, end.body):
            body.update(block)
        _write(file, end.body, _sealed_end(_marked(end.footer), body, name))


def seal_data(path: Path, stem: str) -> Sealed:
    """Seal a local file of a table, in place, and name it by its content.

    Args:
        path: The file.
        stem: Its name up to the digest: ``<stem>-<first 16 digits of the SHA-256 before sealing>.parquet``.
    """
    with path.open("r+b") as file:
        end = _split(*_last(file), path)
        body, checksum = xxh3_128(), hashlib.sha256()
        for block in _blocks(file, end.body):
            body.update(block)
            checksum.update(block)
        unsealed = checksum.copy()
        unsealed.update(end.footer)
        name = f"{stem}-{unsealed.hexdigest()[:16]}.parquet"
        written = _sealed_end(_marked(end.footer), body, name)
        checksum.update(written)
        _write(file, end.body, written)
    return Sealed(name, end.body + len(written), checksum.hexdigest())


def _marked(footer: bytes) -> bytes:
    """A footer with the entry ``scenarionet.sealed`` at the end of its key-value metadata.

    They are the fifth field, a list of structs with two binary fields, and the name of the writing software is the
    sixth.
    """
    metadata = pq.read_metadata(pa.BufferReader(footer))
    entries: Mapping[bytes, bytes] = metadata.metadata or {}
    if MARK in entries:
        return footer
    end = footer.rfind(_binary(metadata.created_by.encode()))
    before, after = _list_header(len(entries)), _list_header(len(entries) + 1)
    start = end - sum(len(_entry(key, value)) for key, value in entries.items())
    if footer[start - len(before) : start] != before:
        raise LakeError("a footer has no key-value metadata that can be extended; please report it")
    thrift = footer[: start - len(before)] + after + footer[start:end] + _entry(MARK, b"1") + footer[end:-_TAIL]
    return thrift + len(thrift).to_bytes(4, "little") + _PARQUET


def _list_header(count: int) -> bytes:
    """Header of a list of structs in the field after the previous one."""
    return b"\x19" + (bytes([count << 4 | 0xC]) if count < 15 else b"\xfc" + _varint(count))


def _entry(key: bytes, value: bytes) -> bytes:
    return _binary(key) + _binary(value) + b"\x00"


def _binary(content: bytes) -> bytes:
    """A binary field after the previous one."""
    return b"\x18" + _varint(len(content)) + content


def _varint(number: int) -> bytes:
    encoded = bytearray()
    while number > 127:
        encoded.append(number & 127 | 128)
        number >>= 7
    return bytes([*encoded, number])


def _sealed_end(footer: bytes, body: xxh3_128, name: str) -> bytes:
    body.update(name.encode())
    return _MAGIC + _footer_digest(footer, name) + body.digest() + footer


def _write(file: BinaryIO, position: int, content: bytes) -> None:
    file.seek(position)
    file.write(content)
    file.truncate()


# --- reading ----------------------------------------------------------------------------------------------


def read_end(path: Path, name: str) -> FileEnd:
    """The end of a local file; if the file is sealed, its footer is verified.

    Args:
        path: The file.
        name: Its name, relative to the lake.

    Raises:
        LakeError: It is missing or damaged, or not the file that was published under this name.
    """
    with reading(path), path.open("rb") as file:
        return check_end(*_last(file), name, path)


def check_end(end: bytes, size: int, name: str, url: Path | str) -> FileEnd:
    """The end of a file of which the last bytes have been read; if the file is sealed, its footer is verified.

    Args:
        end: Its last bytes: at least :func:`needed`, or the whole file.
        size: Bytes of the file.
        name: Its name, relative to the lake.
        url: Its path or URL, for errors.

    Raises:
        LakeError: It is damaged, or not the file that was published under this name.
    """
    found = _split(end, size, url)
    if not found.seal and MARK in end[-max(len(found.footer), WINDOW) :]:
        raise damaged(url, "its seal is destroyed")
    if found.seal and found.seal[0] != _footer_digest(found.footer, name):
        raise damaged(url, "its footer differs from the one that was written under this name")
    return found


def needed(tail: bytes) -> int:
    """Bytes at the end of a file that :func:`check_end` needs.

    Args:
        tail: At least the last 8 bytes of the file.
    """
    return max(int.from_bytes(tail[-8:-4], "little") + _TAIL + _SEAL, WINDOW)


def verify(path: Path, name: str, url: Path | str | None = None) -> bool:
    """Verify every byte of a local file, and its name, by its seal.

    Args:
        path: The file.
        name: Its name, relative to the lake.
        url: Its path or URL for errors, if it is a copy.

    Returns:
        Whether the file is sealed. Of an unsealed file, nothing is verified but that it ends like a Parquet file.

    Raises:
        LakeError: It is missing or damaged, or not the file that was published under this name.
    """
    place = url or path
    with reading(place), path.open("rb") as file:
        end = check_end(*_last(file), name, place)
        if end.seal is None:
            return False
        body = xxh3_128()
        for block in _blocks(file, end.body):
            body.update(block)
        body.update(name.encode())
    if body.digest() != end.seal[1]:
        raise damaged(place, "its bytes differ from those that were written")
    return True


def _last(file: BinaryIO) -> tuple[bytes, int]:
    """Last bytes of a file, as many as :func:`check_end` needs, and its size."""
    size = file.seek(0, os.SEEK_END)
    end = _read_last(file, size, WINDOW)
    wanted = min(needed(end), size)
    return (end if wanted <= len(end) else _read_last(file, size, wanted)), size


def _read_last(file: BinaryIO, size: int, count: int) -> bytes:
    file.seek(max(size - count, 0))
    return file.read(count)


def _split(end: bytes, size: int, url: Path | str) -> FileEnd:
    """Find footer and seal at the end of a file."""
    length = int.from_bytes(end[-8:-4], "little") + _TAIL
    if end[-4:] != _PARQUET or length + len(_PARQUET) > size:
        raise damaged(url, "it is no Parquet file, or cut off")
    footer, before = end[-length:], end[-length - _SEAL : -length]
    if before.startswith(_MAGIC):
        digests = before[len(_MAGIC) :]
        return FileEnd(footer, (digests[:_DIGEST], digests[_DIGEST:]), size - length - _SEAL)
    return FileEnd(footer, None, size - length)


def _footer_digest(footer: bytes, name: str) -> bytes:
    return xxh3_128(footer + name.encode()).digest()


def _blocks(file: BinaryIO, size: int) -> Iterator[bytes]:
    """The first bytes of a file, in blocks."""
    file.seek(0)
    while size > 0 and (block := file.read(min(size, _BLOCK))):
        yield block
        size -= len(block)
