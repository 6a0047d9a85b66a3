"""Sets of databases: merge, intersect and subtract, and copies, renames and old versions of one database."""

from __future__ import annotations

from scenarionet_data.databases import record as records
from scenarionet_data.databases import writer
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter, DatabaseInUse
from scenarionet_data.operations.database_query import DatabaseQuery, several
from scenarionet_data.query.lake_view import LakeLike, LakeView, open_view


def merge(
    lake: LakeLike, *databases: DatabaseRecord | str, name: str, replace: bool = False, allow_empty: bool = False
) -> DatabaseRecord:
    """Save the union of databases; see :meth:`Lake.merge <scenarionet_data.Lake.merge>`."""
    query = DatabaseQuery.over(lake, *several("merge", databases), num_pinned=len(databases))
    sql = query.query("operations/merge", {"last": str(len(databases) - 1)})
    return query.make("merge", name, sql, {}, replace=replace, allow_empty=allow_empty)


def intersect(
    lake: LakeLike, *databases: DatabaseRecord | str, name: str, replace: bool = False, allow_empty: bool = False
) -> DatabaseRecord:
    """Save the intersection of databases; see :meth:`Lake.intersect <scenarionet_data.Lake.intersect>`."""
    query = DatabaseQuery.over(lake, *several("intersect", databases))
    sql = query.query("operations/intersect", {"last": str(len(databases) - 1)})
    return query.make("intersect", name, sql, {}, replace=replace, allow_empty=allow_empty)


def subtract(
    lake: LakeLike, *databases: DatabaseRecord | str, name: str, replace: bool = False, allow_empty: bool = False
) -> DatabaseRecord:
    """Save the difference of databases; see :meth:`Lake.subtract <scenarionet_data.Lake.subtract>`."""
    query = DatabaseQuery.over(lake, *several("subtract", databases))
    return query.make(
        "subtract", name, query.query("operations/subtract"), {}, replace=replace, allow_empty=allow_empty
    )


def copy(
    lake: LakeLike,
    database: DatabaseRecord | str,
    *,
    name: str,
    replace: bool = False,
    allow_empty: bool = True,
) -> DatabaseRecord:
    """Save a database under another name; see :meth:`Lake.copy <scenarionet_data.Lake.copy>`."""
    query = DatabaseQuery.over(lake, database)
    return query.make("copy", name, query.query("operations/copy"), {}, replace=replace, allow_empty=allow_empty)


def checkout(lake: LakeLike, database: DatabaseRecord | str) -> DatabaseRecord:
    """Make an old version of a database its newest; see :meth:`Lake.checkout <scenarionet_data.Lake.checkout>`."""
    view = open_view(lake)
    reference = database if isinstance(database, str) else database.reference
    name, version = records.parse_reference(reference)
    if version is None:
        raise BadParameter(f"wanted an old version, for example {name}@1; `scenarionet db lineage` lists them")
    old = view.record(reference)
    return writer.save(view.files, name, old.members, old.lineage, replace=True)


def rename(lake: LakeLike, database: DatabaseRecord | str, *, name: str) -> DatabaseRecord:
    """Rename a database with all its versions; see :meth:`Lake.rename <scenarionet_data.Lake.rename>`."""
    view = open_view(lake)
    old = view.record(database)
    if old.name is None:
        raise BadParameter("this selection is not saved: give it a name with selection.save(name)")
    _check_unused(
        view,
        old.name,
        None,
        f'lake.copy("{old.name}", name="{name}") keeps it',
        f"scenarionet db copy {view.root} {old.name} {name}",
    )
    records.rename(view.files, old.name, name)
    return records.read(view.files, name)


def drop(lake: LakeLike, database: DatabaseRecord | str, *, force: bool = False) -> None:
    """Remove a database or a version of it; see :meth:`Lake.drop <scenarionet_data.Lake.drop>`."""
    view = open_view(lake)
    reference = database if isinstance(database, str) else database.reference
    name, version = records.parse_reference(reference)
    records.check_exists(view.files, name, version)  # a damaged one is dropped as well
    if not force:
        _check_unused(view, name, version, "drop those first, or force=True", "--force")
    records.drop(view.files, name, version)


def _check_unused(view: LakeView, name: str, version: int | None, remedy: str, cli_remedy: str) -> None:
    users = records.children(view.files, name, version)
    if users:
        verb = "was" if len(users) == 1 else "were"
        raise DatabaseInUse(f"{', '.join(users[:5])} {verb} made from {name}; {remedy}", cli_remedy=cli_remedy)
