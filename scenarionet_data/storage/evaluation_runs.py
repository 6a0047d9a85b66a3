"""Evaluation runs: results of simulations in ``results/<run>/<table>/<part>.parquet``, outside snapshots.

A run is claimed by an immutable description, ``run.json``; only a run with the same description can continue it. A run
consists of parts. The file of a part in the last table is published last and marks the part as done, so that an
interrupted run continues with the missing parts.
"""

from __future__ import annotations

import re
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import pyarrow as pa

from scenarionet_data.errors import BadParameter, LakeError, SchemaMismatch
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity import seals
from scenarionet_data.storage.integrity.seals import NewerFormat
from scenarionet_data.storage.write.table_file import publish_table

RUN_TABLES = ("results", "rollouts", "observations", "frames", "training")
_FOLDER = "results"
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class EvaluationRun:
    """A run that this process contributes to.

    Attributes:
        files: The lake.
        name: Name of the run.
        tables: Tables of each part; a file in the last one marks the part as done.
    """

    files: LakeFiles
    name: str
    tables: tuple[str, ...]

    def done(self) -> set[int]:
        """Numbers of the finished parts."""
        return set(self._parts(self.tables[-1]))

    def failed(self) -> set[int]:
        """Numbers of the finished parts of ``results`` with a scenario that could not be simulated."""
        parts = self._parts("results")
        errors = self.files.read_all(list(parts.values()), ["error"])
        return {part for part, rows in zip(parts, errors, strict=True) if rows["error"].null_count < len(rows)}

    def publish(self, part: int, rows: Mapping[str, Sequence[Mapping[str, Any]] | pa.Table]) -> None:
        """Publish a part: rows of each of the tables, without the column ``run``."""
        for table in self.tables:
            schema = tables.load(table).schema
            found = rows[table]
            if not isinstance(found, pa.Table):
                kept = schema.remove(schema.get_field_index("run"))
                found = pa.Table.from_pylist([dict(row) for row in found], schema=kept)
            named = found.add_column(0, schema.field("run"), pa.array([self.name] * found.num_rows, pa.string()))
            name = f"{self._folder(table)}/{part:06d}.parquet"
            publish_table(self.files, table, named.select(schema.names), {}, name)

    def _parts(self, table: str) -> dict[int, str]:
        """Files of a table by the number of their part."""
        names = self.files.names(self._folder(table), ".parquet")
        stems = {name.rpartition("/")[2].removesuffix(".parquet"): name for name in names}
        return {int(stem): name for stem, name in stems.items() if stem.isdecimal()}

    def _folder(self, table: str) -> str:
        return f"{_FOLDER}/{self.name}/{table}"


def claim(files: LakeFiles, name: str, run_tables: tuple[str, ...], description: Mapping[str, Any]) -> EvaluationRun:
    """Start a run, or continue it.

    Args:
        files: The lake.
        name: Name of the run.
        run_tables: The tables of RUN_TABLES that it fills, see :class:`EvaluationRun`.
        description: Everything that the results depend on, JSON-serialisable.

    Raises:
        BadParameter: The name has other characters than letters, digits, ".", "_" and "-", or belongs to a run with
            another description.
    """
    if not (isinstance(name, str) and _NAME.fullmatch(name)):
        raise BadParameter(f"{name!r} is not a valid name of a run; use letters, digits, '.', '_' and '-'")
    wanted = dict(description) | {"tables": [tables.load(table).tag for table in run_tables]}
    content = wanted | {"id": uuid.uuid4().hex}  # which the seals of its files cover
    if not files.publish_new(file_name(name), seals.seal_json(content, files.place_to_write(file_name(name)))):
        found = describe(files, name)
        found.pop("id", None)
        differing = sorted(key for key in {*found, *wanted} if found.get(key) != wanted.get(key))
        if differing:
            key = differing[0]
            raise BadParameter(
                f"a run {name!r} exists with {key} {found.get(key)!r}, not {wanted.get(key)!r}; choose another name",
                cli_remedy="--name NAME",
            )
    return EvaluationRun(files, name, run_tables)


def names(files: LakeFiles) -> list[str]:
    """Runs of a lake, sorted."""
    return files.folders(_FOLDER)


def describe(files: LakeFiles, name: str) -> dict[str, Any]:
    """Description of a run.

    Raises:
        LakeError: It is missing or damaged.
    """
    return parse(files, name)[0]


def parse(files: LakeFiles, name: str) -> tuple[dict[str, Any], bool]:
    """Description of a run, and whether it is sealed, and therefore verified.

    Raises:
        LakeError: It is missing or damaged, or was written by a newer version of this software.
    """
    path = files.path(file_name(name))
    try:
        content, is_sealed = seals.read_json(files.content(file_name(name)), files.place(file_name(name)))
        if not all(isinstance(tag, str) for tag in content["tables"]):
            raise ValueError("its tables are no texts")
        return content, is_sealed
    except NewerFormat as error:
        raise LakeError(f"{path}: {error}, by a newer version of this software; update it") from error
    except (ValueError, KeyError, TypeError) as error:
        raise LakeError(
            f"{path}: damaged, it is no description of a run ({error}); restore it from a copy of the lake, or "
            "remove the folder of the run and simulate again"
        ) from error


def file_name(name: str) -> str:
    """File of a run's description."""
    return f"{_FOLDER}/{name}/run.json"


def begun_at(files: LakeFiles, name: str) -> int | None:
    """Snapshot that a run reads; None if there is no such run, or it reads none."""
    return describe(files, name).get("snapshot") if name in names(files) else None


def rows(files: LakeFiles, name: str, table: str) -> pa.Table:
    """Return all rows of one of RUN_TABLES of a run, part by part; none if it does not fill the table."""
    declared = tables.load(table)
    parts = files.read_all(files.names(f"{_FOLDER}/{name}/{table}", ".parquet"))
    return pa.concat_tables([declared.schema.empty_table(), *(declared.conform(part) for part in parts)])


def part_files(files: LakeFiles, table: str) -> list[str]:
    """Files of one of RUN_TABLES in all runs, relative to the lake.

    Raises:
        SchemaMismatch: A run was written under a schema version that cannot be read.
    """
    found = []
    for name in names(files):
        parts = files.names(f"{_FOLDER}/{name}/{table}", ".parquet")
        declared = tables.load(table)
        if parts and not any(map(declared.reads, describe(files, name)["tables"])):
            raise SchemaMismatch(
                f"{files.root}/{_FOLDER}/{name}: written under another version of the table {table}, this version "
                f"reads {declared.tag}; remove that folder and simulate again"
            )
        found += parts
    return found
