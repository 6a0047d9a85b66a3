"""Layers: columns and labels that users add to scenarios, as side tables that the view ``metadata`` joins.

A layer is one column, keyed by scenario_id and named as the layer: a truth value, a number, a text, a date, or a list
of numbers such as an embedding. Nothing else is rewritten; every version stays, and lineage says which one was asked.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from scenarionet_data.databases import record as databases
from scenarionet_data.errors import BadParameter, LayerNotFound
from scenarionet_data.query.statements import check_expression, words
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.errors import reading, writing
from scenarionet_data.storage.files.lake_files import LakeFiles

_FOLDER = "layers"
_NAME = re.compile(r"[a-z][a-z0-9_]*")
_TAKEN = {"weight", "position", "place", "parent"}
"""Columns that databases have beside those of ``metadata``."""


@dataclass(frozen=True)
class Layer:
    """A version of a layer.

    Attributes:
        name: Its name, and that of its column.
        version: From 1; replacing makes a new one.
        type: Type of the column, in Arrow's words.
        count: Scenarios that have a value.
        source: What its values came from: the SQL, a file's name, or "python".
        snapshot: Number of the snapshot it was made on.
        created_at: UTC, ISO 8601.
        created_with: Version of this software.
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


def shown(files: LakeFiles, pinned: Mapping[str, int]) -> dict[str, int]:
    """The version of each layer of a lake, by name: the pinned one, else the newest.

    A folder of another name than a layer can have is none.

    Raises:
        LayerNotFound: A pinned one is gone.
    """
    there = {name: versions(files, name) for name in files.folders(_FOLDER) if _NAME.fullmatch(name)}
    for name, version in pinned.items():
        check_there(files, name, version)
    return {name: found[-1] for name, found in there.items() if found} | dict(pinned)


def versions(files: LakeFiles, name: str) -> list[int]:
    """Versions of a layer, rising; empty when there is none."""
    found = files.names(f"{_FOLDER}/{name}", ".parquet")
    return sorted(int(path.rpartition("/")[2].removesuffix(".parquet")) for path in found)


def check_there(files: LakeFiles, name: str, version: int | None = None) -> None:
    """Refuse a layer, or a version of it, that is not there.

    Raises:
        LayerNotFound: The message lists what is there.
    """
    found = versions(files, name) if _NAME.fullmatch(name) else []
    if not found or (version is not None and version not in found):
        have = f"versions {found}" if found else f"layers: {', '.join(shown(files, {})) or 'none yet'}"
        raise LayerNotFound(f"{files.root}: no layer {name if version is None else f'{name}@{version}'!r}; {have}")


def needing(files: LakeFiles, name: str, version: int | None = None) -> list[tuple[str, str]]:
    """``name@version`` of the databases whose query asked a layer (or one version of it), each with the version."""
    return [
        (database.reference, layer)
        for database in databases.every(files)
        for layer in database.lineage.layers
        if layer == f"{name}@{version}" or (version is None and layer.partition("@")[0] == name)
    ]


def read(files: LakeFiles, name: str, version: int) -> Layer:
    """What is known about a version of a layer."""
    path = files.path(_path(name, version))
    with reading(path):
        footer = pq.read_metadata(path).metadata
    return Layer(**json.loads(footer[b"scenarionet.layer"]))


def named(layers: Iterable[str], sql: str) -> list[str]:
    """The layers whose columns a condition or an expression asks for, sorted: those it names."""
    found = words(sql)
    return sorted(layers if "columns" in found else found & set(layers))  # COLUMNS('score_.*') may mean any


def parse(references: Iterable[str]) -> dict[str, int]:
    """Versions by name of ``name@version``s."""
    return {name: int(version) for name, _, version in (reference.partition("@") for reference in references)}


def copy_rows(source: LakeFiles, target: LakeFiles, name: str, version: int, scenario_ids: pa.Array) -> str:
    """Copy a version of a layer to another lake, with the values of some scenarios; returns its file's name."""
    path = _path(name, version)
    rows = source.read(path)
    rows = rows.filter(pc.is_in(rows["scenario_id"], value_set=scenario_ids))
    layer = replace(read(source, name, version), count=rows.num_rows - rows[name].null_count)
    target.publish(_write(target, rows, layer), path)
    return path


def check_name(name: str) -> None:
    """Refuse a name that is no plain word, or that a column has.

    Raises:
        BadParameter: Naming what is allowed.
    """
    metadata = tables.load("metadata")
    if name in {column.name for column in (*metadata.columns, *metadata.derived)} | _TAKEN:
        raise BadParameter(f"{name!r} is a column of every lake; choose another name")
    if not _NAME.fullmatch(name):
        raise BadParameter(f"{name!r} is no layer name; use lower-case letters, digits and '_', a letter first")
    try:
        check_expression(name)
    except ValueError as error:
        raise BadParameter(f"{name!r} is a word of SQL; choose another name") from error


def publish(files: LakeFiles, rows: pa.Table, layer: Layer) -> bool:
    """Write a version of a layer, unless there is one; returns whether this call did."""
    written = _write(files, rows, layer)
    try:
        return files.publish_new(_path(layer.name, layer.version), written)
    finally:
        written.unlink(missing_ok=True)


def drop(files: LakeFiles, name: str, version: int | None = None) -> None:
    """Remove a layer, or one version of it."""
    if version is None or versions(files, name) == [version]:
        files.remove(f"{_FOLDER}/{name}")
    else:
        files.remove(_path(name, version))


def _write(files: LakeFiles, values: pa.Table, layer: Layer) -> Path:
    """A temporary file with a layer's values."""
    temporary = files.temporary()
    footer = {"scenarionet.layer": json.dumps(asdict(layer))}
    with writing(temporary, temporary):
        pq.write_table(values.replace_schema_metadata(footer), temporary, compression="zstd")
    return temporary


def _path(name: str, version: int) -> str:
    return f"{_FOLDER}/{name}/{version}.parquet"
