"""The SQL behind filters and splits: what is chosen from, the query, and the parts of a split."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import pyarrow as pa

from scenarionet_data.catalog import filters
from scenarionet_data.catalog.engine import Engine, check_expression
from scenarionet_data.errors import BadParameter
from scenarionet_data.resources import SQL


@dataclass(frozen=True)
class Pool:
    """What scenarios are chosen from.

    Attributes:
        engine: Asks the snapshot that holds them.
        snapshot: Its number.
        source: SQL for their metadata.
        parents: ``name@version`` of the database they belong to; empty for the whole lake.
        tables: Tables that ``source`` names beside the views.
    """

    engine: Engine
    snapshot: int
    source: str
    parents: list[str]
    tables: Mapping[str, pa.Table] = field(default_factory=dict)

    def choose(self, query: str, parameters: Mapping[str, Any]) -> pa.Table:
        """Rows of a query over ``source``."""
        return self.engine.arrow(query, parameters, **self.tables)

    @property
    def weight(self) -> str:
        """SQL for a scenario's weight: its parent's, or 1."""
        return "weight" if self.parents else "1.0"

    @property
    def order(self) -> str:
        """SQL for the order of the result: the parent's, or by id."""
        return "position" if self.parents else "scenario_id"


def filter_query(
    pool: Pool, where: str, named: Sequence[str], parameters: Mapping[str, Any]
) -> tuple[str, dict[str, Any]]:
    """The query of a filter and the values of its parameters.

    Args:
        pool: What is chosen from.
        where: SQL expression over ``metadata``.
        named: Filters of ``sql/filters``, as ``name:key=value``.
        parameters: Values for ``$name`` in ``where``.

    Raises:
        UnsafeSql: ``where`` is no single expression.
        UnknownFilter: A named filter is not there.
    """
    check_expression(where)
    conditions, bound = [f"({where}\n)"], dict(parameters)
    for number, text in enumerate(named):
        found, values = filters.parse(text)
        condition = found.text
        for key, value in values.items():  # two filters may both have a $min
            condition = re.sub(rf"\${key}\b", f"$f{number}_{key}", condition)
            bound[f"f{number}_{key}"] = value
        conditions.append(f"({condition}\n)")
    query = (
        f"SELECT scenario_id, {pool.weight} AS weight, content_hash FROM {pool.source} "
        f"WHERE {' AND '.join(conditions)} ORDER BY {pool.order}"
    )
    return query, bound


def split_query(pool: Pool, by: str) -> str:
    """The query that draws a number ``u`` in [0, 1) for every scenario; ``$seed`` is its parameter.

    Args:
        pool: What is split.
        by: Column whose equal values get the same number.

    Raises:
        BadParameter: There is no such column.
    """
    columns = pool.engine.arrow("SELECT * FROM metadata LIMIT 0").column_names
    if by not in columns:
        raise BadParameter(f"no column {by!r} to split by; there are {', '.join(columns)}")
    query = (SQL / "splits" / "by_hash.sql").read_text("utf-8")
    words = {"source": pool.source, "by": by, "weight": pool.weight, "order": pool.order}
    for word, text in words.items():
        query = query.replace(f"{{{word}}}", text)
    return query


def intervals(fractions: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """The share of [0, 1) that each part of a split takes, one after the other.

    Raises:
        BadParameter: The fractions are not above 0, or do not add up to 1.
    """
    if not fractions or any(fraction <= 0 for fraction in fractions.values()):
        raise BadParameter("wanted at least one part, each with a fraction above 0, for example train=0.9 val=0.1")
    total = sum(fractions.values())
    if abs(total - 1.0) > 1e-6:
        raise BadParameter(f"wanted fractions that add up to 1, found {total:g}")
    found, lower = {}, 0.0
    for part, fraction in fractions.items():
        found[part] = (lower, lower + fraction / total)
        lower = found[part][1]
    last = list(fractions)[-1]
    found[last] = (found[last][0], 1.0)  # whatever the sum of the floats, nothing is left over
    return found
