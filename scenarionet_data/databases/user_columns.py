"""User columns: columns and labels that users add to scenarios, as side tables that the view ``metadata`` joins.

A user column is keyed by scenario_id and stored below ``layers/``, one file a version: booleans, numbers, texts, dates,
or lists of numbers such as embeddings. Nothing else is rewritten; all versions are kept, and lineage records which
version a query used.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from scenarionet_data.databases import record as records
from scenarionet_data.errors import BadParameter, UserColumnNotFound
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import damaged, writing
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.integrity import seals

_FOLDER = "layers"
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_VECTOR = re.compile(r"fixed_size_list<\w+: float( not null)?>\[\d+\]")
_VALUES: dict[str, Any] = {"compression": "zstd"}
_VECTORS: dict[str, Any] = {"compression": "none", "use_dictionary": False, "row_group_size": 65_536}
"""Floats hardly compress, and a search reads all of them: without decoding, and in as many threads as there are."""
_RESERVED = {"weight", "position", "place", "parent"}
"""Columns of database members that ``metadata`` does not have."""

versions = partial(records.numbers, _FOLDER)
next_version = partial(records.following, _FOLDER)
drop = partial(records.drop_versions, _FOLDER)


@dataclass(frozen=True)
class UserColumn:
    """A version of a user column.

    Attributes:
        name: Name of the column.
        version: From 1, incremented on replacement.
        type: Arrow type of the column.
        count: Number of scenarios with a value.
        source: Origin of the values: the SQL, a file name, or "python".
        snapshot: Number of the snapshot it was made on.
        created_at: UTC, ISO 8601.
        created_with: Name and version of the software.
    """

    name: str
    version: int
    type: str
    count: int
    source: str
    snapshot: int
    created_at: str
    created_with: str

    @property
    def reference(self) -> str:
        """``name@version``."""
        return f"{self.name}@{self.version}"


_TYPES = {field.name: field.type for field in fields(UserColumn)}


def current(files: LakeFiles, pinned: Mapping[str, int]) -> dict[str, int]:
    """Return the version of each user column of a lake, by name: the pinned one, else the newest.

    Raises:
        UserColumnNotFound: A pinned version does not exist.
    """
    newest = {}
    for name in files.folders(_FOLDER):
        found = versions(files, name) if _NAME.fullmatch(name) else []
        newest.update({name: found[-1]} if found else {})
    for name, version in pinned.items():
        check_exists(files, name, version)
    return newest | dict(pinned)


def check_exists(files: LakeFiles, name: str, version: int | None = None) -> None:
    """Raise if a user column, or a version of it, does not exist.

    Raises:
        UserColumnNotFound: The message lists the existing ones.
    """
    found = versions(files, name) if _NAME.fullmatch(name) else []
    if not found or (version is not None and version not in found):
        have = f"versions {found}" if found else f"user columns: {', '.join(current(files, {})) or 'none yet'}"
        wanted = name if version is None else f"{name}@{version}"
        raise UserColumnNotFound(f"{files.root}: no user column {wanted!r}; {have}")


def users(files: LakeFiles, name: str, version: int | None = None) -> list[tuple[str, str]]:
    """Return the databases whose query uses a user column: pairs of database and column reference."""
    return [
        (database.reference, column)
        for database in records.all_records(files)
        for column in database.lineage.user_columns
        if column == f"{name}@{version}" or (version is None and column.partition("@")[0] == name)
    ]


def read(files: LakeFiles, name: str, version: int) -> UserColumn:
    """Read the record of a version of a user column.

    Raises:
        LakeError: Its file is missing or damaged.
    """
    footer = files.footer(file_name(name, version)).metadata or {}
    try:
        column = UserColumn(**json.loads(footer[b"scenarionet.layer"]))
        if {field.name: type(getattr(column, field.name)).__name__ for field in fields(column)} != _TYPES:
            raise TypeError("an entry has another type")
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise damaged(files.url(file_name(name, version)), "its footer does not describe a user column") from error
    return column


def parse(references: Iterable[str]) -> dict[str, int]:
    """Return versions by name of references ``name@version``."""
    return {name: int(version) for name, _, version in (reference.partition("@") for reference in references)}


def copy_rows(source: LakeFiles, target: LakeFiles, name: str, version: int, scenario_ids: pa.Array) -> str:
    """Copy a version of a user column, with the values of some scenarios, to another lake; return its file name."""
    file = file_name(name, version)
    rows = source.read(file)
    rows = rows.filter(pc.is_in(rows["scenario_id"], value_set=scenario_ids))
    column = replace(read(source, name, version), count=rows.num_rows - rows[name].null_count)
    target.publish(_write(target, rows, column), file)
    return file


def is_vector(column: UserColumn) -> bool:
    """Whether a user column has a vector of float32 for each scenario, all of one length: an embedding."""
    return bool(_VECTOR.fullmatch(column.type))


def check_name(name: str) -> None:
    """Raise if a user column cannot have this name.

    Raises:
        BadParameter: It has other characters than a user column may have, or is a column of every lake.
    """
    metadata = tables.load("metadata")
    if name in {column.name for column in (*metadata.columns, *metadata.derived)} | _RESERVED:
        raise BadParameter(f"{name!r} is a column of every lake; choose another name")
    if not isinstance(name, str) or not _NAME.fullmatch(name):
        raise BadParameter(
            f"{name!r} is not a valid name of a user column; use lower-case letters, digits and '_', a letter first"
        )


def publish(files: LakeFiles, rows: pa.Table, column: UserColumn) -> bool:
    """Write a version of a user column unless it exists; return whether this call wrote it."""
    written = _write(files, rows, column)
    try:
        return files.publish_new(file_name(column.name, column.version), written)
    finally:
        written.unlink(missing_ok=True)


def _write(files: LakeFiles, values: pa.Table, column: UserColumn) -> Path:
    """Write a temporary file with the values of a user column."""
    temporary = files.temporary()
    footer = {"scenarionet.layer": json.dumps(asdict(column)), **tables.SEALED}
    with writing(temporary, temporary):
        rows, storage = values.replace_schema_metadata(footer), _VECTORS if is_vector(column) else _VALUES
        pq.write_table(rows, temporary, write_page_checksum=True, **storage)
        seals.seal(temporary, files.place_to_write(file_name(column.name, column.version)))
    return temporary


def file_name(name: str, version: int) -> str:
    """Return the file of a version of a user column."""
    return f"{_FOLDER}/{name}/{version}.parquet"
