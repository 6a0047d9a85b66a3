"""The handle :class:`Database`: an ordered set of scenarios to iterate, load, query, and derive others from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, overload

from scenarionet_data.cards import HasCard
from scenarionet_data.databases import record as records
from scenarionet_data.databases import writer
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter
from scenarionet_data.operations.database_query import DatabaseQuery, empty_result
from scenarionet_data.operations.filter import Filtering
from scenarionet_data.operations.sample import Sampling
from scenarionet_data.operations.split import Splitting
from scenarionet_data.query.lake_view import LakeView

if TYPE_CHECKING:  # loading and export import numba, which takes 0.5 s that a query does not need
    import polars as pl

    from scenarionet_data.execution.executors import Executor
    from scenarionet_data.execution.progress import Progress
    from scenarionet_data.export import ExportReport
    from scenarionet_data.loader import ScenarioLoader
    from scenarionet_data.scenario.description import ScenarioDescription


@dataclass(frozen=True, repr=False)
class Database(DatabaseRecord, HasCard, Filtering["Database"], Splitting["Database"], Sampling["Database"]):
    """An ordered set of scenarios of a lake: a saved database, or a selection that is not saved.

    A database copies no data. It keeps the snapshot of the lake it was opened from, and pickles to other processes with
    its name and version, or with its members if it is not saved.

    Attributes:
        name: Name; None for an unsaved selection.
        version: From 1, incremented on replacement; None for an unsaved selection.
        lineage: How it was made.
        view: The lake at the snapshot that the database is read from.

    Example:
        far = lake.select("ego_distance > 100")
        len(far), far.scenario_ids[:3], far[0].tracks.position.shape
        train, val = far.save("far").split({"train": 0.9, "val": 0.1}).values()
    """

    view: LakeView = field(repr=False, compare=False, kw_only=True)

    @classmethod
    def of(cls, record: DatabaseRecord, view: LakeView) -> Database:
        """Return the handle of a record."""
        if isinstance(record, cls):
            return record
        return cls(record.name, record.version, record.lineage, record.files, record.selected, view=view)

    def __repr__(self) -> str:
        return f"Database({self.reference!r}, {len(self):,} scenarios, lake={str(self.view.root)!r})"

    # --- members --------------------------------------------------------------------------------------

    def __iter__(self) -> Iterator[str]:
        """Iterate over the ids of the members, in order."""
        return iter(self.scenario_ids)

    def __contains__(self, scenario_id: object) -> bool:
        """Return whether a scenario id is a member."""
        return scenario_id in self._positions

    @overload
    def __getitem__(self, index: int | str) -> ScenarioDescription: ...
    @overload
    def __getitem__(self, index: slice) -> list[ScenarioDescription]: ...
    def __getitem__(self, index: int | str | slice) -> ScenarioDescription | list[ScenarioDescription]:
        """Load the scenario at an index, or of an id; for a slice, a list of scenarios."""
        loaded: ScenarioDescription | list[ScenarioDescription] = self._loader[index]
        return loaded

    @cached_property
    def _loader(self) -> ScenarioLoader:
        return self.loader()

    @cached_property
    def _positions(self) -> frozenset[str]:
        return frozenset(self.scenario_ids)

    def loader(self) -> ScenarioLoader:
        """Return a loader of the scenarios."""
        from scenarionet_data.loader import ScenarioLoader

        return ScenarioLoader(self.view, self)

    def sql(self, query: str, parameters: Mapping[str, Any] | None = None) -> pl.DataFrame:
        """Run one SELECT over views that show the members only; see :meth:`Lake.sql <scenarionet_data.Lake.sql>`."""
        return self.view.restrict_to(self).sql(query, parameters)

    def export(
        self,
        directory: str | Path,
        *,
        replace: bool = False,
        original: bool = True,
        executor: Executor | None = None,
        on_progress: Progress | None = None,
    ) -> ExportReport:
        """Write the scenarios as ScenarioNet pickles; see :meth:`Lake.export <scenarionet_data.Lake.export>`."""
        from scenarionet_data.export import export_database

        return export_database(
            self.view,
            self,
            directory,
            replace=replace,
            original=original,
            executor=executor,
            on_progress=on_progress,
        )

    # --- derived databases ----------------------------------------------------------------------------

    def save(self, name: str, *, replace: bool = False, allow_empty: bool = False) -> Database:
        """Save an unsaved selection.

        Args:
            name: Name of the new database.
            replace: Add a version if the database exists.
            allow_empty: Save a selection without members, too.

        Raises:
            BadParameter: The database is saved already.
            DatabaseExists: The database exists and ``replace`` is False.
            EmptyResult: The selection has no members and ``allow_empty`` is False.
        """
        if self.is_saved:
            raise BadParameter(f'{self.reference} is saved already; lake.copy("{self.name}", name="{name}") copies it')
        records.check_free(self.files, name, replace=replace)
        if not (len(self) or allow_empty):
            raise empty_result(name, len(self.view))
        saved = writer.save(self.files, name, self.rows or self.members, self.lineage, replace=replace)
        return Database.of(saved, self.view)

    def _query(self, database: DatabaseRecord | str | None = None) -> DatabaseQuery:
        if database is not None:
            raise BadParameter(
                f"{self.reference} is the database already: lake.filter(..., database=...) takes another"
            )
        return DatabaseQuery.over(self.view, self)

    def _handle(self, record: DatabaseRecord) -> Database:
        return Database.of(record, self.view)
