"""Copy rows of scenarios into another file, and update their addresses in the metadata."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping
from contextlib import ExitStack
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.errors import LakeError
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading, writing
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.integrity.file_end import MARK, Place
from scenarionet_data.storage.integrity.seals import Sealed
from scenarionet_data.storage.read.scenario_rows import RowAddress, ScenarioRows
from scenarionet_data.storage.snapshots.shard_record import partition
from scenarionet_data.storage.write.table_file import publish_data

MAP_FOOTER = ("scenarionet.map", "scenarionet.licence")
"""Entries in the footer of a shared map."""

_PROVENANCE = (b"scenarionet.source", b"scenarionet.converter", b"scenarionet.licence", b"scenarionet.frame")


class FileWriter:
    """Copies rows of scenarios into new files, one of each table at a time.

    Args:
        source: Files of the rows.
        target: Files of the lake that they are copied to.
        folder: Dataset, version and split of the scenarios.
        name: Name of the files, up to their number.
        footer: Entries for their footers.
        scenarios_per_group: Scenarios in a row group.
        zstd_level: See :class:`.Layout`.

    Attributes:
        published: The files.
    """

    def __init__(
        self,
        source: LakeFiles,
        target: LakeFiles,
        folder: tuple[str, str, str],
        name: str,
        footer: Mapping[str, str],
        scenarios_per_group: int = 1,
        zstd_level: int | None = None,
    ) -> None:
        self.published: list[Sealed] = []
        self._rows = {table: ScenarioRows(source, table) for table in tables.LOADED}
        self._target, self._folder, self._name = target, folder, name
        self._footer = {**footer, "scenarionet.source": " ".join((*folder, name))}
        self._per_group, self._zstd_level = scenarios_per_group, zstd_level
        self._number = 0

    def write(self, metadata: pa.Table) -> pa.Table:
        """Copy the scenarios of some metadata rows to one file a table; returns the rows with new addresses.

        Raises:
            LakeError: A file is missing or damaged, or the lake cannot be written.
        """
        for table in tables.LOADED:
            metadata = self._copy(table, metadata)
        self._number += 1
        return metadata

    def _copy(self, table: str, metadata: pa.Table) -> pa.Table:
        columns = (metadata[f"{table}_{part}"].to_pylist() for part in RowAddress._fields)
        chosen = [(number, each) for number, each in enumerate(map(RowAddress, *columns)) if each.num_rows]
        if not chosen:
            return metadata
        declared, temporary = tables.load(table), self._target.temporary()
        footer = self._footer | {"scenarionet.num_scenarios": str(metadata.num_rows)}
        ids, held = metadata["scenario_id"].to_pylist(), list[list[str]]()
        places: list[tuple[int, int] | tuple[None, None]] = [(None, None)] * metadata.num_rows
        with writing(temporary, temporary), ExitStack() as stack:
            writer = None
            for start in range(0, len(chosen), self._per_group):
                parts, rows_of = list[pa.Table](), list[str]()
                for number, address in chosen[start : start + self._per_group]:
                    places[number] = len(held), len(rows_of)
                    parts.append(self._rows[table].read(address))
                    rows_of += [ids[number]] * parts[-1].num_rows
                held.append(rows_of)
                rows = declared.conform(pa.concat_tables(parts, promote_options="default"))
                writer = writer or stack.enter_context(declared.writer(temporary, footer, rows, self._zstd_level))
                writer.write_table(rows, row_group_size=rows.num_rows)
        key = "map_id" if table == "maps" else "scenario_id"
        with reading(temporary), pq.ParquetFile(temporary) as file:
            groups = (file.read_row_group(number, [key], use_threads=False) for number in range(file.num_row_groups))
            found = [group[key].to_pylist() for group in groups]
        if found != held:
            raise LakeError(
                f"{temporary}: read back other rows than were written; check the disk and run the command again"
            )
        stem = f"{partition(table, *self._folder)}/{self._name}-{self._number:03d}"
        self.published.append(publish_data(self._target, temporary, stem))
        row_groups, first_rows = zip(*places, strict=True)
        file = [None if group is None else self.published[-1].name for group in row_groups]
        for part, values in (("file", file), ("row_group", row_groups), ("first_row", first_rows)):
            name = f"{table}_{part}"
            new = pa.array(values, pa.string() if part == "file" else pa.int32())
            metadata = metadata.set_column(metadata.column_names.index(name), name, new)
        return metadata


def copy_groups(
    files: LakeFiles, table: str, source: str, numbers: Iterable[int], path: Path, keys: Iterable[str]
) -> None:
    """Copy row groups of a file to a new file.

    Args:
        files: Files of the source.
        table: Name of the table.
        source: The file.
        numbers: Row groups to copy, in order.
        path: Path of the new file.
        keys: Entries of the footer to copy.
    """
    declared, place = tables.load(table), files.verified(source)
    with reading(place), pq.ParquetFile(place) as file:
        words = file.metadata.metadata
        footer = {key: words[key.encode()].decode() for key in keys if key.encode() in words}
        with writing(path, path), declared.writer(path, footer) as writer:
            for number in numbers:
                rows = declared.conform(file.read_row_group(number, use_threads=False))
                writer.write_table(rows, row_group_size=max(rows.num_rows, 1))


def copy_sealed(files: LakeFiles, name: str, path: Path, place: Place) -> None:
    """Copy a file that belongs to another place, or has no seal of the present version, and seal it there.

    Args:
        files: Files of the source.
        name: The file.
        path: Path of the copy.
        place: Where it will be published.

    Raises:
        LakeError: The file is missing or damaged, or the copy cannot be written.
    """
    source = files.verified(name)
    with reading(source), pq.ParquetFile(source) as file, writing(path, path):
        words = {key.decode(): value.decode() for key, value in (file.metadata.metadata or {}).items()}
        if MARK.decode() in words:
            shutil.copyfile(source, path)
        else:  # of version 0.1, whose footers have no entry for a seal
            tag, rows = words.pop("scenarionet.schema", ""), file.read()
            words.pop("ARROW:schema", None)
            if tag:
                declared, size = tables.load(tag.partition("/")[0]), -(-rows.num_rows // max(file.num_row_groups, 1))
                with declared.writer(path, words) as writer:
                    writer.write_table(declared.conform(rows), row_group_size=max(size, 1))
            else:
                pq.write_table(rows.replace_schema_metadata({**words, **tables.SEALED}), path, compression="zstd")
        seals.seal(path, place)


def provenance(files: LakeFiles, names: Iterable[str]) -> dict[str, str]:
    """Footer entries that describe the origin of the rows, from the first of some files that has each."""
    found: dict[str, str] = {}
    for name in names:
        footer = files.footer(name).metadata
        found = {key.decode(): footer[key].decode() for key in _PROVENANCE if key in footer} | found
    return found
