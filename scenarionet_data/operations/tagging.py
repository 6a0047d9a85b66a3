"""User columns from Python values, SQL, conditions, events and files."""

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
from scenarionet_data.databases import record as records
from scenarionet_data.databases import user_columns
from scenarionet_data.databases.user_columns import UserColumn
from scenarionet_data.errors import BadParameter, ScenarioNotFound, UserColumnExists, UserColumnInUse
from scenarionet_data.query.lake_view import LakeLike, LakeView, open_view
from scenarionet_data.query.named_sql import EVENTS, Conditions
from scenarionet_data.query.statements import check_expression
from scenarionet_data.storage.snapshots import snapshot as snapshots

if TYPE_CHECKING:
    import polars as pl


def tag(
    lake: LakeLike,
    name: str,
    rows: pa.Table | pl.DataFrame | Mapping[str, Any],
    *,
    source: str = "python",
    replace: bool = False,
) -> UserColumn:
    """Add a user column; see :meth:`Lake.tag <scenarionet_data.Lake.tag>`."""
    view = open_view(lake)
    user_columns.check_name(name)
    try:
        check_expression(name)
    except ValueError as error:
        raise BadParameter(f"{name!r} is an SQL keyword; choose another name") from error
    values = _as_column(name, rows)
    _check_ids(view, values)
    while True:
        existing = user_columns.versions(view.files, name)
        if existing and not replace:
            raise UserColumnExists(
                f"user column {name!r} exists; choose another name, or replace=True for a new version of it",
                cli_remedy="--replace",
            )
        # Lineages may know versions that were removed: a new one must not get such a number.
        used = [int(column.partition("@")[2]) for _, column in user_columns.users(view.files, name)]
        column = UserColumn(
            name=name,
            version=1 + max([0, *existing, *used]),
            type=str(values.schema.field(name).type),
            count=values.num_rows - values[name].null_count,
            source=source,
            snapshot=view.snapshot.number,
            created_at=snapshots.now(),
            created_with=software.name_and_version(),
        )
        if user_columns.publish(view.files, values, column):
            return column


def untag(lake: LakeLike, name: str, *, force: bool = False) -> None:
    """Remove a user column; see :meth:`Lake.untag <scenarionet_data.Lake.untag>`."""
    view = open_view(lake)
    plain, version = records.parse_reference(name)
    user_columns.check_exists(view.files, plain, version)
    users = user_columns.users(view.files, plain, version)
    if users and not force:
        listed = ", ".join(f"{database} uses {column}" for database, column in users[:5])
        raise UserColumnInUse(
            f"{name} is needed to rebuild databases: {listed}; drop those first, or force=True", cli_remedy="--force"
        )
    user_columns.drop(view.files, plain, version)


def tag_by_sql(lake: LakeLike, name: str, query: str, *, replace: bool = False) -> UserColumn:
    """Add a user column from a SELECT; see :meth:`Lake.tag_by_sql <scenarionet_data.Lake.tag_by_sql>`."""
    view = open_view(lake)
    return tag(view, name, view.engine.arrow(query), source=query, replace=replace)


def tag_where(lake: LakeLike, name: str, where: str, *, replace: bool = False) -> UserColumn:
    """Add a label from a condition; see :meth:`Lake.tag_where <scenarionet_data.Lake.tag_where>`."""
    check_expression(where)
    return tag_by_sql(lake, name, f"SELECT scenario_id, ({where}\n) AS {name} FROM metadata", replace=replace)


def tag_event(lake: LakeLike, name: str, event: Conditions, *, replace: bool = False) -> UserColumn:
    """Add a count of an event; see :meth:`Lake.tag_event <scenarionet_data.Lake.tag_event>`."""
    view = open_view(lake)
    found = EVENTS.resolve(event)
    if len(found) != 1:
        raise BadParameter(f"wanted one event, found {len(found)}")
    ((definition, values),) = found
    query = (
        "SELECT scenario_id, count(hit.scenario_id) AS hits "
        f"FROM metadata LEFT JOIN (\n{definition.text}\n) AS hit USING (scenario_id) GROUP BY scenario_id"
    )
    return tag(view, name, view.engine.arrow(query, values), source=f"event {event}", replace=replace)


def tag_from_file(
    lake: LakeLike, name: str, path: str | Path, column: str | None = None, *, replace: bool = False
) -> UserColumn:
    """Add a user column from a file; see :meth:`Lake.tag_from_file <scenarionet_data.Lake.tag_from_file>`."""
    path = Path(path)
    if path.suffix not in (".csv", ".parquet"):
        raise BadParameter(f"{path}: wanted a file name that ends in .csv or .parquet")
    if not path.is_file():
        raise BadParameter(f"{path}: no such file")
    try:
        rows = pa.csv.read_csv(path) if path.suffix == ".csv" else pq.read_table(path)
    except pa.ArrowException as error:
        raise BadParameter(f"{path}: {error}; wanted a table with scenario_id and a column") from error
    if column is not None:
        missing = {"scenario_id", column} - set(rows.column_names)
        if missing:
            have = ", ".join(rows.column_names)
            raise BadParameter(f"{path}: no column {' or '.join(sorted(missing))}; there are {have}")
        rows = rows.select(["scenario_id", column])
    return tag(lake, name, rows, source=path.name, replace=replace)


def _as_column(name: str, rows: pa.Table | pl.DataFrame | Mapping[str, Any]) -> pa.Table:
    """Return a table of scenario_id and the values under the name of the column, in order of id."""
    if isinstance(rows, Mapping):
        table = pa.table({"scenario_id": pa.array(list(rows), pa.string()), name: list(rows.values())})
    else:
        table = rows if isinstance(rows, pa.Table) else rows.to_arrow()
    others = [column for column in table.column_names if column != "scenario_id"]
    if "scenario_id" not in table.column_names or len(others) != 1:
        raise BadParameter(
            f"user column {name!r}: wanted scenario_id and one more column, found {', '.join(table.column_names)}; "
            "select two columns"
        )
    ids = table["scenario_id"].cast(pa.string())
    if ids.null_count or pc.count_distinct(ids).as_py() != len(ids):
        raise BadParameter(f"user column {name!r}: wanted each scenario_id once; group by it, or remove rows")
    return pa.table({"scenario_id": ids, name: table[others[0]]}).sort_by("scenario_id")


def _check_ids(view: LakeView, values: pa.Table) -> None:
    query = "SELECT scenario_id FROM wanted ANTI JOIN metadata_rows USING (scenario_id) ORDER BY 1"
    missing = view.engine.arrow(query, tables={"wanted": values.select(["scenario_id"])})["scenario_id"].to_pylist()
    if not missing:
        return
    known = view.engine.arrow("SELECT scenario_id FROM metadata_rows LIMIT 1000")["scenario_id"].to_pylist()
    near = (difflib.get_close_matches(missing[0], known, n=1) or known[:1] or ["none"])[0]
    raise ScenarioNotFound(
        f"{view.root}: {len(missing):,} of {values.num_rows:,} ids are not in snapshot {view.snapshot.number}, "
        f"for example {missing[0]}; ids look like {near}"
    )
