"""Read access to one snapshot of a lake: files, SQL, and the addresses of scenarios.

The handle :class:`scenarionet_data.Lake` adds operations on databases; lower layers need no more than this view.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Int32, is_count
from scenarionet_data.databases import record as records
from scenarionet_data.databases import user_columns as user_column_records
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.databases.row_sets import RowSets
from scenarionet_data.errors import BadParameter, NoSuchSnapshot, ScenarioNotFound
from scenarionet_data.query.members import StaleDatabaseWarning, as_ids, count_changed, known_rows, locate
from scenarionet_data.query.named_sql import ANALYTICS
from scenarionet_data.query.views import FILE_TABLES, table_files
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.read.metadata_rows import (
    ADDRESS_COLUMNS,
    MetadataRows,
    ScenarioIndex,
    order_of_ids,
)
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot

if TYPE_CHECKING:
    import polars as pl

    from scenarionet_data.query.engine import Engine, Rows


class LakeView:
    """One snapshot of a lake, open for queries.

    Args:
        root: Folder or URL of the lake.
        snapshot: Number of the snapshot; the newest by default.
        user_columns: Versions of user columns by name; the newest of all others.
        max_memory: Memory of queries [bytes], beyond which they spill to disk or fail; 80 % of the machine's by
            default.

    Attributes:
        files: Files of the lake.
        snapshot: The snapshot.
        user_columns: Version of each user column, by name.

    Raises:
        NoSuchSnapshot: The folder is not a lake, or it has no such snapshot.
        UserColumnNotFound: A user column has no such version.
    """

    def __init__(
        self,
        root: str | Path,
        snapshot: int | None = None,
        user_columns: Mapping[str, int] | None = None,
        *,
        max_memory: int | None = None,
    ) -> None:
        for what, value in (("snapshot", snapshot), ("max_memory", max_memory)):
            if not (value is None or isinstance(value, int)):
                raise BadParameter(f"{what}: wanted a number or None, found {value!r}")
        if not isinstance(user_columns, Mapping | None):
            raise BadParameter(f"user_columns: wanted versions by name, as {{'weather': 2}}, found {user_columns!r}")
        self.files = open_files(root)
        self.snapshot: Snapshot = snapshots.read(self.files, snapshot)
        if self.snapshot == snapshots.EMPTY:
            snapshots.check_is_lake(self.files)
        self.user_columns: dict[str, int] = user_column_records.current(self.files, user_columns or {})
        self._max_memory = max_memory
        self._chosen: pa.Table | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({str(self.root)!r}, snapshot={self.snapshot.number})"

    def __getstate__(self) -> dict[str, Any]:
        own = "engine", "keeping", "rows"  # of each process
        return {name: value for name, value in self.__dict__.items() if name not in own}

    @property
    def root(self) -> Path | str:
        """Absolute path of the lake, or its URL."""
        return self.files.root

    @property
    def name(self) -> str:
        """Last part of the path."""
        return str(self.root).rstrip("/").rpartition("/")[2]

    @cached_property
    def engine(self) -> Engine:
        """Connection that runs the queries, opened on first use."""
        from scenarionet_data.query.engine import Engine  # here: a loader needs no DuckDB

        chosen, max_memory = self._chosen, self._max_memory
        return Engine(self.files, self.snapshot, user_columns=self.user_columns, chosen=chosen, max_memory=max_memory)

    @cached_property
    def keeping(self) -> Self:
        """The same view, with a connection that computes what many relations read once, and keeps its rows."""
        keeping = type(self)(self.root, self.snapshot.number, self.user_columns, max_memory=self._max_memory)
        keeping._chosen = self._chosen
        keeping.engine.keep_views()
        return keeping

    @cached_property
    def rows(self) -> RowSets | None:
        """All scenarios by their rows in the metadata files; None if they are few, or only some are shown."""
        count = manifests.column(self.files, self.snapshot, "num_scenarios").to_numpy().sum()
        if self._chosen is not None or count < snapshots.MANY:
            return None
        return RowSets.every(self.files, self.snapshot.metadata)

    # --- other views of the same lake -----------------------------------------------------------------

    def refresh(self) -> Self:
        """Open the lake at its newest snapshot."""
        return type(self)(self.root, max_memory=self._max_memory)

    def at_snapshot(self, number: int, user_columns: Iterable[str] = ()) -> Self:
        """Open the lake at another snapshot.

        Args:
            number: Number of the snapshot.
            user_columns: Versions of user columns to use, as ``name@version``.

        Raises:
            NoSuchSnapshot: The snapshot does not exist; the message lists the existing ones.
        """
        pinned = self.user_columns | user_column_records.parse(user_columns)
        is_same = number == self.snapshot.number and pinned == self.user_columns
        return self if is_same else type(self)(self.root, number, pinned, max_memory=self._max_memory)

    def restrict_to(self, scenarios: DatabaseRecord | str | Iterable[str]) -> Self:
        """Open the lake with views that show some scenarios only, at a snapshot that has them.

        Args:
            scenarios: A database or its name, or scenario ids.

        Raises:
            ScenarioNotFound: A scenario is missing.
        """
        view, members = self.resolve(scenarios)
        restricted = type(self)(self.root, view.snapshot.number, self.user_columns, max_memory=self._max_memory)
        restricted._chosen = members
        return restricted

    # --- queries --------------------------------------------------------------------------------------

    def sql(self, query: str, parameters: Mapping[str, Any] | None = None) -> pl.DataFrame:
        """Run one SELECT over the views of the lake and return its rows as a Polars data frame.

        docs/reference/views.md lists the views: metadata, tracks, lights, maps, states, objects and others.

        Args:
            query: The SELECT.
            parameters: Values for ``$name`` in the query.

        Raises:
            UnsafeSql: It is not exactly one SELECT.
            QueryError: DuckDB rejects the query.
        """
        return self.engine.select(query, parameters)

    def arrow(
        self, query: str, parameters: Mapping[str, Any] | None = None, *, tables: Mapping[str, Rows] | None = None
    ) -> pa.Table:
        """Run one SELECT like :meth:`sql` and return its rows as an Arrow table.

        Args:
            query: The SELECT.
            parameters: Values for ``$name`` in the query.
            tables: Arrow tables that the query may use, by name.
        """
        return self.engine.arrow(query, parameters, tables=tables)

    def named_query(self, name: str, parameters: Mapping[str, Any] | None = None) -> pl.DataFrame:
        """Run a query of ``sql/analytics``.

        Args:
            name: Name of its file.
            parameters: Values of its parameters; the others keep their defaults.

        Raises:
            UnknownQuery: No such query.
            BadParameter: No such parameter, or a value of another type.
        """
        query = ANALYTICS.load(name)
        return self.sql(query.text, query.bind(parameters or {}))

    def interrupt(self) -> None:
        """Cancel a query that another thread runs; it fails there with a QueryError."""
        self.engine.interrupt()

    def summary(self) -> pl.DataFrame:
        """Return scenarios, objects and hours by dataset, version and split."""
        return self.named_query("summary")

    def describe(self, scenario_id: str) -> dict[str, Any]:
        """Return the row of a scenario in the view ``metadata``, without addresses.

        Args:
            scenario_id: The id, its last part, the id in the source, or another part that only one scenario has.

        Raises:
            BadParameter: It is no text.
            ScenarioNotFound: No scenario matches, or several do; the message lists a few of them.
        """
        if not isinstance(scenario_id, str):
            raise BadParameter(f"scenario_id: wanted a text, found {scenario_id!r}")
        rows = f"SELECT * EXCLUDE ({', '.join(ADDRESS_COLUMNS)}) FROM metadata"
        is_last = "source_scenario_id = $id OR ends_with(scenario_id, '/' || $id)"
        for matches in ("scenario_id = $id", is_last, "contains(scenario_id, $id)"):
            found = self.arrow(f"{rows} WHERE {matches} ORDER BY scenario_id LIMIT 3", {"id": scenario_id})
            if len(found):
                break
        if len(found) != 1:
            ids = ", ".join(found["scenario_id"].to_pylist())
            remedy = f"did you mean {ids}?" if ids else "SELECT scenario_id FROM metadata lists them all"
            raise ScenarioNotFound(f"{self.root}: no one scenario {scenario_id!r} in this snapshot; {remedy}")
        described: dict[str, Any] = found.to_pylist()[0]
        return described

    def __len__(self) -> int:
        return int(self.engine.arrow("SELECT count(*) FROM metadata")[0][0].as_py())

    # --- files and records ----------------------------------------------------------------------------

    def history(self, last: int = 5) -> list[Snapshot]:
        """Return the newest snapshots up to this one, in ascending order."""
        if not is_count(last, 1):
            raise BadParameter(f"last: wanted a whole number of 1 or more, found {last!r}")
        numbers = [number for number in snapshots.numbers(self.files) if number <= self.snapshot.number]
        return [snapshots.read(self.files, number) for number in numbers[-last:]]

    def paths(self, table: str) -> list[str]:
        """Return absolute paths or URLs of the files of a table in this snapshot, for any Parquet reader."""
        if table not in FILE_TABLES:
            raise BadParameter(f"no table {table!r}; there are {', '.join(FILE_TABLES)}")
        return [self.files.url(name) for name in table_files(self.files, self.snapshot, table)]

    def shared_maps(self) -> dict[tuple[str, str, str], str]:
        """Return the file of each map that scenarios share, by dataset, version and map id."""
        return manifests.shared_maps(self.files, self.snapshot)

    @property
    def databases(self) -> list[str]:
        """Names of the databases of the lake, sorted."""
        return records.names(self.files)

    def record(self, database: DatabaseRecord | str) -> DatabaseRecord:
        """Return the record of a database by ``name`` or ``name@version``.

        Raises:
            DatabaseNotFound: The message lists the existing databases.
            BadParameter: It is neither a name nor a database.
        """
        if not isinstance(database, DatabaseRecord | str):
            raise BadParameter(f"wanted a database or its name, found {database!r}; there are {self.databases}")
        return records.resolve(self.files, database)

    # --- scenarios ------------------------------------------------------------------------------------

    def resolve(self, scenarios: DatabaseRecord | str | Iterable[str] | None) -> tuple[Self, pa.Table]:
        """Find scenarios: a view at a snapshot that has them, and their rows with addresses and descriptions.

        Members of a database are read from this snapshot if it has all of them unchanged, else from the snapshot the
        database was made on, with a warning.

        Args:
            scenarios: A database or its name, ids, or None for all scenarios in order of id.

        Raises:
            ScenarioNotFound: A scenario is missing.
        """
        if scenarios is None:
            scenarios = self.engine.arrow("SELECT scenario_id FROM metadata ORDER BY scenario_id")[0].to_pylist()
        if isinstance(scenarios, DatabaseRecord | str):
            database = self.record(scenarios)
            view = self.with_members([database])
            wanted = database.members.select(["scenario_id", "content_hash"])
        else:
            view, wanted = self, pa.table({"scenario_id": as_ids(scenarios)})
        found = locate(view.engine, wanted)
        view._require_all(found["scenario_id"], found["is_found"])
        return view, found

    def find(self, scenarios: DatabaseRecord | str | Iterable[str] | None) -> tuple[Self, MetadataRows]:
        """Find scenarios like :meth:`resolve`, without SQL: their rows are read when they are needed.

        Raises:
            ScenarioNotFound: A scenario is missing.
        """
        if isinstance(scenarios, DatabaseRecord | str):
            return self._find_members(self.record(scenarios))
        if scenarios is None:
            if self._chosen is None:
                return self, self._at(order_of_ids(self.files, self.snapshot.metadata))
            scenarios = sorted(self._chosen["scenario_id"].to_pylist())
        ids = as_ids(scenarios)
        found, is_found = ScenarioIndex(self.files, self.snapshot).find(ids)
        if self._chosen is not None:
            is_found &= np.isin(ids.to_numpy(zero_copy_only=False), self._chosen["scenario_id"].to_numpy())
        self._require_all(ids, pa.array(is_found))
        return self, found

    def _find_members(self, database: DatabaseRecord) -> tuple[Self, MetadataRows]:
        rows = known_rows(database, self.rows)
        if rows is not None:
            return self, self._at(rows.ordered(self.files))
        ids, hashes = (database.members[name].combine_chunks() for name in ("scenario_id", "content_hash"))
        found, is_found = ScenarioIndex(self.files, self.snapshot, with_hashes=True).find(ids, hashes.to_numpy())
        if is_found.all() and self._chosen is None:
            return self, found
        view = self.with_members([database])
        return view, view.find(ids.to_pylist())[1]

    def _at(self, rows: Int32) -> MetadataRows:
        return MetadataRows(self.files, self.snapshot, None, rows)

    def _require_all(self, ids: pa.Array | pa.ChunkedArray, is_found: pa.Array | pa.ChunkedArray) -> None:
        missing = ids.filter(pa.array(~is_found.to_numpy(zero_copy_only=False)))
        if len(missing):
            raise ScenarioNotFound(
                f"{self.root}: no scenario {missing[0]} in snapshot {self.snapshot.number}; "
                f"{len(missing)} of {len(ids)} are missing: replaced, or never converted"
            )

    def with_members(self, databases: Sequence[DatabaseRecord]) -> Self:
        """Return a view at a snapshot that has all members of some databases unchanged.

        That is this snapshot if possible, else the newest that one of the databases was made on, with a warning.

        Raises:
            ScenarioNotFound: No such snapshot has them all.
            NoSuchSnapshot: The snapshot that a database was made on has expired.
        """
        changed = {database.reference: count_changed(self.engine, database, self.rows) for database in databases}
        stale = [database for database in databases if changed[database.reference][0]]
        if not stale:
            return self
        first, latest = stale[0], max(stale, key=lambda database: database.lineage.snapshot)
        try:
            older = self.at_snapshot(latest.lineage.snapshot)
        except NoSuchSnapshot as error:
            raise NoSuchSnapshot(
                f"{latest.reference} was made on snapshot {latest.lineage.snapshot}, which has expired, and some of "
                f"its members have changed since; {_rebase(latest)} makes it again on the newest snapshot",
                cli_remedy=f"scenarionet db rebase {self.root} {latest.name}",
            ) from error
        for database in databases:
            count, example = count_changed(older.engine, database, older.rows)
            if count:
                raise ScenarioNotFound(
                    f"{self.root}: no snapshot has the members of {' and '.join(d.reference for d in databases)} "
                    f"unchanged: {count:,} of {len(database):,} of {database.reference} are not in snapshot "
                    f"{older.snapshot.number}, for example {example}; update it with {_rebase(first)}",
                    cli_remedy=f"scenarionet db rebase {self.root} {first.name}",
                )
        warnings.warn(
            StaleDatabaseWarning(
                f"{changed[first.reference][0]} of {len(first)} members of {first.reference} changed after snapshot "
                f"{first.lineage.snapshot} and are read from it; {_rebase(first)} updates the database",
                cli_remedy=f"scenarionet db rebase {self.root} {first.name}",
            ),
            stacklevel=3,
        )
        return older


LakeLike: TypeAlias = LakeView | str | Path
"""A lake: an open one, its path or its URL."""


def open_view(lake: LakeLike) -> LakeView:
    """Return the lake itself if it is open, else open the newest snapshot at a path or URL."""
    return lake if isinstance(lake, LakeView) else LakeView(lake)


def _rebase(database: DatabaseRecord) -> str:
    return f'lake.rebase("{database.name}")' if database.is_saved else "selecting again"
