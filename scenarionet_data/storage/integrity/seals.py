"""Seals of Parquet and JSON files: a sealed file verifies its own bytes, its place, and the lake that it belongs to.

The seal of a Parquet file is between the last row group and the footer. Parquet readers find everything by absolute
offsets and ignore it::

    PAR1 | row groups | digest of each (16) | magic (8), their number (8), digest (16) | footer | length | PAR1

Digests are XXH3-128. A row group extends to the next one, or to the seal; the first one begins with the file. The last
digest covers the others, the footer with its length, and the :class:`Place`, so that files that were exchanged are
found as well. A row group is verified by itself, so that a scenario can be read without the rest of its file. The
footer's key-value metadata has the entry ``scenarionet.sealed``: a file whose seal is destroyed is not mistaken for a
file of an older version.

The footer is verified whenever it is opened, before anything parses it, and all bytes once a process; row groups of the
large tables are compared with their digests when they are read instead.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import struct
from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq
from xxhash import xxh3_128_digest, xxh3_128_hexdigest

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.errors import check_is_file, damaged, reading
from scenarionet_data.storage.integrity import older_files
from scenarionet_data.storage.integrity.file_end import MARK, TAIL, WINDOW, FileEnd, Place

_PARQUET = b"PAR1"
_MAGIC = b"SNSEAL\x00\x02"
_DIGEST = 16
_SEAL = len(_MAGIC) + 8 + _DIGEST

FORMAT = 3
"""Of JSON files."""
_ZEROS = b"0" * 32

_VARINT = rb"[\x80-\xff]{0,9}[\x00-\x7f]"
_GROUP = re.compile(rb"\x00\x16%b\x16%b\x26(%b)\x16%b(?:\x14%b)?\x00" % ((_VARINT,) * 5), re.DOTALL)
"""How a row group ends in a footer, in Thrift's compact protocol: size, rows, offset, stored size, ordinal."""

_verified: dict[Path, tuple[tuple[int, ...], bool]] = {}
"""Files that this process has verified: what identified them then, and whether every byte is."""


class Sealed(NamedTuple):
    """A sealed file that is ready to be published.

    Attributes:
        name: Its name, relative to the lake.
        size: Bytes.
        checksum: SHA-256, hexadecimal.
    """

    name: str
    size: int
    checksum: str


def seal(path: Path, place: Place | str) -> Sealed:
    """Seal a local file that is not published yet, in place; an existing seal is replaced.

    Args:
        path: The file.
        place: Where it belongs; or, of a file that is named by its content, its name up to the digest:
            ``<place>-<first 16 digits of the SHA-256 before sealing>.parquet``. Only of these the checksum is right.

    Raises:
        LakeError: It is not a Parquet file, or its footer lacks the entry of sealed files.
    """
    with path.open("r+b") as file:
        end = split(*last(file), path)
        metadata = pq.read_metadata(pa.BufferReader(end.footer))
        if MARK not in (metadata.metadata or {}):
            raise LakeError(f"{path}: its footer has no entry {MARK.decode()}; please report it")
        listed, checksum = b"", hashlib.sha256()
        for group in row_groups(file, end, metadata):
            listed += xxh3_128_digest(group)
            if isinstance(place, str):
                checksum.update(group)
        if isinstance(place, str):
            unsealed = checksum.copy()
            unsealed.update(end.footer)
            place = Place(f"{place}-{unsealed.hexdigest()[:16]}.parquet")
        count = (len(listed) // _DIGEST).to_bytes(8, "little")
        digest = xxh3_128_digest(listed + end.footer + covered(place))
        written = listed + _MAGIC + count + digest + end.footer
        checksum.update(written)
        file.truncate(file.seek(end.body))
        file.write(written)
    return Sealed(place.name, end.body + len(written), checksum.hexdigest())


def open_end(path: Path, place: Place) -> FileEnd:
    """The verified end of a local file.

    Raises:
        LakeError: It is missing or damaged, or not the file that was published at this place.
    """
    check_is_file(path)
    with reading(path), path.open("rb") as file:
        tail, size = last(file)
    end = _checked(tail, size, place, path)
    if not end.digest:
        verify(path, place)
    return end


def verify(path: Path, place: Place) -> bool:
    """Verify every byte of a local file that can be, once a process.

    Returns:
        Whether every byte is verified; False for some files of older versions, which cannot be.

    Raises:
        LakeError: It is missing or damaged, or not the file that was published at this place.
    """
    with reading(path):
        found = path.stat()
    now = found.st_size, found.st_mtime_ns, found.st_ino  # a file that was replaced differs in one of them
    known, is_whole = _verified.get(path, (None, False))
    if known != now:
        is_whole = verify_again(path, place)
        _verified[path] = now, is_whole
    return is_whole


def verify_again(path: Path, place: Place, url: Path | str | None = None) -> bool:
    """Call :func:`verify` for a file that may have changed since.

    Args:
        path: The file.
        place: Where it belongs.
        url: Its path or URL for errors, if it is a copy.
    """
    where = url or path
    check_is_file(path)
    with reading(where), path.open("rb") as file:
        tail, size = last(file)
        end = _checked(tail, size, place, where)
        if not end.digest:
            return older_files.verify(file, tail, end, place, where)
        # Parsing the footer takes three times as long as all digests.
        if tuple(map(xxh3_128_digest, row_groups(file, end))) == end.digests:
            return True
        if tuple(map(xxh3_128_digest, row_groups(file, end, parsed(end, where)))) != end.digests:
            raise damaged(where, "its bytes differ from those that were written")
    return True


def parsed(end: FileEnd, url: Path | str) -> pq.FileMetaData:
    """The footer of a file whose end is verified."""
    with reading(url):
        return pq.read_metadata(pa.BufferReader(end.footer))


def check_end(end: bytes, size: int, place: Place, url: Path | str) -> FileEnd | None:
    """The verified end of a file of which only the last bytes have been read; None for a file that has to be read.

    Args:
        end: Its last bytes: at least :func:`needed`, or the whole file.
        size: Bytes of the file.
        place: Where it belongs.
        url: Its path or URL, for errors.

    Raises:
        LakeError: It is damaged, or not the file that was published at this place.
    """
    found = _checked(end, size, place, url)
    return found if found.digest or older_files.verify_footer(end, found, place, url) else None


def _checked(end: bytes, size: int, place: Place, url: Path | str) -> FileEnd:
    """The end of a file; if the file is sealed, its footer is verified."""
    found = split(end, size, url)
    if found.digest and found.digest != xxh3_128_digest(b"".join((*found.digests, found.footer, covered(place)))):
        raise damaged(url, "its footer differs from the one that was written under this name in this lake")
    return found


def needed(tail: bytes) -> int:
    """Bytes at the end of a file that :func:`check_end` needs, unless it has thousands of row groups.

    Args:
        tail: At least the last 8 bytes of the file; with more of them, the number of row groups counts as well.
    """
    length = int.from_bytes(tail[-TAIL:-4], "little") + TAIL
    before = tail[-length - _SEAL : -length]
    count = (
        int.from_bytes(before[8:16], "little") if before[:8] == _MAGIC else 1
    )  # the seal of version 0.2 has 40 bytes
    return max(length + _SEAL + _DIGEST * count, WINDOW)


def row_groups(file: BinaryIO, end: FileEnd, metadata: pq.FileMetaData | None = None) -> Iterator[bytes]:
    """Bytes of each row group of a file; a file without any is one piece.

    Args:
        file: The file.
        end: Its end.
        metadata: Its footer; without it, row groups are found by the looks of a footer that Arrow wrote, which may be
            wrong.
    """
    starts = [0]
    if metadata:
        for number in range(1, metadata.num_row_groups):
            column = metadata.row_group(number).column(0)
            starts.append(min(column.data_page_offset, column.dictionary_page_offset or column.data_page_offset))
    else:
        for varint in _GROUP.findall(end.footer)[1:]:
            number = 0
            for byte in reversed(varint):
                number = number << 7 | byte & 127
            starts.append(min(number >> 1, end.body))
    for start, stop in pairwise([*starts, end.body]):
        file.seek(start)
        yield file.read(max(stop - start, 0))


def last(file: BinaryIO) -> tuple[bytes, int]:
    """Last bytes of a file, as many as :func:`check_end` needs, and its size."""
    size = file.seek(0, os.SEEK_END)
    end, wanted = b"", min(WINDOW, size)
    while len(end) < wanted:
        file.seek(size - wanted)
        end = file.read(wanted)
        wanted = min(needed(end), size)
    return end, size


def split(end: bytes, size: int, url: Path | str) -> FileEnd:
    """Find footer and seal at the end of a file.

    Raises:
        LakeError: It does not end like a Parquet file.
    """
    length = int.from_bytes(end[-TAIL:-4], "little") + TAIL
    if end[-4:] != _PARQUET or length + len(_PARQUET) > size:
        raise damaged(url, "it is no Parquet file, or cut off")
    footer, before = end[-length:], end[:-length]
    fixed = before[-_SEAL:]
    if not fixed.startswith(_MAGIC):
        return FileEnd(footer, size - length)
    listed = _DIGEST * int.from_bytes(fixed[8:16], "little")
    if listed > len(before) - _SEAL:
        raise damaged(url, "its seal is destroyed")
    digests = before[len(before) - _SEAL - listed : -_SEAL]
    parts = struct.unpack(f"{_DIGEST}s" * (listed // _DIGEST), digests)
    return FileEnd(footer, size - length - _SEAL - listed, parts, fixed[16:])


def covered(place: Place) -> bytes:
    """Bytes for its place that the digest of a file covers."""
    return f"{place.lake}/{place.name}".encode()


class NewerFormat(Exception):
    """A file was written by a newer version of this software."""


def seal_json(content: Mapping[str, Any], place: Place) -> bytes:
    """Bytes of a JSON file with its format and digest.

    The last entry, ``digest``, is the XXH3-128 of the file's bytes with zeros in its place, followed by the file's
    place. ``format`` is 3. Version 0.2 wrote format 2, whose digest covers the name alone, and version 0.1 no digest.

    Args:
        content: JSON-serialisable.
        place: Where it will be published.
    """
    blank = json.dumps({"format": FORMAT, **content, "digest": _ZEROS.decode()}, indent=1).encode()
    head, _, end = blank.rpartition(_ZEROS)
    return head + xxh3_128_hexdigest(blank + covered(place)).encode() + end


def read_json(data: bytes, place: Place) -> tuple[dict[str, Any], bool]:
    """Content of a JSON file without format and digest, and whether it has a seal of the present version.

    Args:
        data: Bytes of the file.
        place: Where it belongs.

    Raises:
        ValueError: It is damaged, or not the file that was published at this place; the message states the reason.
        NewerFormat: It is intact, and of a format that this version does not know.
    """
    try:
        content = json.loads(data)
    except RecursionError as error:
        raise ValueError("its JSON is nested too deeply") from error
    except UnicodeDecodeError as error:
        raise ValueError(f"its byte {error.start} is of no text") from error
    if not isinstance(content, dict):
        raise ValueError("it holds no JSON object")
    version, digest = content.pop("format", 1), content.pop("digest", None)
    if digest is None and version not in (1, 2, FORMAT):
        raise NewerFormat(f"written in format {version!r}, not {FORMAT}")
    if version in (1, 2) and not place.may_be_older:
        raise ValueError("it is of another lake")
    if version == 1 and digest is None:
        return content, False
    head, found, end = data.rpartition(str(digest).encode())
    named = place.name.encode() if version == 2 else covered(place)
    if not found or digest != xxh3_128_hexdigest(head + _ZEROS + end + named):
        raise ValueError("its bytes differ from those that were written under this name in this lake")
    if version not in (2, FORMAT):
        raise NewerFormat(f"written in format {version!r}, not {FORMAT}")
    return content, version == FORMAT
