"""Filters: scenarios that satisfy conditions, in SQL, by name, or by a list of ids."""

from __future__ import annotations

import re
from collections.abc import Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

import pyarrow as pa

from scenarionet_data.databases.record import DatabaseRecord, Lineage
from scenarionet_data.errors import BadParameter, QueryError, ScenarioNotFound
from scenarionet_data.operations.database_query import DatabaseQuery, as_recorded
from scenarionet_data.query import suggestions
from scenarionet_data.query.lake_view import LakeLike, open_view
from scenarionet_data.query.named_sql import EVENTS, FILTERS, Conditions, NamedSql
from scenarionet_data.query.statements import check_expression

BoundSql = tuple[NamedSql, dict[str, Any]]
"""A condition and the values of its parameters."""


def filter_database(
    lake: LakeLike,
    where: str = "true",
    *,
    name: str,
    database: DatabaseRecord | str | None = None,
    filters: Conditions = (),
    events: Conditions = (),
    ids: Sequence[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    replace: bool = False,
    allow_empty: bool = False,
) -> DatabaseRecord:
    """Save the scenarios that satisfy conditions; see :meth:`Lake.filter <scenarionet_data.Lake.filter>`."""
    view = open_view(lake)
    try:
        query = DatabaseQuery.over(view, database)
        lineage, batches = _filtered(query, where, filters, events, ids, parameters or {})
        return query.save(lineage, name, batches, replace=replace, allow_empty=allow_empty)
    except QueryError as error:
        raise suggestions.explain_unknown_column(error, where, view.user_columns) from error


def select_scenarios(
    lake: LakeLike,
    where: str = "true",
    *,
    database: DatabaseRecord | str | None = None,
    filters: Conditions = (),
    events: Conditions = (),
    ids: Sequence[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
) -> DatabaseRecord:
    """Select the scenarios that satisfy conditions; see :meth:`Lake.select <scenarionet_data.Lake.select>`."""
    view = open_view(lake)
    try:
        query = DatabaseQuery.over(view, database)
        lineage, batches = _filtered(query, where, filters, events, ids, parameters or {})
        with closing(batches):
            return query.selection(lineage, batches)
    except QueryError as error:
        raise suggestions.explain_unknown_column(error, where, view.user_columns) from error


def _filtered(
    query: DatabaseQuery,
    where: str,
    filters: Conditions,
    events: Conditions,
    ids: Sequence[str] | None,
    parameters: Mapping[str, Any],
) -> tuple[Lineage, Generator[pa.RecordBatch, None, None]]:
    """Return the lineage of a filter, and its rows in order."""
    check_expression(where)
    named = FILTERS.resolve(filters)
    if ids is not None:
        if isinstance(ids, str):
            raise BadParameter(f"ids: wanted a list of ids, found the text {ids!r}; put it into a list")
        named.append((FILTERS.load("ids"), {"ids": list(ids)}))
        _check_ids(query, list(ids))
    happening = [
        (replace(event, text=f"scenario_id IN (SELECT scenario_id FROM (\n{event.text}\n))"), values)
        for event, values in EVENTS.resolve(events)
    ]
    conditions, bound = _combined(where, [*named, *happening], parameters)
    sql = query.query("operations/filter", {"conditions": conditions})
    lineage = query.lineage("filter", sql, as_recorded(bound))
    if not happening:
        return lineage, query.batches(sql, as_recorded(bound))
    # Events are searched only in scenarios that satisfy the other conditions, which are evaluated once: a condition
    # that compares with the whole lake would give another result over fewer scenarios.
    conditions, bound = _combined(where, named, parameters)
    sql = query.query("operations/filter", {"conditions": conditions})
    left = query.run(sql, as_recorded(bound))["scenario_id"].to_pylist()
    narrowed = replace(query, view=query.view.restrict_to(left))
    conditions, bound = _combined("true", happening, {})
    sql = narrowed.query("operations/filter", {"conditions": conditions})
    return lineage, narrowed.batches(sql, as_recorded(bound))


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
