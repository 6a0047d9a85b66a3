"""Databases: named, ordered sets of scenarios that copy nothing and remember where they came from."""

from __future__ import annotations

import json
import re
from dataclasses import asdict, dataclass, field
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data import tables
from scenarionet_data.errors import BadParameter, DatabaseExists, DatabaseNotFound
from scenarionet_data.store.files import LakeFiles, reading
from scenarionet_data.store.table_file import write_table

_FOLDER = "databases"
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")


@dataclass(frozen=True)
class Lineage:
    """How a database was made.

    Attributes:
        operation: filter, split, ...
        sql: The query, as it was run.
        parameters: Values of ``$name`` in it, the seed among them.
        parents: ``name@version`` of the databases it was made from; empty for the whole lake.
        snapshot: Number of the snapshot it was made on.
        created_at: UTC, ISO 8601.
        count: Members.
        created_with: Version of this software.
    """

    operation: str
    sql: str
    parameters: dict[str, Any]
    parents: list[str]
    snapshot: int
    created_at: str
    count: int
    created_with: str = field(default="")


@dataclass(frozen=True)
class Database:
    """A version of a database.

    Attributes:
        name: Its name.
        version: From 1; overwriting makes a new one.
        members: Rows of ``schemas/members.toml``, in order.
        lineage: How it was made.
    """

    name: str
    version: int
    members: pa.Table
    lineage: Lineage

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


def check_name(name: str) -> None:
    """Refuse a name that is no plain word.

    Raises:
        BadParameter: Naming what is allowed.
    """
    if not _NAME.fullmatch(name):
        raise BadParameter(f"{name!r} is no database name; use letters, digits, '.', '_' and '-'")


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
    return Database(name, number, file.read(), _lineage(file))


def lineage(files: LakeFiles, name: str) -> tuple[str, Lineage]:
    """``name@version`` of the newest version and how it was made; its members are not read.

    Raises:
        DatabaseNotFound: The message lists those that are there.
    """
    number, file = _open(files, name, None)
    return f"{name}@{number}", _lineage(file)


def _open(files: LakeFiles, name: str, version: int | None) -> tuple[int, pq.ParquetFile]:
    check_name(name)
    there = versions(files, name)
    if not there or (version is not None and version not in there):
        have = f"versions {there}" if there else f"databases: {', '.join(names(files)) or 'none yet'}"
        wanted = name if version is None else f"{name}@{version}"
        raise DatabaseNotFound(f"{files.root}: no database {wanted!r}; {have}")
    number = version or there[-1]
    path = f"{_FOLDER}/{name}/{number}.parquet"
    with reading(files.path(path)):
        file = pq.ParquetFile(files.path(path))
    tables.load("members").check_version(file.metadata.metadata, path)
    return number, file


def _lineage(file: pq.ParquetFile) -> Lineage:
    return Lineage(**json.loads(file.metadata.metadata[b"scenarionet.lineage"]))


def save(files: LakeFiles, name: str, members: pa.Table, lineage: Lineage, *, overwrite: bool) -> Database:
    """Publish a database.

    Args:
        files: The lake.
        name: Its name.
        members: scenario_id, weight and content_hash, in order.
        lineage: How it was made.
        overwrite: Make a further version when there is one already.

    Raises:
        DatabaseExists: There is one and ``overwrite`` is False.
    """
    check_name(name)
    schema = tables.load("members").schema
    columns = {
        "scenario_id": members["scenario_id"],
        "position": pa.array(range(members.num_rows), pa.int32()),
        "weight": members["weight"],
        "content_hash": members["content_hash"],
    }
    content = pa.table([columns[name].cast(schema.field(name).type) for name in schema.names], schema=schema)
    footer = {"scenarionet.lineage": json.dumps(asdict(lineage))}
    while True:
        version = (versions(files, name) or [0])[-1] + 1
        if version > 1 and not overwrite:
            raise DatabaseExists(f"database {name!r} exists; give another name, or --overwrite for a new version")
        path = f"{_FOLDER}/{name}/{version}.parquet"
        if files.publish_new(path, write_table(files, "members", content, footer)):
            return Database(name, version, content, lineage)
