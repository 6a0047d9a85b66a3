"""Copy rows of scenarios into another file, and update their addresses in the metadata."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading, writing
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.integrity.file_end import MARK, Place
from scenarionet_data.storage.read.scenario_rows import RowAddress, ScenarioRows

MAP_FOOTER = ("scenarionet.map", "scenarionet.licence")
"""Entries in the footer of a shared map."""

_PROVENANCE = (b"scenarionet.source", b"scenarionet.converter", b"scenarionet.licence", b"scenarionet.frame")


def addresses(metadata: pa.Table, table: str) -> list[RowAddress]:
    """Addresses of each scenario's rows in a table."""
    columns = (metadata[f"{table}_{part}"].to_pylist() for part in RowAddress._fields)
    return list(map(RowAddress, *columns))


def copy_rows(
    source: ScenarioRows,
    table: str,
    chosen: Sequence[RowAddress],
    path: Path,
    footer: Mapping[str, str],
    scenarios_per_group: int = 1,
) -> list[RowAddress]:
    """Write the rows of some scenarios to a new file.

    Args:
        source: Reader of the table.
        table: Name of the table.
        chosen: Addresses of the rows, in the order in which they are written; at least one.
        path: Path of the file.
        footer: Entries for its footer.
        scenarios_per_group: Scenarios in a row group.

    Returns:
        The new addresses, with the path as the file.
    """
    declared = tables.load(table)
    copied: list[RowAddress] = []
    with ExitStack() as stack:
        writer = None
        for group, start in enumerate(range(0, len(chosen), scenarios_per_group)):
            parts = [source.read(address) for address in chosen[start : start + scenarios_per_group]]
            rows = declared.conform(pa.concat_tables(parts, promote_options="default"))
            writer = writer or stack.enter_context(declared.writer(path, footer, rows))
            writer.write_table(rows, row_group_size=rows.num_rows)
            first = 0
            for part in parts:
                copied.append(RowAddress(str(path), group, first, part.num_rows))
                first += part.num_rows
    return copied


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


def with_addresses(metadata: pa.Table, table: str, file: str, copied: Mapping[int, RowAddress]) -> pa.Table:
    """Metadata with new addresses in one table.

    Args:
        metadata: Rows of the metadata table.
        table: Name of the table.
        file: The new file's name.
        copied: New addresses by row number; scenarios without rows in the table have none.
    """
    new = [copied.get(number) for number in range(metadata.num_rows)]
    values = {
        "file": pa.array([None if address is None else file for address in new], pa.string()),
        "row_group": pa.array([None if address is None else address.row_group for address in new], pa.int32()),
        "first_row": pa.array([None if address is None else address.first_row for address in new], pa.int32()),
    }
    for part, column in values.items():
        name = f"{table}_{part}"
        metadata = metadata.set_column(metadata.column_names.index(name), name, column)
    return metadata


def provenance(files: LakeFiles, names: Iterable[str]) -> dict[str, str]:
    """Footer entries that describe the origin of the rows, from the first of some files that has each."""
    found: dict[str, str] = {}
    for name in names:
        footer = files.footer(name).metadata
        found = {key.decode(): footer[key].decode() for key in _PROVENANCE if key in footer} | found
    return found
