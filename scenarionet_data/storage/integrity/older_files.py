"""Files of older versions of this software: the only module that knows how these are verified.

Version 0.2 put digests of the footer and of all other bytes before the footer, each followed by the file's name.
Version 0.1 had no seals: files of tables that are named by their content are compared with the digest in the name; of
the others, Arrow reads every row before anything else looks at the footer, whose errors Arrow then raises instead of
ending the process, and rows are compared with their folder.
"""

from __future__ import annotations

import hashlib
import re
from io import BufferedReader
from pathlib import Path

import pyarrow.parquet as pq
from xxhash import xxh3_128, xxh3_128_digest

from scenarionet_data.storage.files.errors import damaged, reading
from scenarionet_data.storage.integrity.file_end import MARK, WINDOW, FileEnd, Place

_NAMED_BY_CONTENT = re.compile(r"(?:tracks|lights|maps|quarantine|defects)/.*-([0-9a-f]{16})\.parquet")
_MAGIC = b"SNSEAL\x00\x01"
_DIGEST = 16
_SEAL = len(_MAGIC) + 2 * _DIGEST
_BLOCK = 2**18
_RATIO = 2**15
"""A block of zstd takes 4 bytes or more and holds at most 128 KiB; that of LZ4 less."""


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
    digest = verify_footer(tail, end, place, url)
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
        _read_rows(file, end.body, place.name, url)
        return False
    if not is_whole:
        raise damaged(url, "its bytes differ from those that were written under this name")
    return True


def verify_footer(tail: bytes, end: FileEnd, place: Place, url: Path | str) -> bytes | None:
    """Digest of all bytes before the seal of version 0.2, whose footer is verified; None for a file without one.

    Raises:
        LakeError: The footer or the seal is damaged, or the file is of another lake.
    """
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


def _read_rows(file: BufferedReader, body: int, name: str, url: Path | str) -> None:
    """Read every row, and check that those of a metadata file belong to its folder: two files may have been exchanged.

    Raises:
        LakeError: Arrow cannot read it, it has other rows than its footer says, or rows of another folder.
    """
    wanted = dict(part.split("=", 1) for part in name.split("/") if "=" in part) if name.startswith("metadata/") else {}
    with reading(url):
        content = pq.ParquetFile(file)
        footer = content.metadata
        groups = [footer.row_group(number) for number in range(footer.num_row_groups)]
        for group in groups:  # Arrow allocates its rows; every table has a column in which each takes a bit or more
            if not 0 <= group.num_rows <= 8 * min(group.total_byte_size, _RATIO * body):
                raise damaged(url, f"its footer says {group.num_rows:,} rows in {group.total_byte_size:,} bytes")
        if footer.num_rows != sum(group.num_rows for group in groups):
            raise damaged(url, f"its footer says {footer.num_rows:,} rows, its row groups others")
        rows = content.read(use_threads=False)
        rows.validate(full=True)
        if not set(wanted).issubset(rows.column_names):
            raise damaged(url, "it is a file of another table")
    if any(set(rows[column].to_pylist()) - {value} for column, value in wanted.items()):
        raise damaged(url, "its rows belong to another folder")
