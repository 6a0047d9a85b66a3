"""The lake as a person asks it: SQL, filters, splits, databases. Reading only, but for the databases it saves."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.databases import record as databases
from scenarionet_data.databases import user_columns as layer_files
from scenarionet_data.databases.record import Database
from scenarionet_data.errors import BadParameter, ScenarioNotFound
from scenarionet_data.operations import (
    combine,
    comparison,
    database_query,
    events,
    tagging,
)
from scenarionet_data.operations import (
    diff as comparing,
)
from scenarionet_data.operations import (
    filter as filtering,
)
from scenarionet_data.operations import lineage as ancestors
from scenarionet_data.operations import (
    overlap as overlapping,
)
from scenarionet_data.operations import (
    rebuild as repeating,
)
from scenarionet_data.operations import (
    sample as sampling,
)
from scenarionet_data.operations import (
    split as splitting,
)
from scenarionet_data.packs import packing
from scenarionet_data.query.engine import Engine, Rows
from scenarionet_data.query.members import ADDRESS_COLUMNS, locate
from scenarionet_data.query.named_sql import QUESTIONS
from scenarionet_data.query.views import FILE_TABLES, table_files
from scenarionet_data.storage.files.opening import open_files
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot

if TYPE_CHECKING:
    import polars as pl


class Lake:
    """One snapshot of a lake, open for questions.

    Args:
        root: The lake's folder or URL.
        snapshot: Its number; the newest unless given.
        layers: Versions of layers to show, by name; the newest of each other.

    Raises:
        NoSuchSnapshot: There is no lake, or no such snapshot.
        LayerNotFound: There is no such version of a layer.

    Example:
        lake = Lake("lake")
        lake.sql("SELECT dataset, count(*) AS n FROM metadata GROUP BY ALL")
        busy = lake.filter("ego_distance > 10 AND num_objects > 200", name="busy")
        train, val = lake.split(busy, {"train": 0.9, "val": 0.1}, seed=0).values()
    """

    def __init__(self, root: str | Path, snapshot: int | None = None, layers: Mapping[str, int] | None = None) -> None:
        self.files = open_files(root)
        snapshots.check_is_lake(self.files)
        self.snapshot: Snapshot = snapshots.read(self.files, snapshot)
        self.layers: dict[str, int] = layer_files.shown(self.files, layers or {})
        self._chosen: pa.Table | None = None

    def __repr__(self) -> str:
        return f"Lake({str(self.files.root)!r}, snapshot={self.snapshot.number})"

    def _repr_html_(self) -> str:
        from scenarionet_data.display import lake_card

        return lake_card(self)

    @property
    def root(self) -> Path | str:
        """Absolute path of the lake, or its URL."""
        return self.files.root

    @property
    def name(self) -> str:
        """The last part of its path."""
        return str(self.root).rstrip("/").rpartition("/")[2]

    def refresh(self) -> Lake:
        """The same lake at its newest snapshot."""
        return Lake(self.root)

    def at(self, snapshot: int, layers: Iterable[str] = ()) -> Lake:
        """The same lake at another snapshot, with these versions of layers (``name@version``)."""
        pinned = self.layers | layer_files.parse(layers)
        is_same = snapshot == self.snapshot.number and pinned == self.layers
        return self if is_same else Lake(self.root, snapshot, pinned)

    def only(self, scenarios: Database | str | Iterable[str]) -> Lake:
        """The lake at a snapshot that holds some scenarios, whose views show these and no others.

        Args:
            scenarios: A database or its name, or ids.

        Raises:
            ScenarioNotFound: One is not there.
        """
        holder, members = self.resolve(scenarios)
        chosen = Lake(self.root, holder.snapshot.number, self.layers)
        chosen._chosen = members
        return chosen

    @cached_property
    def _engine(self) -> Engine:
        return Engine(self.files, self.snapshot, layers=self.layers, only=self._chosen)

    # --- questions ------------------------------------------------------------------------------------

    def sql(self, query: str, parameters: Mapping[str, Any] | None = None) -> pl.DataFrame:
        """Rows of one SELECT over the lake's views.

        They are metadata, tracks, lights, maps, states, steps, objects, shards, quarantine, and those of
        docs/guides/events.md.

        Args:
            query: The SELECT.
            parameters: Values for ``$name`` in it.

        Raises:
            UnsafeSql: It is more or other than one SELECT.
            QueryError: DuckDB does not understand it.
        """
        return self._engine.select(query, parameters)

    def arrow(
        self,
        query: str,
        parameters: Mapping[str, Any] | None = None,
        *,
        layers: Iterable[str] | None = None,
        **tables: Rows,
    ) -> pa.Table:
        """Like :meth:`sql`, as an Arrow table; see :meth:`Engine.arrow`."""
        return self._engine.arrow(query, parameters, layers=layers, **tables)

    def batches(
        self, query: str, parameters: Mapping[str, Any] | None = None, *, layers: Iterable[str] | None = None
    ) -> Generator[pa.RecordBatch, None, None]:
        """Like :meth:`arrow`, some rows at a time; every other question waits until it is closed, or at its end."""
        return self._engine.batches(query, parameters, layers=layers)

    def interrupt(self) -> None:
        """Stop the question that another thread has asked; it fails there with a QueryError."""
        self._engine.interrupt()

    # Explained where they are done.
    mine = events.mine
    compare = comparison.compare
    tag = tagging.tag
    tag_by_sql = tagging.tag_by_sql
    tag_where = tagging.tag_where
    tag_event = tagging.tag_event
    tag_from_file = tagging.tag_from_file
    untag = tagging.untag

    def summary(self) -> pl.DataFrame:
        """Scenarios, objects and hours by dataset, version and split."""
        return self.ask("summary")

    def ask(self, name: str, words: Mapping[str, str] | None = None) -> pl.DataFrame:
        """Rows of a named question of ``sql/analytics``.

        Args:
            name: Its file's name.
            words: Values for its parameters, as typed; the rest keep their defaults.

        Raises:
            UnknownQuery: There is none of that name.
            BadParameter: It has no such parameter.
        """
        question = QUESTIONS.load(name)
        return self.sql(question.text, question.bind(words or {}))

    def facts(self, scenario_id: str) -> dict[str, Any]:
        """What is known about a scenario: its row of the view ``metadata`` without its addresses.

        Args:
            scenario_id: Its id, its id in the source, or a part of its id, when only one scenario has that.

        Raises:
            ScenarioNotFound: There is none, or several; the message lists a few that come near.
        """
        rows = f"SELECT * EXCLUDE ({', '.join(ADDRESS_COLUMNS)}) FROM metadata"
        found = self.sql(f"{rows} WHERE scenario_id = $id", {"id": scenario_id})
        if found.is_empty():
            near = "source_scenario_id = $id OR contains(scenario_id, $id) ORDER BY scenario_id LIMIT 3"
            found = self.sql(f"{rows} WHERE {near}", {"id": scenario_id})
        if len(found) != 1:
            ids = ", ".join(found["scenario_id"])
            remedy = f"did you mean {ids}?" if ids else "SELECT scenario_id FROM metadata lists them all"
            raise ScenarioNotFound(f"{self.root}: no one scenario {scenario_id!r} in this snapshot; {remedy}")
        return found.row(0, named=True)

    def history(self, last: int = 5) -> list[Snapshot]:
        """The newest snapshots up to this one, rising."""
        there = [number for number in snapshots.numbers(self.files) if number <= self.snapshot.number]
        return [snapshots.read(self.files, number) for number in there[-last:]]

    def paths(self, table: str) -> list[str]:
        """Absolute paths (or URLs) of a table's files in this snapshot: what any Parquet engine may read."""
        if table not in FILE_TABLES:
            raise BadParameter(f"no table {table!r}; there are {', '.join(FILE_TABLES)}")
        return [self.files.url(name) for name in table_files(self.files, self.snapshot, table)]

    def __len__(self) -> int:
        return int(self.sql("SELECT count(*) AS n FROM metadata")["n"][0])

    # --- databases ------------------------------------------------------------------------------------

    @property
    def databases(self) -> list[str]:
        """Names of the lake's databases."""
        return databases.names(self.files)

    def database(self, which: Database | str) -> Database:
        """A database by ``name`` or ``name@version``: how it was made, and its members when they are asked for.

        Raises:
            DatabaseNotFound: The message lists those that are there.
        """
        return databases.resolve(self.files, which)

    # What is done with databases is explained where it is done.
    filter = filtering.keep
    split = splitting.split
    sample = sampling.sample
    merge = combine.merge
    intersect = combine.intersect
    subtract = combine.subtract
    copy = combine.copy
    rename = combine.rename
    drop = combine.drop
    checkout = combine.checkout
    ancestry = ancestors.ancestry
    rebuild = repeating.rebuild
    rebase = repeating.rebase
    diff = comparing.diff
    overlap = overlapping.overlap
    pack = packing.pack

    # --- scenarios ------------------------------------------------------------------------------------

    def members(self, database: Database | str) -> pa.Table:
        """Address and description columns of a database's members, in order.

        They are looked up in this snapshot when every member is what it was when the database was made, else
        in the snapshot it was made on, with a warning.

        Raises:
            ScenarioNotFound: They are in neither.
        """
        return self._holding(self.database(database))[1]

    def locate(self, scenario_ids: Sequence[str]) -> pa.Table:
        """Address and description columns of scenarios, in the given order.

        Raises:
            ScenarioNotFound: Naming the first that is not in this snapshot.
        """
        found = locate(self._engine, pa.table({"scenario_id": pa.array(list(scenario_ids), pa.string())}))
        return self._complete(found)

    def resolve(self, scenarios: Database | str | Iterable[str] | None) -> tuple[Lake, pa.Table]:
        """Scenarios as rows of addresses, and the lake at the snapshot that holds them.

        Args:
            scenarios: A database or its name, ids, or None for every scenario in order of id.

        Raises:
            ScenarioNotFound: One is not there.
        """
        if scenarios is None:
            scenarios = self._engine.arrow("SELECT scenario_id FROM metadata ORDER BY scenario_id")[0].to_pylist()
        if isinstance(scenarios, (Database, str)):
            return self._holding(self.database(scenarios))
        return self, self.locate(list(scenarios))

    def shared_maps(self) -> dict[tuple[str, str, str], str]:
        """File of each map that scenarios share, by dataset, version and map id."""
        listed = manifests.shard_table(self.files, self.snapshot).filter(pc.field("split") == "").to_pylist()
        return {(row["dataset"], row["version"], row["name"]): row["files"][0] for row in listed}

    def _holding(self, database: Database) -> tuple[Lake, pa.Table]:
        """The lake at a snapshot that holds every member unchanged, and where they lie in it."""
        lake = database_query.holding(self, [database])
        return lake, lake._complete(locate(lake._engine, database.members.select(["scenario_id", "content_hash"])))

    def _complete(self, found: pa.Table) -> pa.Table:
        missing = found.filter(pc.invert(found["is_found"]))
        if missing.num_rows:
            raise ScenarioNotFound(
                f"{self.root}: no scenario {missing['scenario_id'][0]} in snapshot {self.snapshot.number}; "
                f"{missing.num_rows} of {found.num_rows} are missing: replaced, or never converted"
            )
        return found
