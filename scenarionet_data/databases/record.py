"""Records of databases: named, ordered sets of scenarios that copy no data and know their lineage."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property, partial
from typing import Any

import pyarrow as pa

from scenarionet_data.databases.row_sets import RowSets
from scenarionet_data.errors import BadParameter, DatabaseExists, DatabaseNotFound
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import damaged, writing
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.write.relocation import copy_sealed

_FOLDER = "databases"
_READ_AGAIN = ("members", "rows", "_loader", "_positions")
"""Attributes that are not sent to other processes."""
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9._-]*")


DROPPED = "dropped/"
"""Folder of marks: one for each version that was dropped, so that ``name@version`` means one content for ever."""


def numbers(kind: str, files: LakeFiles, name: str, suffix: str = ".parquet") -> list[int]:
    """Return the versions of a database or user column in ascending order; empty if there are none.

    Args:
        kind: ``databases`` or ``layers``; behind DROPPED, versions that were dropped.
        files: The lake.
        name: The database, or the user column.
        suffix: Of the files.
    """
    return files.numbers(f"{kind}/{name}", suffix)


def following(kind: str, files: LakeFiles, name: str) -> int:
    """Return the number of the next version, which none had before, not even one that was dropped."""
    return 1 + max([0, *files.numbers(f"{kind}/{name}"), *files.numbers(f"{DROPPED}{kind}/{name}", "")])


def drop_versions(kind: str, files: LakeFiles, name: str, version: int | None = None) -> None:
    """Remove all versions, or one."""
    there = numbers(kind, files, name)
    for number in there if version is None else [version]:
        files.publish_new(f"{DROPPED}{kind}/{name}/{number}", b"")
    files.remove(f"{kind}/{name}" if version is None or there == [version] else f"{kind}/{name}/{version}.parquet")


versions = partial(numbers, _FOLDER)
next_version = partial(following, _FOLDER)
drop = partial(drop_versions, _FOLDER)


@dataclass(frozen=True)
class Lineage:
    """How a database was made: running its SQL again on its snapshot and parents gives the same members.

    Attributes:
        operation: filter, split, ...
        sql: The query as it was run, over the views of the snapshot and ``members``, the rows of all parents with
            ``parent``, the index of their database in ``parents``.
        parameters: Values of ``$name`` in the query, including the seed.
        parents: ``name@version`` of the databases it was made from; empty for the whole lake.
        snapshot: Number of the snapshot it was made on.
        created_at: UTC, ISO 8601.
        count: Number of members.
        created_with: Name and version of the software.
        user_columns: ``name@version`` of the user columns that the query names.
    """

    operation: str
    sql: str
    parameters: dict[str, Any]
    parents: list[str]
    snapshot: int
    created_at: str
    count: int
    created_with: str = field(default="")
    user_columns: list[str] = field(default_factory=list)

    @property
    def origin(self) -> str:
        """How it was made, in words."""
        return f"{self.operation} of {', '.join(self.parents) or 'the lake'} at snapshot {self.snapshot}"

    def to_dict(self) -> dict[str, Any]:
        """Return the lineage with the keys of its JSON form; user columns are stored as ``layers``."""
        content = asdict(self)
        content["layers"] = content.pop("user_columns")
        return content

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> Lineage:
        """Return the lineage of a dictionary that :meth:`to_dict` returned.

        Raises:
            TypeError: An entry is missing, unknown, or of another type.
        """
        fields = dict(content)
        found = cls(user_columns=fields.pop("layers", []), **fields)
        texts = (found.operation, found.sql, found.created_at, found.created_with, *found.parents, *found.user_columns)
        if not (
            all(isinstance(text, str) for text in texts)
            and isinstance(found.parameters, dict)
            and isinstance(found.snapshot, int)
            and isinstance(found.count, int)
        ):
            raise TypeError("an entry has another type")
        return found


@dataclass(frozen=True)
class DatabaseRecord:
    """One version of a database, or a selection that is not saved.

    Attributes:
        name: Name of the database; None for an unsaved selection.
        version: From 1, incremented on replacement; None for an unsaved selection.
        lineage: How it was made.
        files: Files of its lake.
        selected: Members of an unsaved selection, as rows of ``schemas/members.toml`` or of metadata files.
    """

    name: str | None
    version: int | None
    lineage: Lineage
    files: LakeFiles = field(repr=False, compare=False)
    selected: pa.Table | RowSets | None = field(default=None, repr=False, compare=False)

    def __len__(self) -> int:
        return self.lineage.count

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name not in _READ_AGAIN}

    @cached_property
    def members(self) -> pa.Table:
        """Rows of ``schemas/members.toml`` in order, read on first access.

        Raises:
            LakeError: The file is missing or damaged.
            SchemaMismatch: It lacks a column.
        """
        if self.rows is not None:
            return self.rows.members(self.files)
        if self.selected is not None:
            return self.selected
        return tables.load("members").conform(self.files.read(self.file))

    @cached_property
    def rows(self) -> RowSets | None:
        """Members as rows of metadata files; None if their ids are stored."""
        if self.selected is not None:
            return None if isinstance(self.selected, pa.Table) else self.selected
        if self.files.footer(self.file).metadata[b"scenarionet.schema"] == tables.load("members").tag.encode():
            return None
        return RowSets.of_table(self.files.read(self.file))

    @property
    def is_saved(self) -> bool:
        """Whether the lake has a database of this name and version, as opposed to an unsaved selection."""
        return self.name is not None

    @property
    def file(self) -> str:
        """File in the lake.

        Raises:
            BadParameter: The selection is not saved.
        """
        if self.name is None or self.version is None:
            raise BadParameter("this selection is not saved: give it a name with selection.save(name)")
        return path(self.name, self.version)

    @property
    def scenario_ids(self) -> list[str]:
        """Ids of the members, in order."""
        ids: list[str] = self.members["scenario_id"].to_pylist()
        return ids

    @property
    def reference(self) -> str:
        """``name@version``, or ``unsaved selection``."""
        return f"{self.name}@{self.version}" if self.is_saved else "unsaved selection"


def check_name(name: str) -> None:
    """Raise if a database cannot have this name.

    Raises:
        BadParameter: The message lists the allowed characters.
    """
    if not (isinstance(name, str) and _NAME.fullmatch(name)):
        raise BadParameter(f"{name!r} is no database name; use letters, digits, '.', '_' and '-'")


def parse_reference(database: DatabaseRecord | str) -> tuple[str, int | None]:
    """Return name and version of a saved database, of ``name`` or of ``name@version``.

    Raises:
        BadParameter: The version is not a number, or it is no database.
    """
    if not isinstance(database, DatabaseRecord | str):
        raise BadParameter(f"expected a database or its name, found {database!r}")
    reference = database if isinstance(database, str) else database.reference
    name, at, version = reference.partition("@")
    if at and not version.isdecimal():
        raise BadParameter(f"{reference!r}: wanted name or name@version, with a number")
    return name, int(version) if version else None


def names(files: LakeFiles) -> list[str]:
    """Return the names of a lake's databases, sorted."""
    return files.folders(_FOLDER)


def read(files: LakeFiles, name: str, version: int | None = None) -> DatabaseRecord:
    """Read the record of a database, of its newest version by default.

    Raises:
        DatabaseNotFound: The message lists the existing ones.
    """
    check_exists(files, name, version)
    return read_version(files, name, version or versions(files, name)[-1])


def check_exists(files: LakeFiles, name: str, version: int | None = None) -> None:
    """Raise if a database, or a version of it, does not exist.

    Raises:
        DatabaseNotFound: The message lists the existing ones.
    """
    check_name(name)
    existing = versions(files, name)
    if not existing or (version is not None and version not in existing):
        have = f"versions {existing}" if existing else f"databases: {', '.join(names(files)) or 'none yet'}"
        wanted = name if version is None else f"{name}@{version}"
        raise DatabaseNotFound(f"{files.root}: no database {wanted!r}; {have}")


def read_version(files: LakeFiles, name: str, version: int) -> DatabaseRecord:
    """Read the record of an existing version of a database.

    Raises:
        LakeError: The file is missing or damaged.
    """
    file = path(name, version)
    footer = files.footer(file).metadata
    check_version(footer, file)
    try:
        lineage = Lineage.from_dict(json.loads(footer[b"scenarionet.lineage"]))
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise damaged(files.url(file), "its footer holds no lineage of a database") from error
    return DatabaseRecord(name, version, lineage, files)


def check_version(footer: Mapping[bytes, bytes], file: str) -> None:
    """Raise unless members are stored in a way that can be read.

    Raises:
        SchemaMismatch: The message names the file, both versions and the remedy.
    """
    is_bits = footer.get(b"scenarionet.schema", b"").startswith(b"member_bits/")
    tables.load("member_bits" if is_bits else "members").check_version(footer, file)


def resolve(files: LakeFiles, database: DatabaseRecord | str) -> DatabaseRecord:
    """Return the record of a ``name`` or ``name@version``, or of an object of the same reference in this lake.

    Raises:
        DatabaseNotFound: The message lists the existing ones.
        BadParameter: It is an unsaved selection of another lake.
    """
    if isinstance(database, str):
        return read(files, *parse_reference(database))
    if not database.is_saved:
        if str(database.files.root) != str(files.root):
            raise BadParameter(f"the selection is from {database.files.root}, not from {files.root}")
        return database
    return read(files, *parse_reference(database))  # it may have been dropped and made again


def children(files: LakeFiles, name: str, version: int | None = None) -> list[str]:
    """Return ``name@version`` of the databases made from a database, or from one version of it."""
    wanted = {f"{name}@{number}" for number in ([version] if version else versions(files, name))}
    return [other.reference for other in all_records(files, besides=name) if wanted & {*other.lineage.parents}]


def all_records(files: LakeFiles, besides: str | None = None) -> Iterator[DatabaseRecord]:
    """Read every version of every database, by name, except one database."""
    for name in (name for name in names(files) if name != besides):
        for number in versions(files, name):
            yield read_version(files, name, number)


def check_free(files: LakeFiles, name: str, *, replace: bool) -> None:
    """Raise if a database of this name cannot be saved.

    Raises:
        BadParameter: No database can have this name; the message lists the allowed characters.
        DatabaseExists: The database exists and ``replace`` is False.
    """
    check_name(name)
    if not replace and files.numbers(f"{_FOLDER}/{name}"):
        raise DatabaseExists(
            f"database {name!r} exists; choose another name, or replace=True for a new version of it",
            cli_remedy="--replace",
        )


def rename(files: LakeFiles, name: str, new_name: str) -> None:
    """Rename a database with all its versions: they are sealed again, because a seal covers the file's name.

    Their numbers follow those of an earlier database of the new name.

    Raises:
        DatabaseExists: The new name is taken.
        LakeError: A version is damaged.
    """
    check_free(files, new_name, replace=False)
    draft, numbers = files.temporary(), versions(files, name)
    before = next_version(files, new_name) - 1
    with writing(draft):
        draft.mkdir()
    for number in numbers:
        place = files.place_to_write(path(new_name, before + number))
        copy_sealed(files, path(name, number), draft / f"{before + number}.parquet", place)
    if not files.publish_folder(draft, f"{_FOLDER}/{new_name}"):
        raise DatabaseExists(f"database {new_name!r} exists; choose another name, or drop it first")
    for number in numbers:  # a version that another job has added in the meantime is kept
        drop(files, name, number)


def path(name: str, version: int) -> str:
    """Return the file of a version of a database."""
    return f"{_FOLDER}/{name}/{version}.parquet"
