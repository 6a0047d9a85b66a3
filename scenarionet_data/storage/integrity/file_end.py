"""The end of a Parquet file, which shows whether and how it is sealed; see :mod:`.seals`."""

from __future__ import annotations

from typing import NamedTuple

from scenarionet_data.schema import tables

MARK = next(iter(tables.SEALED)).encode()
"""Key in the footer of sealed files."""

WINDOW = 2**16
"""Bytes at the end of a file that show whether it is sealed, even if the length of its footer is damaged."""

TAIL = 8
"""Bytes behind the footer: its length, and the magic bytes."""


class Place(NamedTuple):
    """What a seal covers besides bytes.

    Attributes:
        name: The file, relative to the lake.
        lake: Id of the lake, and of the run if it belongs to one; empty for files that snapshots list, whose names
            depend on their content, and which are equal in all lakes.
        may_be_older: Whether the lake may have a file here that a version without these seals has written.
    """

    name: str
    lake: str = ""
    may_be_older: bool = True


class FileEnd(NamedTuple):
    """The end of a Parquet file.

    Attributes:
        footer: The footer, with its length and the magic bytes at the end.
        body: Number of bytes before the seal, or before the footer of a file without a seal of this version.
        digests: Digest of each row group; empty without a seal.
        digest: Digest of the seal, which identifies the file's content; empty without a seal.
    """

    footer: bytes
    body: int
    digests: tuple[bytes, ...] = ()
    digest: bytes = b""
