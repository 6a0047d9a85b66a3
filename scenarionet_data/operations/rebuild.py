"""A database made again from its lineage: on its own snapshot to prove it, or on the newest to move on."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from scenarionet_data.databases import record as databases
from scenarionet_data.databases.record import Database
from scenarionet_data.errors import DatabaseNotFound, LakeError, LayerNotFound, NoSuchSnapshot
from scenarionet_data.operations import diff as comparing
from scenarionet_data.operations.database_query import Pool, Saving
from scenarionet_data.operations.diff import Diff
from scenarionet_data.packs import origins

if TYPE_CHECKING:
    from scenarionet_data.lake.lake import Lake


@dataclass(frozen=True)
class Rebuilt:
    """A database beside what its lineage makes today.

    Attributes:
        reference: ``name@version``.
        diff: From the database to what was made again.
        is_same: Whether both have the same members with the same weights in the same order.
    """

    reference: str
    diff: Diff
    is_same: bool


def rebuild(lake: Lake, reference: str) -> Rebuilt:
    """Run a database's lineage again, on its own snapshot and parents, and compare; nothing is saved.

    Args:
        lake: The lake.
        reference: ``name`` or ``name@version``.

    Raises:
        NoSuchSnapshot: The snapshot is gone.
        DatabaseNotFound: A parent is gone.
        LayerNotFound: A layer that the query asks is gone.
        LakeError: The database was packed: what its query was asked of stayed behind.
    """
    database = lake.database(reference)
    _check_askable(lake, database)
    lineage = database.lineage
    try:
        there = lake.at(lineage.snapshot, lineage.layers)
        pool = Pool(there, tuple(lake.database(parent) for parent in lineage.parents))
    except (NoSuchSnapshot, DatabaseNotFound, LayerNotFound) as error:
        raise type(error)(
            f"{database.reference} cannot be made again as it was: {error}; it can still be read where its scenarios "
            f"are unchanged, and `scenarionet rebase --keep-members {lake.root} {database.name}` moves it on"
        ) from error
    again = pool.run(lineage.sql, lineage.parameters)
    rows = comparing.differing(lake, database.relation, "again", again=again)
    query = Pool(lake, (database,)).query("operations/is_same", members=database.relation)
    (same,) = lake.arrow(query, again=again)["is_same"].to_pylist()
    return Rebuilt(
        database.reference, Diff(database.reference, database.reference, (len(database), again.num_rows), rows), same
    )


def rebase(lake: Lake, name: str, *, keep_members: bool = False) -> list[Diff]:
    """Move a database to the newest snapshot, as a new version: the question it answers is asked again.

    The databases it was made from are moved first, and their newest versions are asked.

    Args:
        lake: The lake.
        name: The database.
        keep_members: Ask nothing again: keep who is still there, as the newest snapshot has them.

    Returns:
        What changed, for each database that moved, parents first; none when all stood on the newest snapshot.

    Raises:
        DatabaseNotFound: A parent is gone.
    """
    newest = lake.refresh()
    plain, _ = databases.parse_reference(name)
    if keep_members:
        return [_move(newest, lake.database(plain), keep_members=True)]
    _check_askable(newest, newest.database(plain))
    return _rebase(newest, plain, ())


def _rebase(lake: Lake, name: str, waiting: tuple[str, ...]) -> list[Diff]:
    """Parents first; a version of a database that waits for this very move is a parent as it is."""
    database = lake.database(name)
    if _was_packed(lake, database):
        return []
    parents = [databases.parse_reference(parent)[0] for parent in database.lineage.parents]
    moved = [d for parent in parents if parent not in (*waiting, name) for d in _rebase(lake, parent, (*waiting, name))]
    is_behind = database.lineage.snapshot < lake.snapshot.number
    return [*moved, _move(lake, database)] if is_behind or moved else []


def _check_askable(lake: Lake, database: Database) -> None:
    if _was_packed(lake, database):
        raise LakeError(
            f"{database.reference} was packed: {lake.root} holds its members, and nothing else that its query was "
            "asked of; make it again in the lake it came from"
        )


def _was_packed(lake: Lake, database: Database) -> bool:
    """Whether the lake is a pack of this very database."""
    packed = origins.read(lake.files)
    return packed is not None and packed.packed == database.reference


def _move(lake: Lake, database: Database, *, keep_members: bool = False) -> Diff:
    lineage = database.lineage
    if keep_members:
        pool = Pool(lake, (database,))
        lineage = replace(lineage, operation="rebase", sql=pool.query("operations/keep"), parameters={})
    else:
        parents = [_newest(parent, database.name) for parent in lineage.parents]
        pool = Pool(lake, tuple(lake.database(parent) for parent in parents))
    saving: Saving = {"replace": True, "allow_empty": True}
    saved = pool.make(lineage.operation, database.name, lineage.sql, lineage.parameters, saving)
    return comparing.diff(lake, database.reference, saved)


def _newest(parent: str, child: str) -> str:
    """The parent's newest version; of the child itself, the version it was made from."""
    name, _ = databases.parse_reference(parent)
    return parent if name == child else name
