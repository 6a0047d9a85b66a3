"""Differences between two databases, two versions of one, or two snapshots of the lake."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.databases.record import Database
from scenarionet_data.errors import BadParameter, NoSuchSnapshot
from scenarionet_data.operations.database_query import Pool, StaleDatabaseWarning
from scenarionet_data.query.members import ADDRESS_COLUMNS
from scenarionet_data.query.statements import quoted
from scenarionet_data.query.views import with_added_columns
from scenarionet_data.schema import tables
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots

if TYPE_CHECKING:
    from scenarionet_data.lake.lake import Lake


@dataclass(frozen=True)
class ColumnChange:
    """A column of ``metadata`` that says something else about scenarios than before.

    Attributes:
        name: The column.
        count: How many scenarios.
        scenario_id: One of them.
        before, after: What was and is said about that one.
    """

    name: str
    count: int
    scenario_id: str
    before: Any
    after: Any


@dataclass(frozen=True)
class Diff:
    """What is different in the second of two sets of scenarios.

    Attributes:
        before, after: ``name@version``, or ``@snapshot`` for the whole lake.
        counts: Scenarios of each.
        rows: scenario_id and ``what``: came, went or changed (its content); sorted by id.
        columns: Columns of ``metadata`` that changed for scenarios of both.
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
        """Whether nothing is different."""
        return not (len(self) or self.columns)

    def ids(self, what: str, limit: int | None = None) -> list[str]:
        """Scenarios that ``came``, ``went`` or ``changed`` (the first few of them)."""
        found: list[str] = self._of(what)["scenario_id"].slice(0, limit).to_pylist()
        return found

    def count(self, what: str) -> int:
        """How many ``came``, ``went`` or ``changed``."""
        return int(self._of(what).num_rows)

    def _of(self, what: str) -> pa.Table:
        return self.rows.filter(pc.equal(self.rows["what"], what))


@dataclass(frozen=True)
class _Side:
    """One of the two: its name, how many, SQL for them, and the snapshot they are looked up in."""

    reference: str
    count: int
    relation: str
    snapshot: int


def diff(lake: Lake, before: Database | str, after: Database | str) -> Diff:
    """What came, what went, and which columns changed from one set of scenarios to another.

    Args:
        lake: The lake.
        before, after: Databases, ``name``, ``name@version``, or ``@7`` for the whole lake at snapshot 7.
    """
    sides = _side(lake, before), _side(lake, after)
    first, second = sides
    rows = differing(lake, first.relation, second.relation)
    columns = _changed_columns(lake, *sides) if first.snapshot != second.snapshot else ()
    return Diff(first.reference, second.reference, (first.count, second.count), rows, columns)


def differing(lake: Lake, before: str, after: str, **tables: pa.Table) -> pa.Table:
    """Rows of :class:`Diff`.

    Args:
        lake: The lake.
        before, after: SQL for the members of both.
        **tables: Tables that they name.
    """
    query = Pool(lake).query("operations/diff", before=before, after=after)
    return lake.arrow(query, **tables)


def _side(lake: Lake, which: Database | str) -> _Side:
    if isinstance(which, str) and which.startswith("@"):
        if not which[1:].isdecimal():
            raise BadParameter(f"{which!r}: wanted a snapshot such as @7, or a database")
        there = lake.at(int(which[1:]))
        return _Side(which, len(there), _relation(lake, there.snapshot.metadata), there.snapshot.number)
    database = lake.database(which)
    return _Side(database.reference, len(database), database.relation, database.lineage.snapshot)


def _changed_columns(lake: Lake, before: _Side, after: _Side) -> tuple[ColumnChange, ...]:
    """Compares the rows of metadata files that only one of the snapshots has: files never change."""
    try:
        found = [snapshots.read(lake.files, side.snapshot) for side in (before, after)]
    except NoSuchSnapshot as error:
        warnings.warn(f"columns cannot be compared, only members: {error}", StaleDatabaseWarning, stacklevel=3)
        return ()
    for snapshot in found:
        manifests.check_schemas(lake.files, snapshot)
    own = [sorted({*a.metadata} - {*b.metadata}) for a, b in (found, found[::-1])]
    if not all(own):
        return ()
    names = [c.name for c in tables.load("metadata").columns if c.name not in ("scenario_id", *ADDRESS_COLUMNS)]
    query = Pool(lake).query(
        "operations/changed_columns",
        columns=", ".join(map(_comparison, names)),
        rows_before=_relation(lake, own[0]),
        rows_after=_relation(lake, own[1]),
        before=before.relation,
        after=after.relation,
    )
    (row,) = lake.arrow(query).to_pylist()
    return _changes(names, row)


def _relation(lake: Lake, names: Sequence[str]) -> str:
    """SQL for the rows of metadata files, those of a lake without any too."""
    paths = ", ".join(quoted(str(path)) for path in lake.files.paths(names))
    scan = with_added_columns("metadata", f"read_parquet([{paths}], hive_partitioning = false)")
    return scan if names else "(FROM metadata_rows LIMIT 0)"


def _comparison(name: str) -> str:
    differs = f"FILTER (before.{name} IS DISTINCT FROM after.{name})"
    example = f"{{'scenario_id': scenario_id, 'before': before.{name}, 'after': after.{name}}}"
    return f"count(*) {differs} AS {name}, min_by({example}, scenario_id) {differs} AS example_{name}"


def _changes(names: Sequence[str], row: dict[str, Any]) -> tuple[ColumnChange, ...]:
    return tuple(ColumnChange(name, row[name], **row[f"example_{name}"]) for name in names if row[name])
