"""Who reads row groups of a lake's files: from files on this machine, or by byte ranges from an object store."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol

from scenarionet_data import tables
from scenarionet_data.codec import LoadedRows
from scenarionet_data.store.files import LakeFiles
from scenarionet_data.store.row_groups import RowGroups

_OPEN_FILES = 32

Address = tuple[str, str, int]
"""Table, file and number of a row group."""


class RowGroupReader(Protocol):
    """Reads row groups of many files; for one thread."""

    def fetch(self, addresses: Iterable[Address]) -> None:
        """Have row groups at hand that are read next."""

    def read(self, address: Address) -> LoadedRows:
        """One row group.

        Raises:
            OSError: Its file is gone or damaged.
            SchemaMismatch: Its file is of another version of the table.
        """


def open_reader(files: LakeFiles, columns: Mapping[str, Sequence[str]]) -> RowGroupReader:
    """A reader of a lake's row groups.

    Args:
        files: The lake.
        columns: Names of the columns to read, by table.
    """
    return FileReader(files, columns)


class FileReader:
    """Reads files on this machine, the least recently used of many closed."""

    def __init__(self, files: LakeFiles, columns: Mapping[str, Sequence[str]]) -> None:
        self._files = files
        self._columns = columns
        self._open: OrderedDict[str, RowGroups] = OrderedDict()

    def fetch(self, addresses: Iterable[Address]) -> None:
        """Nothing: files are mapped."""

    def read(self, address: Address) -> LoadedRows:
        """One row group."""
        table, name, number = address
        opened = self._open.get(name)
        if opened is None:
            path = self._files.path(name)
            opened = self._open[name] = RowGroups.open(path, tables.load(table), self._columns[table])
            if len(self._open) > _OPEN_FILES:
                self._open.popitem(last=False)[1].close()
        self._open.move_to_end(name)
        return opened.read(number)
