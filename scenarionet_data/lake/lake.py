"""The handle :class:`Lake`: queries over one snapshot of a lake, and the operations on its databases."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenarionet_data.cards import HasCard
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.databases.user_columns import UserColumn
from scenarionet_data.errors import BadParameter
from scenarionet_data.lake.database import Database
from scenarionet_data.operations.combine import Combining
from scenarionet_data.operations.comparison import DatabaseStatistics, compare
from scenarionet_data.operations.database_query import DatabaseQuery
from scenarionet_data.operations.diff import Diff, diff
from scenarionet_data.operations.events import mine
from scenarionet_data.operations.filter import Filtering
from scenarionet_data.operations.lineage import LineageTree, lineage_tree
from scenarionet_data.operations.mining import Defined, Mined, find_moments, keep_moments, kept_definitions
from scenarionet_data.operations.moments import Moments, RelationSteps, spans_of
from scenarionet_data.operations.overlap import DatabaseOverlap, overlap
from scenarionet_data.operations.rebuild import RebuildResult, rebase, rebuild
from scenarionet_data.operations.sample import Sampling
from scenarionet_data.operations.split import Splitting
from scenarionet_data.operations.tagging import Tagging
from scenarionet_data.scenario.settings import check_is

if TYPE_CHECKING:  # loading, packs and export import numba, which takes 0.5 s that a query does not need
    import polars as pl

    from scenarionet_data.conversion.committer import ConversionReport
    from scenarionet_data.criticality import Assumptions
    from scenarionet_data.execution.executors import Executor
    from scenarionet_data.execution.progress import Progress
    from scenarionet_data.export import ExportReport
    from scenarionet_data.loader import ScenarioLoader
    from scenarionet_data.packs.packing import PackReport
    from scenarionet_data.publishing.publish import Catalog, PublishReport
    from scenarionet_data.scenario.description import ScenarioDescription


class Lake(Filtering[Database], Splitting[Database], Sampling[Database], Combining[Database], Tagging, HasCard):
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
        return self._handle(self.record(database))

    def _query(self, database: DatabaseRecord | str | None = None) -> DatabaseQuery:
        return DatabaseQuery.over(self, database)

    def _handle(self, record: DatabaseRecord) -> Database:
        return Database.of(record, self)

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

    # --- comparisons ----------------------------------------------------------------------------------

    def compare(self, *databases: DatabaseRecord | str) -> list[DatabaseStatistics]:
        """Return statistics of databases in the given order; of the whole lake without any."""
        return compare(self, *databases)

    def diff(self, before: DatabaseRecord | str, after: DatabaseRecord | str) -> Diff:
        """Compare two sets of scenarios: members that came, went or changed, and columns with other values.

        Args:
            before, after: Databases, ``name``, ``name@version``, or ``@7`` for the whole lake at snapshot 7.
        """
        return diff(self, before, after)

    def overlap(
        self, *databases: DatabaseRecord | str, kinds: Sequence[str] | None = None, embedding: str | None = None
    ) -> list[DatabaseOverlap]:
        """Find what two or more databases share, pair by pair: scenarios, contents, logs, seconds of a log, drives.

        Args:
            *databases: The databases; this snapshot describes their members.
            kinds: Rules of ``sql/overlaps``, all by default. Only ``near_duplicate`` reads tracks.
            embedding: Find near-duplicates among the nearest by this user column instead, also those that are moved,
                turned, noisier, a second later, or lack some road users; see :meth:`embed`.

        Returns:
            One result per pair and rule, including empty ones.

        Raises:
            UnknownQuery: No such rule.
            BadParameter: No such embedding, or it has no vector of a member.
        """
        if embedding is None:
            return overlap(self, *databases, kinds=kinds)
        from scenarionet_data.embeddings.duplicates import embedding_overlap

        if kinds is not None:
            raise BadParameter("give kinds, or an embedding, whose near-duplicates are a rule of their own")
        return embedding_overlap(self, databases, embedding)

    # --- embeddings -----------------------------------------------------------------------------------

    def embed(
        self,
        name: str,
        database: DatabaseRecord | str | None = None,
        *,
        model: str = "features",
        replace: bool = False,
        on_progress: Progress | None = None,
    ) -> UserColumn:
        """Add a user column with a vector for each scenario; call :meth:`refresh` to query it.

        Args:
            name: Name of the column.
            database: Embed only its members; others have no vector.
            model: ``"features"``: 64 numbers that are computed by hand, see
                :mod:`scenarionet_data.embeddings.features`; or a run of this lake that trained a forecaster, whose
                encoder says of the ego what its vector is.
            replace: Add a version if the user column exists.
            on_progress: Called after each scenario.

        Returns:
            The user column; its source has the hash of the model.

        Raises:
            BadParameter: No such model, no scenarios, or a vector that is not finite.
            UserColumnExists: The user column exists and ``replace`` is False.
        """
        from scenarionet_data.embeddings.embed import embed, find_model

        return embed(self, name, find_model(self, model), database, replace=replace, on_progress=on_progress)

    def similar(
        self, scenario_id: str, k: int = 10, *, by: str | None = None, database: DatabaseRecord | str | None = None
    ) -> pl.DataFrame:
        """Return the scenarios whose vectors lie nearest to that of another, the nearest first.

        Args:
            scenario_id: The other, which is left out; see :meth:`describe`.
            k: How many.
            by: The embedding, by default the only one of the lake.
            database: Search only its members.

        Returns:
            scenario_id and distance (Euclidean, of vectors).

        Raises:
            BadParameter: No such embedding, or the scenario has no vector.
            ScenarioNotFound: No such scenario.
        """
        import polars

        from scenarionet_data.embeddings.search import similar

        return polars.DataFrame(similar(self, scenario_id, k, by, database))

    def mine(
        self,
        event: str,
        parameters: Mapping[str, Any] | None = None,
        database: DatabaseRecord | str | None = None,
    ) -> pl.DataFrame:
        """Find all occurrences of an event, in order of scenario and time.

        Args:
            event: Name of an event of ``sql/events``.
            parameters: Values of its parameters as Python values; the others keep their defaults.
            database: Search only its members.

        Raises:
            UnknownEvent: No such event.
            BadParameter: No such parameter, or a value of another type.
        """
        return mine(self, event, parameters, database)

    def moments(self, found: RelationSteps | Moments, database: DatabaseRecord | str | None = None) -> pl.DataFrame:
        """Find all moments of a composition of relations and events, in order of scenario and time.

        Args:
            found: The composition, see :mod:`scenarionet_data.operations.moments`; its ``sql`` is what runs.
            database: Search only its members.
        """
        view = self if database is None else self.restrict_to(database)
        return find_moments(view, spans_of(found))

    def keep_moments(
        self,
        name: str,
        definitions: Mapping[str, RelationSteps | Moments] | None = None,
        database: DatabaseRecord | str | None = None,
        on_progress: Progress | None = None,
    ) -> list[Mined]:
        """Mine definitions, and keep their moments in the lake, as rows of the view ``moments``.

        Only scenarios that a definition was not mined over yet are read; a definition that has changed, or of which the
        SQL of a relation has, is mined again by itself, as another version.

        Args:
            name: Name under which the moments are kept.
            definitions: What is mined, by name; by default what was kept under the name before.
            database: Mine only its members.
            on_progress: Called after each batch of scenarios.

        Returns:
            For each definition what was mined and found now.

        Raises:
            BadParameter: A name has other characters than letters, digits, ".", "_" and "-", or no definitions are
                given and none were kept.
        """
        if definitions is None:
            return keep_moments(self, name, kept_definitions(self, name), database, on_progress)
        check_is("definitions", definitions, Mapping, 'moments by name, as {"close": relation("near_objects")}')
        wanted = {key: Defined(spans_of(each)) for key, each in definitions.items()}
        return keep_moments(self, name, wanted, database, on_progress)

    def criticality(
        self,
        measures: Sequence[str] | None = None,
        database: DatabaseRecord | str | Iterable[str] | None = None,
        limits: Assumptions | None = None,
    ) -> pl.DataFrame:
        """Compute how near the ego and each other object are to a collision, at each timestep.

        Args:
            measures: Names of measures, see the guide on criticality; all by default.
            database: Of its members, or of scenario ids.
            limits: Assumptions of the measures.

        Returns:
            One row for each scenario, other object and timestep, see :func:`scenarionet_data.criticality.criticality`.

        Raises:
            BadParameter: No such measure.
        """
        import polars

        from scenarionet_data.criticality import criticality

        frames = [criticality(scenario, measures, limits=limits) for scenario in self.loader(database)]
        return polars.concat(frames) if frames else polars.DataFrame()

    def measure_moments(
        self, moments: pl.DataFrame, measures: Sequence[str], limits: Assumptions | None = None
    ) -> pl.DataFrame:
        """Add to moments the most critical value of each measure while they last.

        Args:
            moments: Rows that :meth:`moments` or :meth:`mine` found, or some of the view ``moments``.
            measures: Names of measures, see the guide on criticality.
            limits: Assumptions of the measures.

        Raises:
            BadParameter: No such measure, or a column of that name is there already.
        """
        from scenarionet_data.criticality import measure_moments

        ids = moments["scenario_id"].unique(maintain_order=True).to_list()
        return measure_moments(self.loader(ids) if ids else (), moments, measures, limits)

    # --- scenarios ------------------------------------------------------------------------------------

    def add(self, scenarios: Iterable[ScenarioDescription], *, check: bool = True) -> ConversionReport:
        """Add scenarios made in Python, in one commit; see :func:`scenarionet_data.add_scenarios`.

        This handle keeps its snapshot: ``Lake(root)`` has the new ones.
        """
        from scenarionet_data.conversion.adding import add_scenarios

        return add_scenarios(self, scenarios, check=check)

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
