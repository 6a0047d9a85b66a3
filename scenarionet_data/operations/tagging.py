"""Tagging: users' columns from Python, SQL, conditions, events and files become layers."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from scenarionet_data import version as software
from scenarionet_data.databases import record as databases
from scenarionet_data.databases import user_columns
from scenarionet_data.databases.user_columns import Layer
from scenarionet_data.errors import BadParameter, LayerExists, LayerInUse, ScenarioNotFound
from scenarionet_data.query.named_sql import EVENTS
from scenarionet_data.query.statements import check_expression
from scenarionet_data.storage.snapshots import snapshot as snapshots

if TYPE_CHECKING:
    import polars as pl

    from scenarionet_data.lake.lake import Lake


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
    user_columns.check_name(name)
    values = _as_layer(name, rows)
    _check_ids(lake, values)
    while True:
        there = user_columns.versions(lake.files, name)
        if there and not replace:
            raise LayerExists(f"layer {name!r} exists; give another name, or --replace for a new version of it")
        layer = Layer(
            name=name,
            version=1 + max([0, *there, *_remembered(lake, name)]),
            type=str(values.schema.field(name).type),
            count=values.num_rows - values[name].null_count,
            source=source,
            snapshot=lake.snapshot.number,
            created_at=snapshots.now(),
            created_with=software.name_and_version(),
        )
        if user_columns.publish(lake.files, values, layer):
            return layer


def untag(lake: Lake, reference: str, *, force: bool = False) -> None:
    """Remove a column of :func:`tag`; the scenarios stay.

    Args:
        lake: The lake; open it again (``refresh``) to ask without the column.
        reference: ``name``, with all its versions, or ``name@version``.
        force: Even when queries of databases asked it; those can be read as before, but not rebuilt.

    Raises:
        LayerNotFound: The message lists what is there.
        LayerInUse: Queries of databases asked it, and ``force`` is False.
    """
    name, version = databases.parse_reference(reference)
    user_columns.check_there(lake.files, name, version)
    users = user_columns.needing(lake.files, name, version)
    if users and not force:
        listed = ", ".join(f"{database} asked {layer}" for database, layer in users[:5])
        raise LayerInUse(f"{reference} is needed to rebuild databases: {listed}; drop those first, or --force")
    user_columns.drop(lake.files, name, version)


def _remembered(lake: Lake, name: str) -> list[int]:
    """Versions of a layer that lineages know, also of one that is gone: a new one must not pass for it."""
    return [int(layer.partition("@")[2]) for _, layer in user_columns.needing(lake.files, name)]


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
    found, values = EVENTS.parse(event)
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
