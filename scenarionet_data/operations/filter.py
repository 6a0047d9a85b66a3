"""Filters: the scenarios that satisfy conditions, in SQL, by name, or by a list of ids."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Unpack

from scenarionet_data.databases.record import Database
from scenarionet_data.errors import QueryError, ScenarioNotFound
from scenarionet_data.operations import database_query as pools
from scenarionet_data.operations.database_query import Pool, Saving
from scenarionet_data.query import suggestions
from scenarionet_data.query.named_sql import EVENTS, FILTERS, NamedSql
from scenarionet_data.query.statements import check_expression

if TYPE_CHECKING:
    from scenarionet_data.lake.lake import Lake


def keep(
    lake: Lake,
    where: str = "true",
    *,
    name: str,
    parent: Database | str | None = None,
    named: Sequence[str] = (),
    happening: Sequence[str] = (),
    ids: Sequence[str] | None = None,
    parameters: Mapping[str, Any] | None = None,
    **saving: Unpack[Saving],
) -> Database:
    """Save the scenarios that satisfy a condition as a database.

    Args:
        lake: The lake.
        where: SQL expression over the columns of ``metadata``.
        name: Name of the new database.
        parent: Search only the members of this database, in its order.
        named: Filters of ``sql/filters`` that must hold too, as ``name:key=value``.
        happening: Events of ``sql/events`` that must happen too, as ``name:key=value``.
        ids: Keep only these: ids, or ids in the source, whole ones.
        parameters: Values for ``$name`` in ``where``: numbers, texts, truth values, lists of them.
        **saving: ``replace``, ``allow_empty``.

    Raises:
        UnsafeSql: ``where`` is no single expression.
        QueryError: DuckDB does not understand it; the message says where and what comes near.
        ScenarioNotFound: One of ``ids`` is not there.
        DatabaseExists, EmptyResult: See :class:`Saving`.
    """
    check_expression(where)
    wanted = [FILTERS.parse(text) for text in named]
    if ids is not None:
        wanted.append((FILTERS.load("ids"), {"ids": list(ids)}))
    pool = pools.of(lake, parent)
    if ids is not None:
        _check_ids(pool, list(ids))
    try:
        events = [_event(text) for text in happening]
        conditions, bound = _conditions(where, [*wanted, *events], parameters or {})
        query = pool.query("operations/filter", conditions=conditions)
        if not events:
            return pool.make("filter", name, query, bound, saving)
        narrowed = _narrowed(pool, *_conditions(where, wanted, parameters or {}))
        # Of what is left, events alone are asked: a condition that compares with the whole lake has had its answer.
        happen, bound_there = _conditions("true", events, {})
        found = narrowed.batches(narrowed.query("operations/filter", conditions=happen), bound_there)
        return pool.save(pool.lineage("filter", query, pools.as_recorded(bound)), name, found, saving)
    except QueryError as error:
        raise suggestions.in_condition(error, where, lake.layers) from error


def _narrowed(pool: Pool, conditions: str, bound: Mapping[str, Any]) -> Pool:
    """The pool at a lake that shows only what satisfies conditions: events are searched for in nothing else."""
    query = pool.query("operations/filter", conditions=conditions)
    left = pool.run(query, pools.as_recorded(bound))["scenario_id"].to_pylist()
    return replace(pool, lake=pool.lake.only(left))


def _event(text: str) -> tuple[NamedSql, dict[str, Any]]:
    """An event as a condition: that it happens in the scenario."""
    found, values = EVENTS.parse(text)
    return replace(found, text=f"scenario_id IN (SELECT scenario_id FROM (\n{found.text}\n))"), values


def _conditions(
    where: str, named: Sequence[tuple[NamedSql, dict[str, Any]]], parameters: Mapping[str, Any]
) -> tuple[str, dict[str, Any]]:
    """All conditions as one, and the values of their parameters."""
    conditions, bound = [f"({where}\n)"], dict(parameters)
    for number, (found, values) in enumerate(named):
        condition = found.text
        for key, value in values.items():  # two filters may both have a $min
            condition = re.sub(rf"\${key}\b", f"$f{number}_{key}", condition)
            bound[f"f{number}_{key}"] = value
        conditions.append(f"({condition}\n)")
    return " AND ".join(conditions), bound


def _check_ids(pool: Pool, ids: list[str]) -> None:
    """Refuse ids that nobody has: a list that has lost some should not pass for the whole."""
    query = pool.query("operations/unknown_ids")
    missing = pool.run(query, {"ids": ids})["id"].to_pylist()
    if missing:
        place = pool.references[0] if pool.parents else f"snapshot {pool.lake.snapshot.number}"
        raise ScenarioNotFound(
            f"{len(missing):,} of {len(ids):,} ids are not in {place}, for example {missing[0]}; ids are whole, as "
            "`SELECT scenario_id, source_scenario_id FROM metadata` lists them: take those out of the list"
        )
