"""Queries that make databases: over the members of their parents and the views of a snapshot."""

from __future__ import annotations

import json
import re
from abc import ABC, abstractmethod
from collections.abc import Generator, Iterable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any, Generic, Self, TypeVar

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data import version
from scenarionet_data.arrays.dtypes import UInt8, is_count
from scenarionet_data.databases import record as records
from scenarionet_data.databases import writer
from scenarionet_data.databases.record import DatabaseRecord, Lineage
from scenarionet_data.databases.row_sets import RowSets
from scenarionet_data.errors import BadParameter, EmptyResult
from scenarionet_data.query.engine import Rows
from scenarionet_data.query.lake_view import LakeLike, LakeView
from scenarionet_data.query.members import known_rows, relation
from scenarionet_data.query.statements import words
from scenarionet_data.schema import tables
from scenarionet_data.schema.package_data import SQL
from scenarionet_data.storage.snapshots import snapshot as snapshots

_WHOLE_LAKE = "(SELECT *, 1.0::DOUBLE AS weight, scenario_id AS place FROM metadata)"
_MEMBERS = (
    "(SELECT * FROM metadata JOIN (SELECT scenario_id, weight, position AS place FROM members) USING (scenario_id))"
)
_WHOLE_LAKE_KEYS = "(SELECT scenario_id, 1.0::DOUBLE AS weight, content_hash, scenario_id AS place FROM metadata)"
_MEMBER_KEYS = "(SELECT scenario_id, weight, content_hash, position AS place FROM members)"

_CHOSEN, _IN_ORDER = "SELECT scenario_id, weight, content_hash", "\nORDER BY place"
"""What queries of members in the order of the pool begin and end with."""
_NUMBERED = "(SELECT metadata.* EXCLUDE (lake_row), 1.0::DOUBLE AS weight, {} AS place FROM metadata {})"
"""The pool of members that are rows: no id is read to find them."""

_UNIFORM = "('0x' || substr(md5(concat($seed, ':', {name})), 1, 13))::BIGINT / 4503599627370496.0"
"""A number in [0, 1) from a name and the seed: the same on every machine and every version of DuckDB."""

AnyDatabase = TypeVar("AnyDatabase", bound=DatabaseRecord)
"""The handle of a database: :class:`scenarionet_data.Database`."""


@dataclass(frozen=True)
class DatabaseQuery:
    """The scenarios that an operation chooses from.

    Attributes:
        view: The lake at the snapshot that is queried.
        parents: Databases whose members they are; empty for the whole lake.
    """

    view: LakeView
    parents: tuple[DatabaseRecord, ...] = ()

    @classmethod
    def over(cls, lake: LakeLike, *databases: DatabaseRecord | str | None, num_pinned: int = 1) -> Self:
        """Query some databases, at a snapshot that has the members of the first ``num_pinned`` unchanged.

        That is the snapshot of the lake if possible, else the newest that one of the databases was made on. An unsaved
        selection is queried at its own snapshot, because its lineage becomes part of the new one.

        Raises:
            ScenarioNotFound: No such snapshot has them all.
        """
        view = lake if isinstance(lake, LakeView) else LakeView(lake)
        if databases == (None,):
            return cls(view)
        found = tuple([view.record(database) for database in databases if database is not None])
        unsaved = [database for database in found if not database.is_saved]
        if not unsaved:
            return cls(view.with_members(found[:num_pinned]), found)
        if len(found) > 1:
            raise BadParameter("one of the databases is an unsaved selection: save it first, with selection.save(name)")
        lineage = unsaved[0].lineage
        return cls(view.at_snapshot(lineage.snapshot, lineage.user_columns), found)

    def __len__(self) -> int:
        """Return the number of scenarios of the first parent, or of the whole lake."""
        return len(self.parents[0]) if self.parents else len(self.view)

    @property
    def keys(self) -> str:
        """SQL for the columns that a database stores, and ``place``: no other column of metadata is read."""
        return _MEMBER_KEYS if self.parents else _WHOLE_LAKE_KEYS

    def query(self, file: str, /, fields: Mapping[str, str] | None = None) -> str:
        """Return the SQL of a file below ``sql/``, with ``{pool}`` and other ``{fields}`` replaced."""
        pool, text = _MEMBERS if self.parents else _WHOLE_LAKE, _text(file)
        for name, value in ({"pool": pool} | dict(fields or {})).items():
            text = text.replace(f"{{{name}}}", value)
        return text

    def run(self, query: str, parameters: Mapping[str, Any], tables: Mapping[str, Rows] | None = None) -> pa.Table:
        """Return the rows of a query over the views of the snapshot and ``members``."""
        sql, selected = self._with_members(query) if self.parents else (query, {})
        all_tables = {**selected, **(tables or {})}
        return self.view.engine.arrow(sql, parameters, user_columns=self.user_columns(query), tables=all_tables)

    def batches(
        self, query: str, parameters: Mapping[str, Any], *, by_rows: bool = False
    ) -> Generator[Any, None, None]:
        """Yield the rows of a query like :meth:`run`, in batches.

        Args:
            query: The query.
            parameters: Its parameters.
            by_rows: Yield its members at once, by their rows in metadata files, if :meth:`parts` finds them.
        """
        found = self.parts(query, parameters) if by_rows and self.view.rows is not None else None
        if found is not None:
            yield self.rows[0].where(found > 0)
            return
        sql, selected = self._with_members(query) if self.parents else (query, {})
        yield from self.view.engine.batches(sql, parameters, user_columns=self.user_columns(query), tables=selected)

    @cached_property
    def rows(self) -> tuple[RowSets, ...]:
        """Members of each parent, or of the whole lake, by their rows in this snapshot; empty if they have none."""
        whole = self.view.rows
        if whole is None or not self.parents:
            return () if whole is None else (whole,)
        own = [known_rows(parent, whole) for parent in self.parents]
        known = tuple(rows for rows in own if rows is not None)
        return known if len(known) == len(own) else ()

    def parts(self, query: str, parameters: Mapping[str, Any], names: Sequence[str] = ()) -> UInt8 | None:
        """Find the rows that a query selects, without reading ids.

        Args:
            query: Query of members, with ``part``, a name or its number from 1, if it is given ``names``.
            parameters: Its parameters.
            names: Of the parts.

        Returns:
            (rows,) for each row of the snapshot, 0, or the number of its part (1 without names); None if the
            members have no rows, or the query another order than the pool.
        """
        if not (self.rows and query.startswith(_CHOSEN) and query.endswith(_IN_ORDER)):
            return None
        rows, tables = self.rows[0], dict[str, Rows]()
        if not rows.union.all():
            tables["member_rows"] = rows.places()
        numbered = f"SELECT place{query[len(_CHOSEN) : -len(_IN_ORDER)]}"
        for pool in (_MEMBERS, _MEMBER_KEYS) if self.parents else (_WHOLE_LAKE, _WHOLE_LAKE_KEYS):
            joined = "SEMI JOIN member_rows USING (lake_row)" if tables else ""
            numbered = numbered.replace(pool, _NUMBERED.format("lake_row", joined))
        found = np.zeros(len(rows.union), np.uint8)
        with closing(
            self.view.engine.batches(numbered, parameters, user_columns=self.user_columns(query), tables=tables)
        ) as batches:
            for batch in batches:
                part = batch["part"] if names else pa.array([1])
                if pa.types.is_string(part.type):
                    part = pc.add(pc.index_in(part, value_set=pa.array(names)), 1)
                found[rows.rows(batch["place"])] = part.to_numpy()
        return found

    def user_columns(self, query: str) -> list[str]:
        """Return the user columns that the query names, sorted; unused ones are not joined."""
        if not self.view.user_columns:
            return []
        found = words(query)
        # COLUMNS('score_.*') may select any of them.
        return sorted(self.view.user_columns if "columns" in found else found & set(self.view.user_columns))

    def _with_members(self, query: str) -> tuple[str, dict[str, Rows]]:
        """Return a query that defines ``members``, and tables it needs, for queries over databases.

        ``members`` has the rows of all parents, each with ``parent``, the index of its database. It is read again for
        each use instead of kept in memory.
        """
        tables: dict[str, Rows] = {}
        sources = []
        for number, parent in enumerate(self.parents):
            source, selected = relation(parent, self.view.rows, f"selected_{number}")
            sources.append(f"SELECT {number} AS parent, * FROM {source}")
            tables |= selected
        members = " UNION ALL ".join(sources)
        if len(self.rows) == 1:
            query = query.replace(_MEMBERS, _NUMBERED.format("position", "JOIN selected_0 USING (lake_row)"))
        return f"WITH members AS NOT MATERIALIZED ({members}) SELECT * FROM (\n{query}\n)", tables

    def selection(self, lineage: Lineage, batches: Iterable[pa.RecordBatch | RowSets]) -> DatabaseRecord:
        """Return members that a query selects as an unsaved selection."""
        schema = tables.load("members").schema
        rows = list(batches)
        if rows and isinstance(rows[0], RowSets):
            return DatabaseRecord(None, None, replace(lineage, count=len(rows[0])), self.view.files, rows[0])
        found = pa.Table.from_batches(rows) if rows else schema.empty_table().drop_columns(["position"])
        positions = pa.array(range(found.num_rows), pa.int32())
        members = found.append_column("position", positions).select(schema.names).cast(schema)
        return DatabaseRecord(None, None, replace(lineage, count=len(members)), self.view.files, members)

    def make(
        self,
        operation: str,
        name: str,
        query: str,
        parameters: Mapping[str, Any],
        *,
        replace: bool,
        allow_empty: bool,
        by_rows: bool = False,
    ) -> DatabaseRecord:
        """Run a query that selects scenario_id, weight and content_hash, and save its rows as a database."""
        parameters = as_recorded(parameters)
        members = self.batches(query, parameters, by_rows=by_rows)
        lineage = self.lineage(operation, query, parameters)
        return self.save(lineage, name, members, replace=replace, allow_empty=allow_empty)

    def save(
        self,
        lineage: Lineage,
        name: str,
        members: Iterable[pa.RecordBatch | RowSets],
        *,
        replace: bool,
        allow_empty: bool,
        min_count: int = 0,
    ) -> DatabaseRecord:
        """Save members that a query selects.

        Args:
            lineage: Lineage with the query, see :meth:`lineage`.
            name: Name of the database.
            members: Batches of scenario_id, weight and content_hash in order, or all as rows; a generator is closed
                at the end.
            replace: Add a version if the database exists.
            allow_empty: Save a database without members, too.
            min_count: Minimum number of members.

        Raises:
            EmptyResult: No members, and ``allow_empty`` is False.
            BadParameter: Fewer members than ``min_count``.
            DatabaseExists: The database exists, and ``replace`` is False.
        """
        if not isinstance(replace, bool | np.bool_):
            raise BadParameter(f"replace={replace!r}; expected True or False")
        records.check_free(self.view.files, name, replace=replace)
        with ExitStack() as stack:
            if isinstance(members, Generator):
                stack.enter_context(closing(members))
            database = stack.enter_context(writer.database_writers(self.view.files, [name]))[name]
            for rows in members:
                database.add(rows)
            if database.count < min_count:
                raise BadParameter(
                    f"wanted {min_count:,} scenarios of {len(self):,}, but only {database.count:,} can be drawn"
                )
            if not (database.count or allow_empty):
                raise empty_result(name, len(self))
            database.finish(lineage)
            return database.publish(name, replace=replace)

    def lineage(self, operation: str, query: str, parameters: Mapping[str, Any]) -> Lineage:
        """Return the lineage of a database made by this query; the writer fills in the number of members.

        The lineage of an unsaved parent becomes part of the query, so that it depends on saved databases only.
        """
        user_columns, parents = set[str](), list[str]()
        for name in self.user_columns(query):
            user_columns.add(f"{name}@{self.view.user_columns[name]}")
        for parent in self.parents:
            parents.append(parent.reference)
        if self.parents and not self.parents[0].is_saved:
            inner = self.parents[0].lineage
            selected, parameters = _renamed(inner, parameters)
            query = (
                f"WITH members AS (SELECT 0 AS parent, row_number() OVER () - 1 AS position, * FROM (\n{selected}\n))\n"
                f"SELECT * FROM (\n{query}\n)"
            )
            parents, user_columns = inner.parents, user_columns | {*inner.user_columns}
        return Lineage(
            operation=operation,
            sql=query,
            parameters=dict(parameters),
            parents=parents,
            snapshot=self.view.snapshot.number,
            created_at=snapshots.now(),
            count=0,
            created_with=version.NAME_AND_VERSION,
            user_columns=sorted(user_columns),
        )


class Pool(ABC, Generic[AnyDatabase]):
    """Scenarios that databases are made of: those of a lake, or the members of a database."""

    @abstractmethod
    def _query(self, database: DatabaseRecord | str | None = None) -> DatabaseQuery:
        """Return the query over all of them, or over the members of a database."""

    @abstractmethod
    def _handle(self, record: DatabaseRecord) -> AnyDatabase:
        """Return the handle of a database that was made."""


@cache
def _text(file: str) -> str:
    lines = (SQL / f"{file}.sql").read_text("utf-8").splitlines()
    return "\n".join(line for line in lines if not line.startswith("--"))


def _renamed(inner: Lineage, outer: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return the query of a lineage and all parameters, after renaming those that an outer query has, too."""
    query, merged = inner.sql, dict(outer)
    for name, value in inner.parameters.items():
        new_name = name
        while new_name in merged or (new_name != name and new_name in inner.parameters):
            new_name = f"parent_{new_name}"
        if new_name != name:
            query = re.sub(rf"\${name}\b", f"${new_name}", query)
        merged[new_name] = value
    return query, merged


def empty_result(name: str, total: int) -> EmptyResult:
    """Return the error for a database that would have no members of ``total`` scenarios."""
    return EmptyResult(
        f"{name}: no scenario is left of {total:,}; loosen the conditions, or allow_empty=True",
        cli_remedy="--allow-empty",
    )


def uniform(name: str) -> str:
    """Return SQL for a number in [0, 1) from a name and ``$seed``, the same on all machines.

    Args:
        name: SQL for the name.
    """
    return _UNIFORM.format(name=name)


def as_recorded(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return parameters as the lineage stores them, so that queries run with the values that can be run again.

    Raises:
        BadParameter: JSON cannot represent a value.
    """
    try:
        recorded: dict[str, Any] = json.loads(json.dumps(dict(parameters)))
    except TypeError as error:
        raise BadParameter(
            f"{error}: a parameter is a number, a text, a truth value or a list of them; "
            "pass a date as text and compare with $name::DATE"
        ) from error
    return recorded


def check_whole(what: str, value: object, least: int | None = None) -> None:
    """Raise for anything but None and whole numbers from ``least`` on.

    Raises:
        BadParameter: It is something else.
    """
    if value is not None and not is_count(value, least):
        at_least = "" if least is None else f" of {least} or more"
        raise BadParameter(f"{what}: wanted a whole number{at_least}, found {value!r}")


def check_column(view: LakeView, column: str, purpose: str) -> None:
    """Raise if ``metadata`` does not have a column.

    Raises:
        BadParameter: The message lists the columns.
    """
    columns = view.engine.arrow("SELECT * FROM metadata LIMIT 0").column_names
    if column not in columns:
        raise BadParameter(f"no column {column!r} {purpose}; there are {', '.join(columns)}")


def several(operation: str, databases: tuple[DatabaseRecord | str, ...]) -> tuple[DatabaseRecord | str, ...]:
    """Return at least two databases.

    Raises:
        BadParameter: Fewer than two, or a list in place of several arguments.
    """
    wrong = [each for each in databases if not isinstance(each, DatabaseRecord | str)]
    if wrong:
        raise BadParameter(f'{operation}: give databases one by one, as {operation}("a", "b"), not {wrong[0]!r}')
    if len(databases) < 2:
        raise BadParameter(f"{operation}: wanted two databases or more, found {len(databases)}")
    return databases
