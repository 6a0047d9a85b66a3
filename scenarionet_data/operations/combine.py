"""Sets of databases: merge, intersect, subtract, and one database under another name or from an old version."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Unpack

from scenarionet_data.databases import record as databases
from scenarionet_data.databases import writer
from scenarionet_data.databases.record import Database
from scenarionet_data.errors import BadParameter, DatabaseInUse
from scenarionet_data.operations import database_query as pools
from scenarionet_data.operations.database_query import Saving

if TYPE_CHECKING:
    from scenarionet_data.lake.lake import Lake

Databases = Sequence[Database | str]


def merge(lake: Lake, parents: Databases, *, name: str, **saving: Unpack[Saving]) -> Database:
    """Save who is in any of several databases: one after the other, nobody twice.

    Args:
        lake: The lake.
        parents: Two databases or more; who is in several keeps place and weight of the first.
        name: Name of the new database.
        **saving: ``replace``, ``allow_empty``.

    Raises:
        ScenarioNotFound: No snapshot holds the members of all as they were.
    """
    return _combine(lake, "merge", parents, len(parents), name, saving)


def intersect(lake: Lake, parents: Databases, *, name: str, **saving: Unpack[Saving]) -> Database:
    """Save who is in all of several databases, by id, in the order of the first. See :func:`merge`."""
    return _combine(lake, "intersect", parents, 1, name, saving)


def subtract(lake: Lake, parents: Databases, *, name: str, **saving: Unpack[Saving]) -> Database:
    """Save who is in the first of several databases and in no other, by id, in its order. See :func:`merge`."""
    return _combine(lake, "subtract", parents, 1, name, saving)


def copy(lake: Lake, database: Database | str, name: str, **saving: Unpack[Saving]) -> Database:
    """Save a database under another name: the copy stays as it is, whatever becomes of the first."""
    pool = pools.of(lake, database)
    saving = {"allow_empty": True, **saving}
    return pool.make("copy", name, pool.query("operations/copy"), {}, saving)


def checkout(lake: Lake, reference: str) -> Database:
    """Make an old version of a database its newest again, with the lineage it had; nothing is lost.

    Args:
        lake: The lake.
        reference: ``name@version``.

    Raises:
        BadParameter: No version is named.
    """
    name, version = databases.parse_reference(reference)
    if version is None:
        raise BadParameter(f"wanted an old version, for example {name}@1; `scenarionet lineage` lists them")
    old = lake.database(reference)
    return writer.save(lake.files, name, old.members, old.lineage, replace=True)


def rename(lake: Lake, name: str, new_name: str) -> None:
    """Give a database, with all its versions, another name.

    Raises:
        DatabaseInUse: Others were made from it, and name it in their lineage.
        DatabaseExists: The new name is taken.
    """
    lake.database(name)
    _check_unused(lake, name, None, f"`scenarionet copy {lake.root} {name} {new_name}` leaves it in place")
    databases.rename(lake.files, name, new_name)


def drop(lake: Lake, reference: str, *, force: bool = False) -> None:
    """Remove a database, or one version ``name@version``; the scenarios stay.

    Args:
        lake: The lake.
        reference: What to remove.
        force: Even when other databases were made from it; those can be read as before, but not rebuilt.

    Raises:
        DatabaseInUse: Others were made from it, and ``force`` is False.
    """
    name, version = databases.parse_reference(reference)
    lake.database(reference)
    if not force:
        _check_unused(lake, name, version, "drop them first, or --force")
    databases.drop(lake.files, name, version)


def _combine(lake: Lake, operation: str, parents: Databases, held: int, name: str, saving: Saving) -> Database:
    if len(parents) < 2:
        raise BadParameter(f"{operation}: wanted two databases or more, found {len(parents)}")
    pool = pools.of(lake, *parents, held=held)
    return pool.make(operation, name, pool.query(f"operations/{operation}", last=str(len(parents) - 1)), {}, saving)


def _check_unused(lake: Lake, name: str, version: int | None, remedy: str) -> None:
    users = databases.children(lake.files, name, version)
    if users:
        raise DatabaseInUse(f"{', '.join(users[:5])} {'was' if len(users) == 1 else 'were'} made from {name}; {remedy}")
