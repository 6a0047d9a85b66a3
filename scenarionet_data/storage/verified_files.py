"""Files are verified before Arrow, DuckDB or our decoder read them.

Sealed files are compared with their seals: the footer whenever it is opened, the whole file once a process. Files of
older lakes have no seals: those of tables that are named by their content are compared with the digest in the
name, once a process; of the others, the footer is checked against itself and the size of the file.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.storage import seals
from scenarionet_data.storage.files.errors import damaged, reading
from scenarionet_data.storage.footers.checks import check_footer
from scenarionet_data.storage.footers.pages import check_chunk
from scenarionet_data.storage.footers.thrift import Malformed
from scenarionet_data.storage.seals import FileEnd

_NAMED_BY_CONTENT = re.compile(r"(?:tracks|lights|maps|quarantine|defects)/.*-([0-9a-f]{16})\.parquet")
_TAIL = 8
_verified: dict[Path, tuple[tuple[int, ...], bool]] = {}
"""Files that this process has verified: what identified them then, and whether every byte is."""


def open_end(path: Path, name: str) -> FileEnd:
    """The verified end of a local file.

    Args:
        path: The file.
        name: Its name, relative to the lake.

    Raises:
        LakeError: It is missing or damaged.
    """
    end = seals.read_end(path, name)
    if not end.is_sealed:
        _verify_unsealed(path, name, end)
    return end


def check_end(end: bytes, size: int, name: str, url: str) -> FileEnd:
    """The verified end of a file of which only the last bytes have been read; see :func:`.seals.check_end`."""
    found = seals.check_end(end, size, name, url)
    if not found.is_sealed:
        _check_footer(found, url)
    return found


def verify(path: Path, name: str) -> bool:
    """Verify every byte of a local file that can be, once a process.

    Args:
        path: The file.
        name: Its name, relative to the lake.

    Returns:
        Whether every byte is verified; False for files of older lakes that are not named by their content.

    Raises:
        LakeError: It is missing or damaged.
    """
    now = _identity(path)
    known, is_whole = _verified.get(path, (None, False))
    if known != now:
        is_whole = seals.verify(path, name) or _verify_unsealed(path, name, seals.read_end(path, name))
        _verified[path] = now, is_whole
    return is_whole


def parsed(end: FileEnd, url: Path | str) -> pq.FileMetaData:
    """The footer of a file whose end is verified."""
    with reading(url):
        return pq.read_metadata(pa.BufferReader(end.footer))


def _verify_unsealed(path: Path, name: str, end: FileEnd) -> bool:
    """Verify a file of an older lake by the digest in its name, else check its footer; returns whether it has one."""
    by_content = _NAMED_BY_CONTENT.fullmatch(name)
    if not by_content:
        _check_pages(path, _check_footer(end, path))
        if name.startswith("metadata/"):
            _check_partition(path, name)
        return False
    now = _identity(path)
    if _verified.get(path) != (now, True):
        with reading(path), path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        if digest[:16] != by_content[1]:
            raise damaged(path, "its bytes differ from those that were written under this name")
        _verified[path] = now, True
    return True


def _check_footer(end: FileEnd, url: Path | str) -> list[dict[str, Any]]:
    try:
        return check_footer(end.footer[:-_TAIL], end.body)
    except Malformed as error:
        raise damaged(url, f"its footer is damaged, {error}") from error


def _check_pages(path: Path, columns: list[dict[str, Any]]) -> None:
    """Check the sizes of all pages, which are allocated before they are read."""
    with reading(path):
        content = memoryview(path.read_bytes())
    for column in columns:
        try:
            check_chunk(content, column)
        except Malformed as error:
            raise damaged(path, f"its column {column['path'][0]} is damaged, {error}") from error


def _check_partition(path: Path, name: str) -> None:
    """Check that the rows of a metadata file belong to its folder: two files may have been exchanged."""
    wanted = dict(part.split("=", 1) for part in name.split("/") if "=" in part)
    with reading(path):
        rows = pq.ParquetFile(path).read(list(wanted), use_threads=False)
        found = {column: set(rows[column].to_pylist()) for column in wanted}
    if any(found[column] - {value} for column, value in wanted.items()):
        raise damaged(path, "its rows belong to another folder")


def _identity(path: Path) -> tuple[int, ...]:
    """Size, time and number of a file, by which a file that was replaced differs."""
    with reading(path):
        found = path.stat()
    return found.st_size, found.st_mtime_ns, found.st_ino
