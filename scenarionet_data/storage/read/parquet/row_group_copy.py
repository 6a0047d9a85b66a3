"""Row groups of files as new files, byte for byte: no page is decompressed, only the footer is written anew.

Format: https://github.com/apache/parquet-format/blob/master/src/main/thrift/parquet.thrift
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.errors import reading, writing
from scenarionet_data.storage.read.parquet import thrift
from scenarionet_data.storage.read.parquet.thrift import Struct

_MAGIC = b"PAR1"
# Numbers of fields: of the file's metadata,
_SCHEMA, _NUM_ROWS, _ROW_GROUPS, _WORDS, _ORDERS = 2, 3, 4, 5, 7
# of a row group,
_COLUMNS, _GROUP_ROWS, _GROUP_OFFSET, _ORDINAL = 1, 3, 5, 7
# of a column in it,
_CHUNK_OFFSET, _CHUNK_METADATA, _PAGE_INDEXES = 2, 3, (4, 5, 6, 7)
# and of that column's metadata.
_COMPRESSED_SIZE, _DATA_PAGE, _INDEX_PAGE, _DICTIONARY_PAGE, _BLOOM_FILTER = 7, 9, 10, 11, (14, 15)


class RowGroupSource:
    """A Parquet file whose row groups are copied.

    Args:
        path: The file.

    Raises:
        LakeError: It is gone or damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with reading(path), path.open("rb") as file:
            self.content = _mapped(file)
        size = int.from_bytes(self.content[-8:-4], "little")
        if self.content[-4:] != _MAGIC or size > len(self.content) - 12:
            raise _damaged(path, "it does not end as a Parquet file")
        with _reading_footer(path):
            self.footer = thrift.decode(self.content[-8 - size : -8], unopened=[_ROW_GROUPS])
            self._groups: list[bytes] = self.footer[_ROW_GROUPS][1][1]
            pairs: list[Struct] = self.footer[_WORDS][1][1] if _WORDS in self.footer else []
            self.words = {pair[1][1]: pair[2][1] if 2 in pair else b"" for pair in pairs}

    def __len__(self) -> int:
        return len(self._groups)

    def row_group(self, number: int) -> Struct:
        """What the footer says about a row group.

        Raises:
            LakeError: There is none of that number, or it is damaged.
        """
        if not 0 <= number < len(self._groups):
            raise _damaged(self.path, f"it has {len(self._groups)} row groups, wanted is number {number}")
        with _reading_footer(self.path):
            return thrift.decode(self._groups[number])

    def num_rows(self, number: int) -> int:
        """Rows of a row group.

        Raises:
            LakeError: There is none of that number, or it is damaged.
        """
        with _reading_footer(self.path):
            return int(self.row_group(number)[_GROUP_ROWS][1])


class RowGroupWriter:
    """A new Parquet file of copied row groups, all of one schema.

    Args:
        path: Where to write.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file: BinaryIO = path.open("wb")
        self._file.write(_MAGIC)
        self._footer: Struct = {}
        self._words: dict[bytes, bytes] = {}
        self._groups: list[bytes] = []
        self._num_rows = 0

    def append(self, source: RowGroupSource, number: int) -> int:
        """Copy a row group; returns its number in this file.

        Raises:
            LakeError: The source is damaged, or of another schema than those before.
        """
        if not self._footer:
            self._footer, self._words = source.footer, source.words
        if any(self._footer.get(field) != source.footer.get(field) for field in (_SCHEMA, _ORDERS)):
            raise LakeError(f"{source.path}: of another schema than its siblings; convert its recordings again")
        group = source.row_group(number)
        _set(group, _GROUP_OFFSET, self._file.tell())
        _set(group, _ORDINAL, len(self._groups))
        with _reading_footer(source.path):
            self._num_rows += group[_GROUP_ROWS][1]
            for column in group[_COLUMNS][1][1]:
                self._copy(source, column)
            self._groups.append(thrift.encode(group))
        return len(self._groups) - 1

    def _copy(self, source: RowGroupSource, column: Struct) -> None:
        """Copy a column's pages, and say where they lie now."""
        metadata: Struct = column[_CHUNK_METADATA][1]
        offsets = [field for field in (_DATA_PAGE, _INDEX_PAGE, _DICTIONARY_PAGE) if metadata.get(field, (0, 0))[1]]
        start = min(metadata[field][1] for field in offsets)
        size = metadata[_COMPRESSED_SIZE][1]
        pages = source.content[start : start + size]
        if start < 0 or len(pages) != size:
            raise thrift.BadThrift("pages lie outside the file")
        shift = self._file.tell() - start
        for field in offsets:
            _set(metadata, field, metadata[field][1] + shift)
        if column[_CHUNK_OFFSET][1]:
            _set(column, _CHUNK_OFFSET, column[_CHUNK_OFFSET][1] + shift)
        for field in _PAGE_INDEXES:  # these lie apart from the pages; our writer makes none
            column.pop(field, None)
        for field in _BLOOM_FILTER:
            metadata.pop(field, None)
        self._file.write(pages)

    def close(self, words: Mapping[str, str | None]) -> None:
        """Write the footer: that of the first source, with these words added, changed or (None) taken out."""
        kept = self._words | {key.encode(): value.encode() for key, value in words.items() if value is not None}
        gone = {key.encode() for key, value in words.items() if value is None}
        pairs: list[Struct] = [
            {1: (thrift.BINARY, key), 2: (thrift.BINARY, value)} for key, value in kept.items() if key not in gone
        ]
        changed: Struct = {
            _NUM_ROWS: (thrift.I64, self._num_rows),
            _ROW_GROUPS: (thrift.LIST, (thrift.STRUCT, self._groups)),
            _WORDS: (thrift.LIST, (thrift.STRUCT, pairs)),
        }
        footer = thrift.encode(dict(sorted((self._footer | changed).items())))
        with writing(self.path), self._file as file:
            file.write(footer + len(footer).to_bytes(4, "little") + _MAGIC)

    def discard(self) -> None:
        """Remove the unfinished file."""
        self._file.close()
        self.path.unlink(missing_ok=True)


def _mapped(file: BinaryIO) -> mmap.mmap | bytes:
    """A file's content; an empty file cannot be mapped."""
    try:
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except ValueError:
        return b""


def _set(content: Struct, field: int, value: int) -> None:
    """Change a number, where there is one."""
    if field in content:
        content[field] = content[field][0], value


@contextmanager
def _reading_footer(path: Path) -> Iterator[None]:
    """Turns what a footer with other bytes than were written provokes into a LakeError."""
    try:
        yield
    except (ValueError, KeyError, IndexError, TypeError, OverflowError, RecursionError) as error:
        raise _damaged(path, "its footer cannot be understood") from error


def _damaged(path: Path, reason: str) -> LakeError:
    return LakeError(f"{path}: {reason}; restore it from a copy of the lake, or convert its recordings again")
