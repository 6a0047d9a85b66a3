"""The handle :class:`Lake`: queries over one snapshot of a lake, and the operations on its databases."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.lake.comparisons import ComparableLake
from scenarionet_data.lake.database import Database
from scenarionet_data.lake.tagging import TaggableLake
from scenarionet_data.operations import combine
from scenarionet_data.operations.diff import Diff
from scenarionet_data.operations.filter import filter_database, select_scenarios
from scenarionet_data.operations.lineage import LineageTree, lineage_tree
from scenarionet_data.operations.rebuild import RebuildResult, rebase, rebuild
from scenarionet_data.operations.sample import sample
from scenarionet_data.operations.split import split
from scenarionet_data.query.named_sql import Conditions

if TYPE_CHECKING:  # loading, packs and export import numba, which takes 0.5 s that a query does not need
    from scenarionet_data.execution.executors import Executor
    from scenarionet_data.execution.progress import Progress
    from scenarionet_data.export import ExportReport
    from scenarionet_data.loader import ScenarioLoader
    from scenarionet_data.packs.packing import PackReport
    from scenarionet_data.publishing.publish import Catalog, PublishReport


class Lake(TaggableLake, ComparableLake):
    """One snapshot of a lake, open for queries and for operations on databases.

    Args:
        root: Folder or URL of the lake.
        snapshot: Number of the snapshot; the newest by default.
        user_columns: Versions of user columns by name; the newest of all others.
        max_memory: Memory of queries [bytes], beyond which they spill to disk or fail; 80 % of the machine's by
            default.

    Raises:
        NoSuchSnapshot: The folder is not a lake, or it has no such snapshot.
        UserColumnNotFound: A user column has no such version.

    Example:
        lake = Lake("lake")
        lake.sql("SELECT dataset, count(*) AS n FROM metadata GROUP BY ALL")
        busy = lake.filter("ego_distance > 10 AND num_objects > 200", name="busy")
        train, val = busy.split({"train": 0.9, "val": 0.1}, seed=0).values()
    """

    # --- databases ------------------------------------------------------------------------------------

    def database(self, database: DatabaseRecord | str) -> Database:
        """Return a database by ``name`` or ``name@version``.

        Raises:
            DatabaseNotFound: The message lists the existing databases.
        """
        return Database.of(self.record(database), self)

    def select(
        self,
        where: str = "true",
        *,
        database: DatabaseRecord | str | None = None,
        filters: Conditions = (),
        events: Conditions = (),
        ids: Sequence[str] | None = None,
        parameters: Mapping[str, Any] | None = None,
    ) -> Database:
        """Select the scenarios that satisfy all conditions, without saving them; see :meth:`filter`."""
        found = select_scenarios(
            self, where, database=database, filters=filters, events=events, ids=ids, parameters=parameters
        )
        return Database.of(found, self)

    def filter(
        self,
        where: str = "true",
        *,
        name: str,
        database: DatabaseRecord | str | None = None,
        filters: Conditions = (),
        events: Conditions = (),
        ids: Sequence[str] | None = None,
        parameters: Mapping[str, Any] | None = None,
        replace: bool = False,
        allow_empty: bool = False,
    ) -> Database:
        """Save the scenarios that satisfy all conditions as a database.

        Args:
            where: SQL condition over the columns of ``metadata``.
            name: Name of the new database.
            database: Search only the members of this database, in its order; the whole lake by default.
            filters: Filters of ``sql/filters``: ``"ego_distance"``, ``["ego_distance:min=100", ...]`` or
                ``{"ego_distance": {"min": 100}}``.
            events: Events of ``sql/events`` that must occur, in the same forms.
            ids: Ids or source ids that scenarios must have.
            parameters: Values for ``$name`` in ``where``: numbers, texts, truth values, lists of them.
            replace: Add a version if the database exists.
            allow_empty: Save a database without members, too.

        Raises:
            UnsafeSql: ``where`` is not a single expression.
            QueryError: DuckDB rejects the condition; the message has the position and similar names.
            UnknownFilter, UnknownEvent, BadParameter: The message lists the valid names.
            ScenarioNotFound: One of ``ids`` does not exist.
            DatabaseExists: The database exists and ``replace`` is False.
            EmptyResult: No scenario satisfies the conditions and ``allow_empty`` is False.
        """
        found = filter_database(
            self,
            where,
            name=name,
            database=database,
            filters=filters,
            events=events,
            ids=ids,
            parameters=parameters,
            replace=replace,
            allow_empty=allow_empty,
        )
        return Database.of(found, self)

    def split(
        self,
        database: DatabaseRecord | str | None = None,
        fractions: Mapping[str, float] | None = None,
        *,
        name: str | None = None,
        seed: int = 0,
        by: str = "scenario_id",
        stratify: str | None = None,
        along: str | None = None,
        levels: int | None = None,
        each: str | None = None,
        strict: bool = False,
        replace: bool = False,
        allow_empty: bool = False,
    ) -> dict[str, Database]:
        """Split a database by fractions, into levels, or by the values of a column, and save the parts.

        By fractions alone, the part of a scenario (or group, for example ``by="source_log"``) depends on a hash of its
        id and the seed, so that it stays the same as the lake grows, and on all machines. ``stratify`` gives every part
        its fraction of each value of a column, and ``along`` splits in the order of a column, for example a date: both
        depend on all scenarios, and change as the lake grows.

        Args:
            database: Database to split; the whole lake by default.
            fractions: Fraction of each part by its name; they add up to 1.
            name: Parts are saved as ``<name>_<part>``; by default the name of the database, or ``all``.
            seed: Another seed gives another split.
            by: Column whose equal values stay together.
            stratify: Column whose values are each split by the fractions.
            along: Column whose order the parts follow; equal values stay together.
            levels: Instead of fractions: number of parts ``level1``, ... of equal size in the order of ``along``
                (difficulty by default).
            each: Instead of fractions: column with one part for each value.
            strict: Raise for a split that leaks, instead of a warning.
            replace: Add a version to parts that exist.
            allow_empty: Save parts without members, too.

        Raises:
            BadParameter: Fractions do not add up to 1, a column does not exist, or arguments exclude each other.
            LeakingSplit: Several parts have scenarios of one source log, and ``strict`` is True.
            DatabaseExists, EmptyResult: See :meth:`filter`; no part is saved.
        """
        parts = split(
            self,
            database,
            fractions,
            name=name,
            seed=seed,
            by=by,
            stratify=stratify,
            along=along,
            levels=levels,
            each=each,
            strict=strict,
            replace=replace,
            allow_empty=allow_empty,
        )
        return {part: Database.of(found, self) for part, found in parts.items()}

    def sample(
        self,
        database: DatabaseRecord | str | None = None,
        *,
        name: str,
        n: int | None = None,
        fraction: float | None = None,
        seed: int = 0,
        weights: str = "1",
        stratify: str | None = None,
        balance: str | None = None,
        levels: int | None = None,
        replace: bool = False,
        allow_empty: bool = False,
    ) -> Database:
        """Save scenarios drawn without replacement, in the order of the database.

        Args:
            database: Database to draw from; the whole lake by default.
            name: Name of the new database.
            n: Exact number of scenarios.
            fraction: Share of scenarios, instead of ``n``.
            seed: Another seed gives another sample.
            weights: SQL expression over ``metadata``, for example ``difficulty`` or ``weight``: probability of being
                drawn first, up to a factor. Scenarios without a weight above 0 are never drawn.
            stratify: Column whose values keep their proportions.
            balance: Column whose values are drawn in equal numbers, while scenarios last.
            levels: Number of levels of ``difficulty``, of equal size, that are drawn in equal numbers and saved from
                easy to difficult: a curriculum.
            replace: Add a version if the database exists.
            allow_empty: Save a database without members, too.

        Raises:
            BadParameter: There are fewer scenarios than ``n``, or arguments exclude each other.
            DatabaseExists, EmptyResult: See :meth:`filter`.
        """
        found = sample(
            self,
            database,
            name=name,
            n=n,
            fraction=fraction,
            seed=seed,
            weights=weights,
            stratify=stratify,
            balance=balance,
            levels=levels,
            replace=replace,
            allow_empty=allow_empty,
        )
        return Database.of(found, self)

    def merge(
        self, *databases: DatabaseRecord | str, name: str, replace: bool = False, allow_empty: bool = False
    ) -> Database:
        """Save the union of two or more databases, one after the other.

        A scenario of several databases keeps position and weight of the first.

        Raises:
            ScenarioNotFound: No snapshot has the members of all databases unchanged.
        """
        found = combine.merge(self, *databases, name=name, replace=replace, allow_empty=allow_empty)
        return Database.of(found, self)

    def intersect(
        self, *databases: DatabaseRecord | str, name: str, replace: bool = False, allow_empty: bool = False
    ) -> Database:
        """Save the scenarios that all databases have, by id, in the order of the first."""
        found = combine.intersect(self, *databases, name=name, replace=replace, allow_empty=allow_empty)
        return Database.of(found, self)

    def subtract(
        self, *databases: DatabaseRecord | str, name: str, replace: bool = False, allow_empty: bool = False
    ) -> Database:
        """Save the scenarios of the first database that no other has, by id, in its order."""
        found = combine.subtract(self, *databases, name=name, replace=replace, allow_empty=allow_empty)
        return Database.of(found, self)

    def copy(
        self, database: DatabaseRecord | str, *, name: str, replace: bool = False, allow_empty: bool = True
    ) -> Database:
        """Save a database under another name; later changes of the original do not affect the copy."""
        return Database.of(combine.copy(self, database, name=name, replace=replace, allow_empty=allow_empty), self)

    def rename(self, database: DatabaseRecord | str, *, name: str) -> Database:
        """Rename a database with all its versions.

        Raises:
            DatabaseInUse: Lineages of other databases refer to it.
            DatabaseExists: The new name is taken.
        """
        return Database.of(combine.rename(self, database, name=name), self)

    def drop(self, database: DatabaseRecord | str, *, force: bool = False) -> None:
        """Remove a database, or one version ``name@version``; the scenarios stay.

        Args:
            database: The database.
            force: Remove it even if other databases depend on it; those stay readable, but cannot be rebuilt.

        Raises:
            DatabaseInUse: Other databases depend on it and ``force`` is False.
        """
        combine.drop(self, database, force=force)

    def checkout(self, database: DatabaseRecord | str) -> Database:
        """Make an old version ``name@version`` the newest again, with its lineage; all versions are kept."""
        return Database.of(combine.checkout(self, database), self)

    def lineage(self, database: DatabaseRecord | str) -> LineageTree:
        """Return a database with its ancestors and how each was made."""
        return lineage_tree(self, database)

    def rebuild(self, database: DatabaseRecord | str) -> RebuildResult:
        """Run the lineage of a database again on its snapshot and parents, and compare; nothing is saved.

        Raises:
            NoSuchSnapshot, DatabaseNotFound, UserColumnNotFound: The snapshot, a parent or a user column is missing.
            LakeError: The database was packed, without the other scenarios that its query ran on.
        """
        return rebuild(self, database)

    def rebase(self, database: DatabaseRecord | str, *, keep_members: bool = False) -> list[Diff]:
        """Run the query of a database again on the newest snapshot, and save the result as a new version.

        Its parents are rebased first.

        Args:
            database: The database.
            keep_members: Keep the members that the newest snapshot still has, instead of running the query.

        Returns:
            Changes of each database, parents first; empty if all were made on the newest snapshot.

        Raises:
            DatabaseNotFound: A parent is missing.
        """
        return rebase(self, database, keep_members=keep_members)

    # --- scenarios ------------------------------------------------------------------------------------

    def loader(self, database: DatabaseRecord | str | Iterable[str] | None = None) -> ScenarioLoader:
        """Return a loader of a database, of scenario ids, or of all scenarios in order of id."""
        from scenarionet_data.loader import ScenarioLoader

        return ScenarioLoader(self, database)

    def pack(
        self,
        database: DatabaseRecord | str,
        path: str | Path,
        *,
        tar: bool = False,
        publishable: bool = False,
        on_progress: Progress | None = None,
    ) -> PackReport:
        """Write a saved database and all data of its members as a small, self-contained lake.

        Every scenario is read back and compared with its content hash, so that no damage is packed.

        Args:
            database: The database.
            path: Folder or tar to write, which must not exist; it appears complete or not at all.
            tar: Write a tar that contains the folder.
            publishable: Refuse scenarios whose licence is not known to allow redistribution.
            on_progress: Called after every 64 scenarios copied, and after each scenario read back.

        Raises:
            BadParameter: ``path`` exists, the database has no members, or one is not ``publishable``.
            ScenarioNotFound: The lake does not have a member.
            LakeError: A file is missing or damaged, or ``path`` cannot be written.
        """
        from scenarionet_data.packs.packing import pack

        return pack(self, database, path, tar=tar, publishable=publishable, on_progress=on_progress)

    def publish(self, path: str | Path, catalog: Catalog) -> PublishReport:
        """Publish this snapshot as the tables metadata, tracks, lights and maps of another catalog.

        The catalog refers to the lake's own Parquet files; ``vacuum`` keeps those of snapshots that a saved database
        was made on. Only the metadata are written again, with user columns, and content hashes as signed integers.

        Args:
            path: Folder to write, which must not exist.
            catalog: ``"iceberg"``: format version 2, listed in an SQLite catalog (extra ``iceberg``); ``"ducklake"``: a
                DuckDB file (needs a DuckDB with its extension ducklake).

        Raises:
            BadParameter: ``path`` exists, or the lake is empty or in an object store.
            MissingDependency: PyIceberg or the extension is not installed.
            LakeError: A file is missing or damaged, or ``path`` cannot be written.
        """
        from scenarionet_data.publishing.publish import publish

        return publish(self, path, catalog)

    def export(
        self,
        database: DatabaseRecord | str | Iterable[str] | None,
        directory: str | Path,
        *,
        replace: bool = False,
        original: bool = True,
        executor: Executor | None = None,
        on_progress: Progress | None = None,
    ) -> ExportReport:
        """Write scenarios as ScenarioNet pickles that MetaDrive reads; see :func:`scenarionet_data.export.export`."""
        from scenarionet_data.export import export_database

        return export_database(
            self, database, directory, replace=replace, original=original, executor=executor, on_progress=on_progress
        )
