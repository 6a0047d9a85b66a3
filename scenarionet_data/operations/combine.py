"""Sets of databases: merge, intersect and subtract, and copies, renames and old versions of one database."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import reduce

from scenarionet_data.databases import record as records
from scenarionet_data.databases import writer
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.databases.row_sets import RowSets
from scenarionet_data.errors import BadParameter, DatabaseInUse
from scenarionet_data.operations.database_query import AnyDatabase, DatabaseQuery, Pool, several
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.scenario.settings import check_is

_ROWS: Mapping[str, Callable[[RowSets, RowSets], RowSets]] = {
    "merge": RowSets.then,
    "intersect": lambda first, other: first.where(other.union),
    "subtract": lambda first, other: first.where(~other.union),
}
"""What ``sql/operations`` does, by rows; a copy is that of one database."""


class Combining(LakeView, Pool[AnyDatabase]):
    """A view of a lake with set operations on databases; a base class of :class:`~scenarionet_data.Lake`."""

    def merge(
        self, *databases: DatabaseRecord | str, name: str, replace: bool = False, allow_empty: bool = False
    ) -> AnyDatabase:
        """Save the union of two or more databases, one after the other.

        A scenario of several databases keeps position and weight of the first.

        Raises:
            ScenarioNotFound: No snapshot has the members of all databases unchanged.
        """
        return self._combine("merge", several("merge", databases), name, replace, allow_empty)

    def intersect(
        self, *databases: DatabaseRecord | str, name: str, replace: bool = False, allow_empty: bool = False
    ) -> AnyDatabase:
        """Save the scenarios that all databases have, by id, in the order of the first."""
        return self._combine("intersect", several("intersect", databases), name, replace, allow_empty)

    def subtract(
        self, *databases: DatabaseRecord | str, name: str, replace: bool = False, allow_empty: bool = False
    ) -> AnyDatabase:
        """Save the scenarios of the first database that no other has, by id, in its order."""
        return self._combine("subtract", several("subtract", databases), name, replace, allow_empty)

    def copy(
        self, database: DatabaseRecord | str, *, name: str, replace: bool = False, allow_empty: bool = True
    ) -> AnyDatabase:
        """Save a database under another name; later changes of the original do not affect the copy."""
        return self._combine("copy", (database,), name, replace, allow_empty)

    def rename(self, database: DatabaseRecord | str, *, name: str) -> AnyDatabase:
        """Rename a database with all its versions.

        Raises:
            DatabaseInUse: Lineages of other databases refer to it.
            DatabaseExists: The new name is taken.
        """
        old = self.record(database)
        if old.name is None:
            raise BadParameter("this selection is not saved: give it a name with selection.save(name)")
        _check_unused(
            self,
            old.name,
            None,
            f'lake.copy("{old.name}", name="{name}") keeps it',
            f"scenarionet db copy {self.root} {old.name} {name}",
        )
        records.rename(self.files, old.name, name)
        return self._handle(records.read(self.files, name))

    def drop(self, database: DatabaseRecord | str, *, force: bool = False) -> None:
        """Remove a database, or one version ``name@version``; the scenarios stay.

        Args:
            database: The database.
            force: Remove it even if other databases depend on it; those stay readable, but cannot be rebuilt.

        Raises:
            DatabaseInUse: Other databases depend on it and ``force`` is False.
        """
        check_is("force", force, bool, "True or False")
        name, version = records.parse_reference(database)
        records.check_exists(self.files, name, version)  # a damaged one is dropped as well
        if not force:
            _check_unused(self, name, version, "drop those first, or force=True", "--force")
        records.drop(self.files, name, version)

    def checkout(self, database: DatabaseRecord | str) -> AnyDatabase:
        """Make an old version ``name@version`` the newest again, with its lineage; all versions are kept."""
        name, version = records.parse_reference(database)
        if version is None:
            raise BadParameter(f"wanted an old version, for example {name}@1; `scenarionet db lineage` lists them")
        old = self.record(f"{name}@{version}")
        return self._handle(writer.save(self.files, name, old.rows or old.members, old.lineage, replace=True))

    def _combine(
        self, operation: str, databases: tuple[DatabaseRecord | str, ...], name: str, replace: bool, allow_empty: bool
    ) -> AnyDatabase:
        # Members of all databases are merged; of the others, the first has the members of the result.
        query = DatabaseQuery.over(self, *databases, num_pinned=len(databases) if operation == "merge" else 1)
        sql = query.query(f"operations/{operation}", {"last": str(len(databases) - 1)})
        if not query.rows:
            return self._handle(query.make(operation, name, sql, {}, replace=replace, allow_empty=allow_empty))
        found = [reduce(_ROWS.get(operation, RowSets.then), query.rows)]
        lineage = query.lineage(operation, sql, {})
        return self._handle(query.save(lineage, name, found, replace=replace, allow_empty=allow_empty))


def _check_unused(view: LakeView, name: str, version: int | None, remedy: str, cli_remedy: str) -> None:
    users = records.children(view.files, name, version)
    if users:
        verb = "was" if len(users) == 1 else "were"
        raise DatabaseInUse(f"{', '.join(users[:5])} {verb} made from {name}; {remedy}", cli_remedy=cli_remedy)
