"""Databases: named, ordered sets of scenarios that copy nothing and remember where they came from."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data import tables
from scenarionet_data.errors import BadParameter, DatabaseExists, DatabaseNotFound
from scenarionet_data.store.files import LakeFiles, reading
from scenarionet_data.store.table_file import write_table

_FOLDER = "databases"
_ROWS_PER_GROUP = 65_536  # DuckDB's threads take a group each
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class Lineage:
    """How a database was made: running its SQL again on its snapshot and parents gives the same members.

    Attributes:
        operation: filter, split, ...
        sql: The query, as it was run: over the views of the snapshot, and ``members``, the rows of all parents
            with ``parent``, the place of theirs in ``parents``.
        parameters: Values of ``$name`` in it, the seed among them.
        parents: ``name@version`` of the databases it was made from; empty for the whole lake.
        snapshot: Number of the snapshot it was made on.
        created_at: UTC, ISO 8601.
        count: Members.
        created_with: Version of this software.
        layers: ``name@version`` of the users' columns that the query names.
    """

    operation: str
    sql: str
    parameters: dict[str, Any]
    parents: list[str]
    snapshot: int
    created_at: str
    count: int
    created_with: str = field(default="")
    layers: list[str] = field(default_factory=list)


@dataclass(frozen=True)
class Database:
    """A version of a database.

    Attributes:
        name: Its name.
        version: From 1; replacing makes a new one.
        members: Rows of ``schemas/members.toml``, in order.
        lineage: How it was made.
        root: The lake that holds it.
    """

    name: str
    version: int
    members: pa.Table
    lineage: Lineage
    root: Path | None = field(default=None, compare=False, repr=False)

    def _repr_html_(self) -> str:
        from scenarionet_data.plots.cards import database_card

        return database_card(self)

    def __len__(self) -> int:
        return int(self.members.num_rows)

    @property
    def scenario_ids(self) -> list[str]:
        """Members in order."""
        ids: list[str] = self.members["scenario_id"].to_pylist()
        return ids

    @property
    def reference(self) -> str:
        """``name@version``."""
        return f"{self.name}@{self.version}"


@dataclass(frozen=True)
class Stored:
    """A version of a database as SQL reads it: its members stay where they are.

    Attributes:
        name, version: Which.
        lineage: How it was made.
        path: Its file.
    """

    name: str
    version: int
    lineage: Lineage
    path: Path

    def __len__(self) -> int:
        return self.lineage.count

    @property
    def reference(self) -> str:
        """``name@version``."""
        return f"{self.name}@{self.version}"

    @property
    def relation(self) -> str:
        """SQL for its members."""
        path = str(self.path).replace("'", "''")
        return f"read_parquet('{path}')"


def check_name(name: str) -> None:
    """Refuse a name that is no plain word.

    Raises:
        BadParameter: Naming what is allowed.
    """
    if not _NAME.fullmatch(name):
        raise BadParameter(f"{name!r} is no database name; use letters, digits, '.', '_' and '-'")


def parse_reference(reference: str) -> tuple[str, int | None]:
    """Name and version of ``name`` or ``name@version``.

    Raises:
        BadParameter: The version is no number.
    """
    name, at, version = reference.partition("@")
    if at and not version.isdecimal():
        raise BadParameter(f"{reference!r}: wanted name or name@version, with a number")
    return name, int(version) if version else None


def names(files: LakeFiles) -> list[str]:
    """Databases of a lake, sorted."""
    return files.folders(_FOLDER)


def versions(files: LakeFiles, name: str) -> list[int]:
    """Versions of a database, rising; empty when there is none."""
    found = files.names(f"{_FOLDER}/{name}", ".parquet")
    return sorted(int(path.rpartition("/")[2].removesuffix(".parquet")) for path in found)


def read(files: LakeFiles, name: str, version: int | None = None) -> Database:
    """A database by name; the newest version unless one is asked for.

    Raises:
        DatabaseNotFound: The message lists those that are there.
    """
    number, file = _open(files, name, version)
    return Database(name, number, file.read(), _lineage(file), files.root)


def stored(files: LakeFiles, which: Database | str) -> Stored:
    """A database for SQL, by ``name``, ``name@version``, or in Python.

    Raises:
        DatabaseNotFound: The message lists those that are there.
    """
    reference = which if isinstance(which, str) else which.reference
    name, version = parse_reference(reference)
    number, file = _open(files, name, version)
    return Stored(name, number, _lineage(file), files.path(_path(name, number)))


def lineage(files: LakeFiles, name: str, version: int | None = None) -> tuple[str, Lineage]:
    """``name@version`` (the newest unless one is asked for) and how it was made; its members are not read.

    Raises:
        DatabaseNotFound: The message lists those that are there.
    """
    number, file = _open(files, name, version)
    return f"{name}@{number}", _lineage(file)


def children(files: LakeFiles, name: str, version: int | None = None) -> list[str]:
    """``name@version`` of what other databases were made from a database, or from one version of it."""
    wanted = {f"{name}@{number}" for number in ([version] if version else versions(files, name))}
    others = [(other, number) for other in names(files) if other != name for number in versions(files, other)]
    made = [lineage(files, other, number) for other, number in others]
    return [reference for reference, how in made if wanted.intersection(how.parents)]


def _open(files: LakeFiles, name: str, version: int | None) -> tuple[int, pq.ParquetFile]:
    check_name(name)
    there = versions(files, name)
    if not there or (version is not None and version not in there):
        have = f"versions {there}" if there else f"databases: {', '.join(names(files)) or 'none yet'}"
        wanted = name if version is None else f"{name}@{version}"
        raise DatabaseNotFound(f"{files.root}: no database {wanted!r}; {have}")
    number = version or there[-1]
    path = _path(name, number)
    with reading(files.path(path)):
        file = pq.ParquetFile(files.path(path))
    tables.load("members").check_version(file.metadata.metadata, path)
    return number, file


def _lineage(file: pq.ParquetFile) -> Lineage:
    return Lineage(**json.loads(file.metadata.metadata[b"scenarionet.lineage"]))


def check_free(files: LakeFiles, name: str, *, replace: bool) -> None:
    """Refuse a name that is no plain word, or that is taken.

    Raises:
        BadParameter: Naming what is allowed.
        DatabaseExists: There is such a database and ``replace`` is False.
    """
    check_name(name)
    if not replace and versions(files, name):
        raise DatabaseExists(f"database {name!r} exists; give another name, or --replace for a new version of it")


def save(files: LakeFiles, name: str, members: pa.Table, lineage: Lineage, *, replace: bool) -> Database:
    """Publish a database; of two that publish the same version at once, one takes the next.

    Args:
        files: The lake.
        name: Its name.
        members: scenario_id, weight and content_hash, in order.
        lineage: How it was made.
        replace: Make a further version when there is one already.

    Raises:
        DatabaseExists: There is one and ``replace`` is False.
    """
    schema = tables.load("members").schema
    columns = {
        "scenario_id": members["scenario_id"],
        "position": pa.array(np.arange(members.num_rows, dtype=np.int32)),
        "weight": members["weight"],
        "content_hash": members["content_hash"],
    }
    content = pa.table([columns[name].cast(schema.field(name).type) for name in schema.names], schema=schema)
    footer = {"scenarionet.lineage": json.dumps(asdict(lineage))}
    while True:
        check_free(files, name, replace=replace)
        version = (versions(files, name) or [0])[-1] + 1
        written = write_table(files, "members", content, footer, row_group_size=_ROWS_PER_GROUP)
        if files.publish_new(_path(name, version), written):
            return Database(name, version, content, lineage, files.root)


def rename(files: LakeFiles, name: str, new_name: str) -> None:
    """Give a database, with all its versions, another name.

    Raises:
        DatabaseExists: The other name is taken.
    """
    check_free(files, new_name, replace=False)
    if not files.move(f"{_FOLDER}/{name}", f"{_FOLDER}/{new_name}"):
        raise DatabaseExists(f"database {new_name!r} exists; give another name, or drop it first")


def drop(files: LakeFiles, name: str, version: int | None = None) -> None:
    """Remove a database, or one version of it."""
    if version is None or versions(files, name) == [version]:
        files.remove(f"{_FOLDER}/{name}")
    else:
        files.remove(_path(name, version))


def _path(name: str, version: int) -> str:
    return f"{_FOLDER}/{name}/{version}.parquet"
