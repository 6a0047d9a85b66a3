"""Layers: columns and labels that users add to scenarios, as side tables that the view ``metadata`` joins.

A layer is one column, keyed by scenario_id and named as the layer: a truth value, a number, a text, a date, or a list
of numbers such as an embedding. Nothing else is rewritten; every version stays, and lineage says which one was asked.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from scenarionet_data import software, tables
from scenarionet_data.catalog import events
from scenarionet_data.catalog.engine import check_expression, words
from scenarionet_data.errors import BadParameter, LayerExists, ScenarioNotFound
from scenarionet_data.store import snapshot as snapshots
from scenarionet_data.store.files import LakeFiles, reading, writing

if TYPE_CHECKING:
    import polars as pl

    from scenarionet_data.catalog.lake import Lake

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


def newest(files: LakeFiles) -> dict[str, int]:
    """Newest version of each layer of a lake, by name; a folder of another name than a layer can have is none."""
    there = {name: _versions(files, name) for name in files.folders(_FOLDER) if _NAME.fullmatch(name)}
    return {name: versions[-1] for name, versions in there.items() if versions}


def read(files: LakeFiles, name: str, version: int) -> Layer:
    """What is known about a version of a layer."""
    path = files.path(_path(name, version))
    with reading(path):
        footer = pq.read_metadata(path).metadata
    return Layer(**json.loads(footer[b"scenarionet.layer"]))


def used(layers: Mapping[str, int], sql: str) -> list[str]:
    """``name@version`` of the layers that a query may ask: those that it names."""
    return [f"{name}@{layers[name]}" for name in sorted(words(sql) & set(layers))]


def pinned(references: Iterable[str]) -> dict[str, int]:
    """Versions by name of ``name@version``s."""
    return {name: int(version) for name, _, version in (reference.partition("@") for reference in references)}


def tag(
    lake: Lake,
    name: str,
    rows: pa.Table | pl.DataFrame | Mapping[str, Any],
    *,
    source: str = "python",
    replace: bool = False,
) -> Layer:
    """Add a column to the scenarios of a lake.

    Args:
        lake: The lake; open it again (``refresh``) to ask for the column.
        name: The column's name: a lower-case word that no column has.
        rows: A table with scenario_id and one more column, or a value for each scenario id. Scenarios without a row
            have null.
        source: Where the values come from, for the record.
        replace: Make a further version when there is one already.

    Raises:
        BadParameter: The name is taken or no plain word, or the rows are no such table.
        ScenarioNotFound: The lake has no scenario of one of the ids.
        LayerExists: There is such a layer and ``replace`` is False.
    """
    check_name(name)
    values = _as_layer(name, rows)
    _check_ids(lake, values)
    while True:
        version = ([0, *_versions(lake.files, name)])[-1] + 1
        if version > 1 and not replace:
            raise LayerExists(f"layer {name!r} exists; give another name, or --replace for a new version of it")
        layer = Layer(
            name=name,
            version=version,
            type=str(values.schema.field(name).type),
            count=values.num_rows - values[name].null_count,
            source=source,
            snapshot=lake.snapshot.number,
            created_at=snapshots.now(),
            created_with=software.name_and_version(),
        )
        if lake.files.publish_new(_path(name, version), _write(lake.files, values, layer)):
            return layer


def tag_by_sql(lake: Lake, name: str, query: str, *, replace: bool = False) -> Layer:
    """Add a column from a SELECT of scenario_id and one more column; see :func:`tag`."""
    return tag(lake, name, lake.arrow(query), source=query, replace=replace)


def tag_where(lake: Lake, name: str, where: str, *, replace: bool = False) -> Layer:
    """Add a label: whether a condition over the columns of ``metadata`` holds; see :func:`tag`."""
    check_expression(where)
    return tag_by_sql(lake, name, f"SELECT scenario_id, ({where}\n) AS {name} FROM metadata", replace=replace)


def tag_event(lake: Lake, name: str, event: str, *, replace: bool = False) -> Layer:
    """Add a count: how often an event happens in each scenario.

    Args:
        lake: The lake.
        name: The column's name.
        event: An event of ``sql/events``, as ``name:key=value``.
        replace: Make a further version when there is one already.
    """
    found, values = events.parse(event)
    query = (
        "SELECT scenario_id, count(hit.scenario_id) AS hits "
        f"FROM metadata LEFT JOIN (\n{found.text}\n) AS hit USING (scenario_id) GROUP BY scenario_id"
    )
    return tag(lake, name, lake.arrow(query, values), source=f"event {event}", replace=replace)


def tag_from_file(
    lake: Lake, name: str, path: str | Path, column: str | None = None, *, replace: bool = False
) -> Layer:
    """Add a column from a CSV or Parquet file with scenario_id and the column; see :func:`tag`.

    Args:
        lake: The lake.
        name: The column's name in the lake.
        path: The file.
        column: The column's name in the file; may be left out when there is one besides scenario_id.
        replace: Make a further version when there is one already.
    """
    rows = _read_file(Path(path))
    if column is not None:
        missing = {"scenario_id", column} - set(rows.column_names)
        if missing:
            have = ", ".join(rows.column_names)
            raise BadParameter(f"{path}: no column {' or '.join(sorted(missing))}; there are {have}")
        rows = rows.select(["scenario_id", column])
    return tag(lake, name, rows, source=Path(path).name, replace=replace)


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


def _write(files: LakeFiles, values: pa.Table, layer: Layer) -> Path:
    """A temporary file with a layer's values."""
    temporary = files.temporary()
    footer = {"scenarionet.layer": json.dumps(asdict(layer))}
    with writing(temporary, temporary):
        pq.write_table(values.replace_schema_metadata(footer), temporary, compression="zstd")
    return temporary


def _as_layer(name: str, rows: pa.Table | pl.DataFrame | Mapping[str, Any]) -> pa.Table:
    """scenario_id and the value under the layer's name, in order of id."""
    if isinstance(rows, Mapping):
        table = pa.table({"scenario_id": pa.array(list(rows), pa.string()), name: list(rows.values())})
    else:
        table = rows if isinstance(rows, pa.Table) else rows.to_arrow()
    others = [column for column in table.column_names if column != "scenario_id"]
    if "scenario_id" not in table.column_names or len(others) != 1:
        raise BadParameter(
            f"layer {name!r}: wanted scenario_id and one more column, found {', '.join(table.column_names)}; "
            "name the column with --column, or select two"
        )
    ids = table["scenario_id"].cast(pa.string())
    if ids.null_count or pc.count_distinct(ids).as_py() != len(ids):
        raise BadParameter(f"layer {name!r}: wanted each scenario_id once; group by it, or leave rows out")
    return pa.table({"scenario_id": ids, name: table[others[0]]}).sort_by("scenario_id")


def _check_ids(lake: Lake, values: pa.Table) -> None:
    query = "SELECT scenario_id FROM wanted ANTI JOIN metadata_rows USING (scenario_id) ORDER BY 1"
    missing = lake.arrow(query, wanted=values.select(["scenario_id"]))["scenario_id"].to_pylist()
    if not missing:
        return
    known = lake.arrow("SELECT scenario_id FROM metadata_rows LIMIT 1000")["scenario_id"].to_pylist()
    near = (difflib.get_close_matches(missing[0], known, n=1) or known[:1] or ["none"])[0]
    raise ScenarioNotFound(
        f"{lake.root}: {len(missing):,} of {values.num_rows:,} ids are no scenario of snapshot {lake.snapshot.number}, "
        f"for example {missing[0]}; ids look like {near}"
    )


def _read_file(path: Path) -> pa.Table:
    if path.suffix not in (".csv", ".parquet"):
        raise BadParameter(f"{path}: wanted a file name that ends in .csv or .parquet")
    if not path.is_file():
        raise BadParameter(f"{path}: no such file")
    try:
        return pa.csv.read_csv(path) if path.suffix == ".csv" else pq.read_table(path)
    except pa.ArrowException as error:
        raise BadParameter(f"{path}: {error}; wanted a table with scenario_id and a column") from error


def _versions(files: LakeFiles, name: str) -> list[int]:
    found = files.names(f"{_FOLDER}/{name}", ".parquet")
    return sorted(int(path.rpartition("/")[2].removesuffix(".parquet")) for path in found)


def _path(name: str, version: int) -> str:
    return f"{_FOLDER}/{name}/{version}.parquet"
