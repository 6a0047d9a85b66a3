"""Verify single files of a lake: size, checksum, seal and footer."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Int64
from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity.seals import parsed


@dataclass(frozen=True)
class Written:
    """Size and checksum of a file when it was written; None if unknown.

    Attributes:
        size: Bytes.
        checksum: SHA-256, hexadecimal.
    """

    size: int | None = None
    checksum: str | None = None


@dataclass(frozen=True)
class Damage:
    """Damage of a file.

    Attributes:
        file: Its name, relative to the lake.
        reason: What was expected and what was found.
    """

    file: str
    reason: str


@dataclass(frozen=True)
class Intact:
    """A file without damage.

    Attributes:
        is_older: Whether it has no seal of the present version, and may have changed unnoticed.
        footer: Key-value metadata of its footer.
        groups: Rows of each row group.
    """

    is_older: bool
    footer: dict[bytes, bytes]
    groups: Int64


def check_file(
    files: LakeFiles,
    name: str,
    written: Written,
    *,
    table: str | None,
    is_deep: bool,
    digest: Callable[[str], str] | None = None,
) -> Intact:
    """Verify a Parquet file.

    Args:
        files: The lake.
        name: The file.
        written: Its size and checksum, as far as they are recorded.
        table: Its table; None for a user column.
        is_deep: Whether to verify every byte.
        digest: Returns the SHA-256 of a file; computed by default.

    Raises:
        LakeError: It is damaged; the message is the reason.
    """
    found = files.size(name)
    if found is None:
        raise LakeError("gone")
    if written.size is not None and found != written.size:
        raise LakeError(f"{found:,} bytes long, was written with {written.size:,}")
    if is_deep and written.checksum is not None:
        if (digest or files.digest)(name) != written.checksum:
            raise LakeError("its bytes differ from those written: another checksum")
    elif is_deep and not files.verify(name):
        files.read(name)  # decodes every page
    end = files.end(name)
    footer = parsed(end, files.url(name))
    words = footer.metadata or {}
    if table:
        tables.load(table).check_version(words, files.url(name))
    groups = [footer.row_group(number).num_rows for number in range(footer.num_row_groups)]
    return Intact(not end.digest, words, np.array(groups, np.int64))


@contextmanager
def finding(name: str, damages: list[Damage]) -> Iterator[None]:
    """Add any error to a list of damages, as damage of a file.

    A check goes on with the other files, whatever the bytes of a damaged one do to the code that reads it.
    """
    try:
        yield
    except Exception as error:
        reason = str(error) if isinstance(error, LakeError) else f"cannot be read: {type(error).__name__}: {error}"
        damages.append(Damage(name, reason))
