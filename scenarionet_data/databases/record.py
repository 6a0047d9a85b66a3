"""Databases: named, ordered sets of scenarios that copy nothing and remember where they came from."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from scenarionet_data.errors import BadParameter, DatabaseExists, DatabaseNotFound
from scenarionet_data.query.statements import quoted
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading
from scenarionet_data.storage.files.lake_files import LakeFiles

_FOLDER = "databases"
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
        lineage: How it was made.
        files: The lake it lies in.
    """

    name: str
    version: int
    lineage: Lineage
    files: LakeFiles = field(repr=False, compare=False)

    def _repr_html_(self) -> str:
        from scenarionet_data.display import database_card

        return database_card(self)

    def __len__(self) -> int:
        return self.lineage.count

    @cached_property
    def members(self) -> pa.Table:
        """Rows of ``schemas/members.toml``, in order; read when they are asked for.

        Raises:
            LakeError: The file is gone or damaged.
        """
        return self.files.read(self.file)

    @property
    def file(self) -> str:
        """Its file in the lake."""
        return path(self.name, self.version)

    @property
    def scenario_ids(self) -> list[str]:
        """Members in order."""
        ids: list[str] = self.members["scenario_id"].to_pylist()
        return ids

    @property
    def reference(self) -> str:
        """``name@version``."""
        return f"{self.name}@{self.version}"

    @property
    def relation(self) -> str:
        """SQL for its members, which stay where they are."""
        return f"read_parquet({quoted(str(self.files.path(self.file)))})"


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
    check_name(name)
    there = versions(files, name)
    if not there or (version is not None and version not in there):
        have = f"versions {there}" if there else f"databases: {', '.join(names(files)) or 'none yet'}"
        wanted = name if version is None else f"{name}@{version}"
        raise DatabaseNotFound(f"{files.root}: no database {wanted!r}; {have}")
    number = version or there[-1]
    return Database(name, number, _lineage(files, path(name, number)), files)


def resolve(files: LakeFiles, which: Database | str) -> Database:
    """The database of that ``name`` or ``name@version``, or one of Python's as this lake has it.

    Raises:
        DatabaseNotFound: The message lists those that are there.
    """
    return read(files, *parse_reference(which if isinstance(which, str) else which.reference))


def children(files: LakeFiles, name: str, version: int | None = None) -> list[str]:
    """``name@version`` of what other databases were made from a database, or from one version of it."""
    wanted = {f"{name}@{number}" for number in ([version] if version else versions(files, name))}
    return [
        other.reference for other in every(files) if other.name != name and wanted.intersection(other.lineage.parents)
    ]


def every(files: LakeFiles) -> Iterator[Database]:
    """Every version of every database, by name."""
    for name in names(files):
        for number in versions(files, name):
            yield read(files, name, number)


def _lineage(files: LakeFiles, file: str) -> Lineage:
    """What the footer of a database's file says."""
    with reading(files.path(file)):
        footer = pq.read_metadata(files.path(file)).metadata
    tables.load("members").check_version(footer, file)
    return Lineage(**json.loads(footer[b"scenarionet.lineage"]))


def check_free(files: LakeFiles, name: str, *, replace: bool) -> None:
    """Refuse a name that is no plain word, or that is taken.

    Raises:
        BadParameter: Naming what is allowed.
        DatabaseExists: There is such a database and ``replace`` is False.
    """
    check_name(name)
    if not replace and versions(files, name):
        raise DatabaseExists(f"database {name!r} exists; give another name, or --replace for a new version of it")


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
        files.remove(path(name, version))


def path(name: str, version: int) -> str:
    """File of a version of a database."""
    return f"{_FOLDER}/{name}/{version}.parquet"
