"""Databases made again from their lineage: on their own snapshot to verify them, or on the newest to update them."""

from __future__ import annotations

from dataclasses import dataclass, replace

from scenarionet_data.databases import pack_origins
from scenarionet_data.databases import record as records
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter, DatabaseNotFound, LakeError, NoSuchSnapshot, UserColumnNotFound
from scenarionet_data.operations.database_query import DatabaseQuery
from scenarionet_data.operations.diff import Diff, diff, different_rows
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.members import relation


@dataclass(frozen=True)
class RebuildResult:
    """A database compared with the result of running its lineage again.

    Attributes:
        reference: ``name@version``.
        diff: Differences of the result from the database.
        is_same: Whether both have the same members with the same weights in the same order.
    """

    reference: str
    diff: Diff
    is_same: bool


def rebuild(view: LakeView, database: DatabaseRecord | str) -> RebuildResult:
    """Run the lineage of a database again; see :meth:`Lake.rebuild <scenarionet_data.Lake.rebuild>`."""
    found = view.record(database)
    _check_not_packed(view, found)
    lineage = found.lineage
    try:
        original = view.at_snapshot(lineage.snapshot, lineage.user_columns)
        query = DatabaseQuery(original, tuple(view.record(parent) for parent in lineage.parents))
    except (NoSuchSnapshot, DatabaseNotFound, UserColumnNotFound) as error:
        raise type(error)(
            f"{found.reference} cannot be made again as it was: {error}; it can still be read where its scenarios are "
            f'unchanged, and lake.rebase("{found.name}", keep_members=True) updates it',
            cli_remedy=f"scenarionet db rebase --keep-members {view.root} {found.name}",
        ) from error
    again = query.run(lineage.sql, lineage.parameters)
    members, tables = relation(found, view.rows)
    rows = different_rows(view, members, "again", {**tables, "again": again})
    comparison = query.query("operations/is_same", {"members": members})
    (is_same,) = view.engine.arrow(comparison, tables={**tables, "again": again})["is_same"].to_pylist()
    counts = len(found), again.num_rows
    return RebuildResult(found.reference, Diff(found.reference, found.reference, counts, rows), is_same)


def rebase(view: LakeView, database: DatabaseRecord | str, *, keep_members: bool) -> list[Diff]:
    """Move a database to the newest snapshot; see :meth:`Lake.rebase <scenarionet_data.Lake.rebase>`."""
    if isinstance(database, DatabaseRecord) and not database.is_saved:
        raise BadParameter("this selection is not saved: give it a name with selection.save(name)")
    name, _ = records.parse_reference(database)
    newest = view.refresh()
    if keep_members:
        return [_move(newest, newest.record(name), keep_members=True)]
    _check_not_packed(newest, newest.record(name))
    return _rebase(newest, name, ())


def _rebase(view: LakeView, name: str, waiting: tuple[str, ...]) -> list[Diff]:
    """Move parents first; older versions of a database that is being moved remain parents unchanged."""
    database = view.record(name)
    if _is_packed(view, database):
        return []
    parents = [records.parse_reference(parent)[0] for parent in database.lineage.parents]
    waiting = (*waiting, name)
    moved = [diff for parent in parents if parent not in waiting for diff in _rebase(view, parent, waiting)]
    is_behind = database.lineage.snapshot < view.snapshot.number
    return [*moved, _move(view, database)] if is_behind or moved else []


def _check_not_packed(view: LakeView, database: DatabaseRecord) -> None:
    if _is_packed(view, database):
        raise LakeError(
            f"{database.reference} was packed: {view.root} has its members, but not the other scenarios that its query "
            "ran on; make it again in the lake it came from"
        )


def _is_packed(view: LakeView, database: DatabaseRecord) -> bool:
    """Return whether the lake is a pack of this database."""
    origins = pack_origins.read(view.files)
    return origins is not None and origins.packed == database.reference


def _move(view: LakeView, database: DatabaseRecord, *, keep_members: bool = False) -> Diff:
    name, lineage = database.name or "", database.lineage
    if keep_members:
        query = DatabaseQuery(view, (database,))
        lineage = replace(lineage, operation="rebase", sql=query.query("operations/keep"), parameters={})
    else:
        # Of each parent the newest version; of the database itself, the version it was made from.
        names = [(parent, records.parse_reference(parent)[0]) for parent in lineage.parents]
        parents = [view.record(parent if plain == name else plain) for parent, plain in names]
        query = DatabaseQuery(view, tuple(parents))
    by_rows = lineage.operation != "sample"  # whose levels have another order
    saved = query.make(
        lineage.operation, name, lineage.sql, lineage.parameters, replace=True, allow_empty=True, by_rows=by_rows
    )
    return diff(view, database, saved)
