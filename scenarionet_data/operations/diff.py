"""Differences between two databases, two versions of one, or two snapshots of the lake."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.databases.row_sets import RowSets
from scenarionet_data.errors import BadParameter, NoSuchSnapshot
from scenarionet_data.operations.database_query import DatabaseQuery
from scenarionet_data.query.engine import Rows
from scenarionet_data.query.lake_view import LakeView
from scenarionet_data.query.members import StaleDatabaseWarning, known_rows, relation
from scenarionet_data.query.statements import quoted
from scenarionet_data.query.views import scan_files
from scenarionet_data.schema import tables
from scenarionet_data.storage.read.metadata_rows import ADDRESS_COLUMNS
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots


@dataclass(frozen=True)
class ColumnChange:
    """A column of ``metadata`` with other values than before.

    Attributes:
        name: The column.
        count: Number of scenarios with another value.
        scenario_id: One of them.
        before, after: Its old and new value.
    """

    name: str
    count: int
    scenario_id: str
    before: Any
    after: Any


@dataclass(frozen=True)
class Diff:
    """Differences of a set of scenarios from an earlier one.

    Attributes:
        before, after: ``name@version``, or ``@snapshot`` for the whole lake.
        counts: Numbers of scenarios of both.
        rows: scenario_id and ``what``: came, went, or changed (other content); sorted by id.
        columns: Columns of ``metadata`` with other values for scenarios of both.
    """

    before: str
    after: str
    counts: tuple[int, int]
    rows: pa.Table
    columns: tuple[ColumnChange, ...] = ()

    def __len__(self) -> int:
        return int(self.rows.num_rows)

    @property
    def is_same(self) -> bool:
        """Whether there are no differences."""
        return not (len(self) or self.columns)

    def ids(self, what: str, limit: int | None = None) -> list[str]:
        """Return ids of scenarios that ``came``, ``went`` or ``changed``, at most ``limit``."""
        found: list[str] = self._of(what)["scenario_id"].slice(0, limit).to_pylist()
        return found

    def count(self, what: str) -> int:
        """Return how many scenarios ``came``, ``went`` or ``changed``."""
        return int(self._of(what).num_rows)

    def _of(self, what: str) -> pa.Table:
        return self.rows.filter(pc.equal(self.rows["what"], what))


@dataclass(frozen=True)
class _Side:
    """One of two sets of scenarios.

    Attributes:
        reference: ``name@version`` or ``@snapshot``.
        count: Number of scenarios.
        select: Returns SQL for them, and tables that it needs.
        snapshot: Snapshot whose metadata describes them.
        rows: Their rows in the snapshot that is queried, if they are rows.
    """

    reference: str
    count: int
    select: Callable[[], tuple[str, dict[str, Rows]]]
    snapshot: int
    rows: RowSets | None = None


def diff(view: LakeView, before: DatabaseRecord | str, after: DatabaseRecord | str) -> Diff:
    """Compare two sets of scenarios; see :meth:`Lake.diff <scenarionet_data.Lake.diff>`."""
    first, second = _side(view, before, "selected_before"), _side(view, after, "selected_after")
    if first.rows is not None and second.rows is not None:
        rows = _different(view, first.rows, second.rows)
    else:
        (one, tables), (other, more) = first.select(), second.select()
        rows = different_rows(view, one, other, {**tables, **more})
    columns = _changed_columns(view, first, second) if first.snapshot != second.snapshot else ()
    return Diff(first.reference, second.reference, (first.count, second.count), rows, columns)


def different_rows(view: LakeView, before: str, after: str, tables: Mapping[str, Rows]) -> pa.Table:
    """Return the rows of a :class:`Diff`.

    Args:
        view: The lake.
        before, after: SQL for the members of both.
        tables: Tables that the SQL needs.
    """
    query = DatabaseQuery(view).query("operations/diff", {"before": before, "after": after})
    return view.engine.arrow(query, tables=tables)


def _different(view: LakeView, before: RowSets, after: RowSets) -> pa.Table:
    """Return the same for members of unchanged files."""
    found = replace(before, sets=(before.union ^ after.union,))
    went = pa.array(before.union[found.ordered(view.files)])
    return pa.table({"scenario_id": found.members(view.files)["scenario_id"], "what": pc.if_else(went, "went", "came")})


def _side(view: LakeView, database: DatabaseRecord | str, table: str) -> _Side:
    if isinstance(database, str) and database.startswith("@"):
        if not database[1:].isdecimal():
            raise BadParameter(f"{database!r}: wanted a snapshot such as @7, or a database")
        snapshot = snapshots.read(view.files, int(database[1:]))
        rows = _metadata_rows(view, snapshot, snapshot.metadata)
        count = view.engine.arrow(f"SELECT count(*) FROM {rows}")[0][0].as_py()
        return _Side(database, count, lambda: (rows, {}), snapshot.number)
    found = view.record(database)
    select = partial(relation, found, view.rows, table)
    return _Side(found.reference, len(found), select, found.lineage.snapshot, known_rows(found, view.rows))


def _changed_columns(view: LakeView, before: _Side, after: _Side) -> tuple[ColumnChange, ...]:
    """Compare the rows of metadata files that only one of the snapshots has: files never change."""
    try:
        found = [snapshots.read(view.files, side.snapshot) for side in (before, after)]
    except NoSuchSnapshot as error:
        warnings.warn(f"columns cannot be compared, only members: {error}", StaleDatabaseWarning, stacklevel=4)
        return ()
    own = [sorted({*a.metadata} - {*b.metadata}) for a, b in (found, found[::-1])]
    if not all(own):
        return ()
    names = [c.name for c in tables.load("metadata").columns if c.name not in ("scenario_id", *ADDRESS_COLUMNS)]
    (one, tables_before), (other, tables_after) = before.select(), after.select()
    fields = {
        "columns": ", ".join(map(_comparison, names)),
        "rows_before": _metadata_rows(view, found[0], own[0]),
        "rows_after": _metadata_rows(view, found[1], own[1]),
        "before": one,
        "after": other,
    }
    query = DatabaseQuery(view).query("operations/changed_columns", fields)
    (row,) = view.engine.arrow(query, tables={**tables_before, **tables_after}).to_pylist()
    return tuple(ColumnChange(name, row[name], **row[f"example_{name}"]) for name in names if row[name])


def _metadata_rows(view: LakeView, snapshot: snapshots.Snapshot, names: Sequence[str]) -> str:
    """Return SQL for the rows of metadata files of a snapshot; of no rows without files."""
    if not names:
        return "(FROM metadata_rows LIMIT 0)"
    paths = ", ".join(map(quoted, view.files.scans(names)))
    is_current = tables.load("metadata").tag in manifests.schema_versions(view.files, snapshot)
    return scan_files("metadata", f"[{paths}]", is_current=is_current)


def _comparison(name: str) -> str:
    differs = f"FILTER (before.{name} IS DISTINCT FROM after.{name})"
    example = f"{{'scenario_id': scenario_id, 'before': before.{name}, 'after': after.{name}}}"
    return f"count(*) {differs} AS {name}, min_by({example}, scenario_id) {differs} AS example_{name}"
