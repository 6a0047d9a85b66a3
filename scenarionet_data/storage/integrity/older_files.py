"""Files of older versions of this software: the only module that knows how these are verified.

Version 0.2 put digests of the footer and of all other bytes before the footer, each followed by the file's name.
Version 0.1 had no seals: files of tables that are named by their content are compared with the digest in the name; of
the others, footer and page headers are checked against themselves and the size of the file, because Arrow may end the
process over a damaged one, and rows are compared with their folder.
"""

from __future__ import annotations

import hashlib
import re
from io import BufferedReader
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from xxhash import xxh3_128, xxh3_128_digest

from scenarionet_data.storage.files.errors import damaged
from scenarionet_data.storage.integrity.file_end import MARK, TAIL, WINDOW, FileEnd, Place
from scenarionet_data.storage.integrity.footers.checks import check_footer
from scenarionet_data.storage.integrity.footers.pages import check_chunk
from scenarionet_data.storage.integrity.footers.thrift import Malformed

_NAMED_BY_CONTENT = re.compile(r"(?:tracks|lights|maps|quarantine|defects)/.*-([0-9a-f]{16})\.parquet")
_MAGIC = b"SNSEAL\x00\x01"
_DIGEST = 16
_SEAL = len(_MAGIC) + 2 * _DIGEST
_BLOCK = 2**18


def verify(file: BufferedReader, tail: bytes, end: FileEnd, place: Place, url: Path | str) -> bool:
    """Verify a local file that has no seal of the present version.

    Args:
        file: The file.
        tail: Its last bytes.
        end: Its end.
        place: Where it belongs.
        url: Its path or URL, for errors.

    Returns:
        Whether every byte is verified.

    Raises:
        LakeError: It is damaged, or not the file that was published at this place.
    """
    digest = _digest_of_body(tail, end, place, url)
    file.seek(0)
    if digest is not None:
        body, left = xxh3_128(), end.body - _SEAL
        while left > 0 and (block := file.read(min(left, _BLOCK))):
            body.update(block)
            left -= len(block)
        body.update(place.name.encode())
        is_whole = body.digest() == digest
    elif by_content := _NAMED_BY_CONTENT.fullmatch(place.name):
        is_whole = hashlib.file_digest(file, "sha256").hexdigest().startswith(by_content[1])
    else:
        _check_pages(memoryview(file.read()), _check_footer(end, url), url)
        if place.name.startswith("metadata/"):
            _check_partition(file, place.name, url)
        return False
    if not is_whole:
        raise damaged(url, "its bytes differ from those that were written under this name")
    return True


def check_end(tail: bytes, end: FileEnd, place: Place, url: Path | str) -> FileEnd:
    """Verify as much of such a file in an object store as its last bytes allow; see :func:`verify`."""
    if _digest_of_body(tail, end, place, url) is None:
        _check_footer(end, url)
    return end


def _digest_of_body(tail: bytes, end: FileEnd, place: Place, url: Path | str) -> bytes | None:
    """Digest of all bytes before the seal of version 0.2, whose footer is verified; None for a file without one."""
    if not place.may_be_older:
        raise damaged(url, "it has no seal of this lake: its seal is destroyed, or it is of another lake")
    before = tail[: -len(end.footer)][-_SEAL:]
    if not before.startswith(_MAGIC):
        if MARK in tail[-max(len(end.footer), WINDOW) :]:
            raise damaged(url, "its seal is destroyed")
        return None
    digests = before[len(_MAGIC) :]
    if digests[:_DIGEST] != xxh3_128_digest(end.footer + place.name.encode()):
        raise damaged(url, "its footer differs from the one that was written under this name")
    return digests[_DIGEST:]


def _check_footer(end: FileEnd, url: Path | str) -> list[dict[str, Any]]:
    try:
        return check_footer(end.footer[:-TAIL], end.body)
    except Malformed as error:
        raise damaged(url, f"its footer is damaged, {error}") from error


def _check_pages(content: memoryview, columns: list[dict[str, Any]], url: Path | str) -> None:
    """Check the sizes of all pages, which are allocated before they are read."""
    for column in columns:
        try:
            check_chunk(content, column)
        except Malformed as error:
            raise damaged(url, f"its column {column['path'][0]} is damaged, {error}") from error


def _check_partition(file: BufferedReader, name: str, url: Path | str) -> None:
    """Check that the rows of a metadata file belong to its folder: two files may have been exchanged."""
    wanted = dict(part.split("=", 1) for part in name.split("/") if "=" in part)
    file.seek(0)
    content = pq.ParquetFile(file)
    if not set(wanted).issubset(content.schema_arrow.names):
        raise damaged(url, "it is a file of another table")
    rows = content.read(list(wanted), use_threads=False)
    if any(set(rows[column].to_pylist()) - {value} for column, value in wanted.items()):
        raise damaged(url, "its rows belong to another folder")
