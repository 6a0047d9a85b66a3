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
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.named_sql import EVENTS, Conditions
from scenarionet_data.query.statements import check_expression
from scenarionet_data.storage.files.places import path_of
from scenarionet_data.storage.snapshots import snapshot as snapshots

if TYPE_CHECKING:
    import polars as pl


class Tagging(LakeView):
    """A view of a lake with verbs for user columns; a base class of :class:`~scenarionet_data.Lake`."""

    def tag(
        self,
        name: str,
        rows: pa.Table | pl.DataFrame | Mapping[str, Any],
        *,
        source: str = "python",
        replace: bool = False,
    ) -> UserColumn:
        """Add a user column to ``metadata``; call :meth:`refresh` to query it.

        Args:
            name: Name of the column: a lower-case word that is not a column yet.
            rows: A table with scenario_id and one more column, or a value by scenario id; null for other scenarios.
            source: Origin of the values, for the record.
            replace: Add a version if the user column exists.

        Raises:
            BadParameter: The name is taken or invalid, or the table has other columns.
            ScenarioNotFound: The lake does not have one of the ids.
            UserColumnExists: The user column exists and ``replace`` is False.
        """
        user_columns.check_name(name)
        try:
            check_expression(name)
        except ValueError as error:
            raise BadParameter(f"{name!r} is an SQL keyword; choose another name") from error
        values = _as_column(name, rows)
        _check_ids(self, values)
        while True:
            if user_columns.versions(self.files, name) and not replace:
                raise UserColumnExists(
                    f"user column {name!r} exists; choose another name, or replace=True for a new version of it",
                    cli_remedy="--replace",
                )
            # Lineages may know versions that were removed before a removal left a mark.
            used = [int(column.partition("@")[2]) for _, column in user_columns.users(self.files, name)]
            column = UserColumn(
                name=name,
                version=max([user_columns.next_version(self.files, name), *(number + 1 for number in used)]),
                type=str(values.schema.field(name).type),
                count=values.num_rows - values[name].null_count,
                source=source,
                snapshot=self.snapshot.number,
                created_at=snapshots.now(),
                created_with=software.NAME_AND_VERSION,
            )
            if user_columns.publish(self.files, values, column):
                return column

    def tag_by_sql(self, name: str, query: str, *, replace: bool = False) -> UserColumn:
        """Add a user column from a SELECT of scenario_id and one more column; see :meth:`tag`."""
        return self.tag(name, self.engine.arrow(query), source=query, replace=replace)

    def tag_where(self, name: str, where: str, *, replace: bool = False) -> UserColumn:
        """Add a label: whether a condition over the columns of ``metadata`` holds; see :meth:`tag`."""
        check_expression(where)
        return self.tag_by_sql(name, f"SELECT scenario_id, ({where}\n) AS {name} FROM metadata", replace=replace)

    def tag_event(self, name: str, event: Conditions, *, replace: bool = False) -> UserColumn:
        """Add a count: how often an event occurs, as ``"cut_in:max_gap=20"`` or ``{"cut_in": {"max_gap": 20}}``."""
        found = EVENTS.resolve(event)
        if len(found) != 1:
            raise BadParameter(f"wanted one event, found {len(found)}")
        ((definition, values),) = found
        query = (
            "SELECT scenario_id, count(hit.scenario_id) AS hits "
            f"FROM metadata LEFT JOIN (\n{definition.text}\n) AS hit USING (scenario_id) GROUP BY scenario_id"
        )
        return self.tag(name, self.engine.arrow(query, values), source=f"event {event}", replace=replace)

    def tag_from_file(
        self, name: str, path: str | Path, column: str | None = None, *, replace: bool = False
    ) -> UserColumn:
        """Add a user column from a CSV or Parquet file with scenario_id; see :meth:`tag`.

        Args:
            name: Name of the column in the lake.
            path: The file.
            column: Name of the column in the file; needed if it has several besides scenario_id.
            replace: Add a version if the user column exists.
        """
        path = path_of(path, "give a file of this machine")
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
        return self.tag(name, rows, source=path.name, replace=replace)

    def untag(self, name: str, *, force: bool = False) -> None:
        """Remove a user column with all its versions, or one version ``name@version``.

        Args:
            name: The user column.
            force: Remove it even if databases depend on it; those stay readable, but cannot be rebuilt.

        Raises:
            UserColumnNotFound: The message lists the existing ones.
            UserColumnInUse: Databases depend on it and ``force`` is False.
        """
        plain, version = records.parse_reference(name)
        user_columns.check_exists(self.files, plain, version)
        users = user_columns.users(self.files, plain, version)
        if users and not force:
            listed = ", ".join(f"{database} uses {column}" for database, column in users[:5])
            raise UserColumnInUse(
                f"{name} is needed to rebuild databases: {listed}; drop those first, or force=True",
                cli_remedy="--force",
            )
        user_columns.drop(self.files, plain, version)


def _as_column(name: str, rows: pa.Table | pl.DataFrame | Mapping[str, Any]) -> pa.Table:
    """Return a table of scenario_id and the values under the name of the column, in order of id."""
    if isinstance(rows, Mapping):
        try:
            table = pa.table({"scenario_id": pa.array(list(rows), pa.string()), name: list(rows.values())})
        except pa.ArrowException as error:
            raise BadParameter(f"user column {name!r}: wanted values of one type by scenario id: {error}") from error
    elif not isinstance(rows, pa.Table) and not hasattr(rows, "to_arrow"):
        raise BadParameter(f"user column {name!r}: wanted a table, or a value by scenario id, found {rows!r}")
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
