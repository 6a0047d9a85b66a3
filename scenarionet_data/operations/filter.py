"""Filters: scenarios that satisfy conditions, in SQL, by name, or by a list of ids."""

from __future__ import annotations

import re
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

import pyarrow as pa

from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.databases.record import DatabaseRecord, Lineage
from scenarionet_data.databases.row_sets import RowSets
from scenarionet_data.errors import BadParameter, ScenarioNotFound
from scenarionet_data.operations.database_query import AnyDatabase, DatabaseQuery, Pool, as_recorded
from scenarionet_data.query.named_sql import EVENTS, FILTERS, Conditions, NamedSql
from scenarionet_data.query.statements import check_expression, explaining

BoundSql = tuple[NamedSql, dict[str, Any]]
"""A condition and the values of its parameters."""


IN_ORDER = "place"
_DIRECTION = re.compile(r"\s+(asc|desc)\s*$", re.IGNORECASE)


class Filtering(Pool[AnyDatabase]):
    """The verbs ``filter`` and ``select`` of lakes and databases."""

    def select(
        self,
        where: str = "true",
        *,
        database: DatabaseRecord | str | None = None,
        filters: Conditions = (),
        events: Conditions = (),
        ids: Sequence[str] | None = None,
        parameters: Mapping[str, Any] | None = None,
        order_by: str | None = None,
        limit: int | None = None,
    ) -> AnyDatabase:
        """Select the scenarios that satisfy all conditions, without saving them; see :meth:`filter`."""
        query = self._query(database)
        ranking = IN_ORDER if order_by is None and limit is None else ranked(order_by, limit)
        with explaining(where, query.view.user_columns):
            lineage, batches = find_scenarios(query, where, filters, events, ids, parameters, ranking)
            with closing(batches):
                return self._handle(query.selection(lineage, batches))

    def filter(
        self,
        where: str = "true",
        *,
        name: str,
        database: DatabaseRecord | str | None = None,
        filters: Conditions = (),
        events: Conditions = (),
        ids: Sequence[str] | None = None,
        parameters: Mapping[str, Any] | None = None,
        order_by: str | None = None,
        limit: int | None = None,
        replace: bool = False,
        allow_empty: bool = False,
    ) -> AnyDatabase:
        """Save the scenarios that satisfy all conditions as a database.

        Args:
            where: SQL condition over the columns of ``metadata``.
            name: Name of the new database.
            database: Search only the members of this database, in its order; the whole lake by default.
            filters: Filters of ``sql/filters``: ``"ego_distance"``, ``["ego_distance:min=100", ...]`` or
                ``{"ego_distance": {"min": 100}}``.
            events: Events of ``sql/events`` that must occur, in the same forms.
            ids: Ids or source ids that scenarios must have.
            parameters: Values for ``$name`` in ``where``: numbers, texts, truth values, lists of them.
            order_by: SQL expression over ``metadata`` that orders the members, such as ``difficulty DESC``; unknown
                values come last. By default they keep the order of what is searched.
            limit: Keep the first so many only.
            replace: Add a version if the database exists.
            allow_empty: Save a database without members, too.

        Raises:
            UnsafeSql: ``where`` is not a single expression.
            QueryError: DuckDB rejects the condition; the message has the position and similar names.
            UnknownFilter, UnknownEvent, BadParameter: The message lists the valid names.
            ScenarioNotFound: One of ``ids`` does not exist.
            DatabaseExists: The database exists and ``replace`` is False.
            EmptyResult: No scenario satisfies the conditions and ``allow_empty`` is False.
        """
        query = self._query(database)
        ranking = IN_ORDER if order_by is None and limit is None else ranked(order_by, limit)
        with explaining(where, query.view.user_columns):
            lineage, batches = find_scenarios(query, where, filters, events, ids, parameters, ranking)
            return self._handle(query.save(lineage, name, batches, replace=replace, allow_empty=allow_empty))


def find_scenarios(
    query: DatabaseQuery,
    where: str = "true",
    filters: Conditions = (),
    events: Conditions = (),
    ids: Sequence[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    ranking: str = IN_ORDER,
) -> tuple[Lineage, Generator[pa.RecordBatch | RowSets, None, None]]:
    """Return the lineage of a filter, and its rows in order; see :meth:`Filtering.filter`."""
    check_expression(where)
    if not isinstance(parameters or {}, Mapping):
        raise BadParameter(f"parameters: wanted values by name, as {{'min': 10}}, found {parameters!r}")
    named = FILTERS.resolve(filters) if filters else []
    if ids is not None:
        if isinstance(ids, str):
            raise BadParameter(f"ids: wanted a list of ids, found the text {ids!r}; put it into a list")
        named.append((FILTERS.load("ids"), {"ids": list(ids)}))
        _check_ids(query, list(ids))
    happening = []
    for event, values in EVENTS.resolve(events) if events else ():
        occurs = f"scenario_id IN (SELECT scenario_id FROM (\n{event.text}\n))"
        happening.append((replace(event, text=occurs), values))
    conditions, bound = _combined(where, [*named, *happening], parameters or {})
    sql = query.query("operations/filter", {"conditions": conditions, "ranking": ranking})
    lineage = query.lineage("filter", sql, as_recorded(bound))
    if not happening:
        return lineage, query.batches(sql, as_recorded(bound), by_rows=True)
    # Events are searched only in scenarios that satisfy the other conditions, which are evaluated once: a condition
    # that compares with the whole lake would give another result over fewer scenarios.
    conditions, bound = _combined(where, named, parameters or {})
    sql = query.query("operations/filter", {"conditions": conditions, "ranking": IN_ORDER})
    left = query.run(sql, as_recorded(bound))["scenario_id"].to_pylist()
    narrowed = replace(query, view=query.view.restrict_to(left))
    conditions, bound = _combined("true", happening, {})
    sql = narrowed.query("operations/filter", {"conditions": conditions, "ranking": ranking})
    return lineage, narrowed.batches(sql, as_recorded(bound))


def ranked(order_by: str | None, limit: int | None = None) -> str:
    """Return the SQL behind ORDER BY for an expression, which may end with ASC or DESC, and a number of rows."""
    if limit is not None and not is_count(limit, 1):
        raise BadParameter(f"limit={limit!r}; expected a whole number of 1 or more")
    ranking = IN_ORDER
    if order_by is not None:
        direction = _DIRECTION.search(order_by) if isinstance(order_by, str) else None
        expression = order_by[: direction.start()] if direction else order_by
        check_expression(expression)
        ranking = f"({expression}\n) {direction.group(1) if direction else 'ASC'} NULLS LAST, {IN_ORDER}"
    return ranking if limit is None else f"{ranking} LIMIT {limit}"


def _combined(where: str, named: Sequence[BoundSql], parameters: Mapping[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return all conditions as one, and the values of their parameters."""
    conditions, bound = [f"({where}\n)"], dict(parameters)
    for number, (found, values) in enumerate(named):
        condition = found.text
        for key, value in values.items():  # two filters may both have a parameter $min
            condition = re.sub(rf"\${key}\b", f"$f{number}_{key}", condition)
            bound[f"f{number}_{key}"] = value
        conditions.append(f"({condition}\n)")
    return " AND ".join(conditions), bound


def _check_ids(query: DatabaseQuery, ids: list[str]) -> None:
    """Raise if any requested id does not exist, rather than silently returning fewer scenarios."""
    missing = query.run(query.query("operations/unknown_ids"), {"ids": ids})["id"].to_pylist()
    if missing:
        place = query.parents[0].reference if query.parents else f"snapshot {query.view.snapshot.number}"
        raise ScenarioNotFound(
            f"{len(missing):,} of {len(ids):,} ids are not in {place}, for example {missing[0]}; wanted whole ids, as "
            "`SELECT scenario_id, source_scenario_id FROM metadata` lists them: remove the others from the list"
        )
