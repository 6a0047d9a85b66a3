"""Runs: what simulations leave in a lake, apart from snapshots, in ``results/<run>/<table>/<part>.parquet``.

A run is claimed by its description, ``run.json``, which never changes; only the same work may go on with it. Its work
comes in parts. The file of a part in the run's last table is published last: its presence says that the part is
done, so that a run that was killed goes on with what is missing.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from scenarionet_data.errors import BadParameter, SchemaMismatch
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.write.table_file import write_table

RUN_TABLES = ("results", "rollouts", "observations")
_FOLDER = "results"
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class Run:
    """A run that this process works for.

    Attributes:
        files: The lake.
        name: Of the run.
        tables: What each part is written to, the table that says that it is done last.
    """

    files: LakeFiles
    name: str
    tables: tuple[str, ...]

    def done(self) -> set[int]:
        """Numbers of the finished parts."""
        names = self.files.names(self._folder(self.tables[-1]), ".parquet")
        return {int(name.rpartition("/")[2].removesuffix(".parquet")) for name in names}

    def publish(self, part: int, rows: Mapping[str, Sequence[Mapping[str, Any]] | pa.Table]) -> None:
        """Publish a part: rows of each of the tables, without the column ``run``."""
        for table in self.tables:
            schema = tables.load(table).schema
            found = rows[table]
            content = found if isinstance(found, pa.Table) else _table(found, schema)
            named = content.add_column(0, schema.field("run"), pa.array([self.name] * content.num_rows, pa.string()))
            temporary = write_table(self.files, table, named.select(schema.names), {})
            self.files.publish(temporary, f"{self._folder(table)}/{part:06d}.parquet")

    def _folder(self, table: str) -> str:
        return f"{_FOLDER}/{self.name}/{table}"


def claim(files: LakeFiles, name: str, run_tables: tuple[str, ...], description: Mapping[str, Any]) -> Run:
    """Begin a run, or go on with it.

    Args:
        files: The lake.
        name: Of the run.
        run_tables: Which of RUN_TABLES it fills, see :class:`Run`.
        description: All that its results depend on, JSON-able.

    Raises:
        BadParameter: The name is no plain word, or is taken by a run of another description.
    """
    if not _NAME.fullmatch(name):
        raise BadParameter(f"{name!r} is no name of a run; use letters, digits, '.', '_' and '-'")
    wanted = dict(description) | {"tables": [tables.load(table).tag for table in run_tables]}
    data = json.dumps(wanted, indent=1, sort_keys=True).encode()
    if not files.publish_new(f"{_FOLDER}/{name}/run.json", data):
        found = describe(files, name)
        differing = sorted(key for key in {*found, *wanted} if found.get(key) != wanted.get(key))
        if differing:
            key = differing[0]
            raise BadParameter(
                f"a run {name!r} is there with {key} {found.get(key)!r}, not {wanted.get(key)!r}; choose another name"
            )
    return Run(files, name, run_tables)


def names(files: LakeFiles) -> list[str]:
    """Runs of a lake, sorted."""
    return files.folders(_FOLDER)


def describe(files: LakeFiles, name: str) -> dict[str, Any]:
    """What a run was claimed with."""
    description: dict[str, Any] = json.loads(files.path(f"{_FOLDER}/{name}/run.json").read_bytes())
    return description


def part_files(files: LakeFiles, table: str) -> list[str]:
    """Files of one of RUN_TABLES, of every run, relative to the lake.

    Raises:
        SchemaMismatch: A run was written under another version of the contract.
    """
    found = []
    for name in names(files):
        parts = files.names(f"{_FOLDER}/{name}/{table}", ".parquet")
        tag = tables.load(table).tag
        if parts and tag not in describe(files, name)["tables"]:
            raise SchemaMismatch(
                f"{files.root}/{_FOLDER}/{name}: written under another version of the table {table}, this version "
                f"reads {tag}; remove that folder and simulate again"
            )
        found += parts
    return found


def _table(rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> pa.Table:
    return pa.Table.from_pylist([dict(row) for row in rows], schema=schema.remove(schema.get_field_index("run")))
