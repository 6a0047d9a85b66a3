"""Verify files before anything parses them: the footer whenever it is opened, all bytes once a process.

Row groups of the large tables are compared with their digests when they are read instead, see :mod:`.seals`.
"""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.storage.files.errors import check_is_file, reading
from scenarionet_data.storage.integrity import older_files, seals
from scenarionet_data.storage.integrity.seals import FileEnd, Place

_verified: dict[Path, tuple[tuple[int, ...], bool]] = {}
"""Files that this process has verified: what identified them then, and whether every byte is."""


def open_end(path: Path, place: Place) -> FileEnd:
    """The verified end of a local file.

    Raises:
        LakeError: It is missing or damaged, or not the file that was published at this place.
    """
    check_is_file(path)
    with reading(path), path.open("rb") as file:
        tail, size = seals.last(file)
    end = seals.check_end(tail, size, place, path)
    if not end.digest:
        verify(path, place)
    return end


def check_end(tail: bytes, size: int, place: Place, url: str) -> FileEnd:
    """The verified end of a file of which only the last bytes have been read; see :func:`.seals.check_end`."""
    end = seals.check_end(tail, size, place, url)
    return end if end.digest else older_files.check_end(tail, end, place, url)


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
        tail, size = seals.last(file)
        end = seals.check_end(tail, size, place, where)
        if not end.digest:
            return older_files.verify(file, tail, end, place, where)
        seals.verify_groups(file, end, where)
    return True


def parsed(end: FileEnd, url: Path | str) -> pq.FileMetaData:
    """The footer of a file whose end is verified."""
    with reading(url):
        return pq.read_metadata(pa.BufferReader(end.footer))
