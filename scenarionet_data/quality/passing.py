"""The members that break no rule, saved as a database."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Unpack

import pyarrow.compute as pc

from scenarionet_data import converters
from scenarionet_data.converters.base import Budgets
from scenarionet_data.databases.record import Database
from scenarionet_data.operations import database_query as pools
from scenarionet_data.operations.database_query import Saving
from scenarionet_data.quality.report import Findings
from scenarionet_data.query.statements import quoted


def save_good(findings: Findings, name: str, *, is_strict: bool = False, **saving: Unpack[Saving]) -> Database:
    """Save the scenarios that were looked at and break no hard rule, in their order.

    Args:
        findings: Of the lake or database.
        name: Name of the new database.
        is_strict: Leave out what breaks a soft rule, too.
        **saving: ``replace``, ``allow_empty``.

    Raises:
        DatabaseExists, EmptyResult: See :class:`Saving`.
    """
    pool = pools.of(findings.holder, findings.database)
    query = pool.query("operations/good", rules=_broken_sql(findings, is_strict))
    parameters = {"checks": [check.name for check in findings.checks], "is_strict": is_strict}
    broken = findings.broken_ids(is_strict=is_strict)
    rows = (
        batch.filter(pc.invert(pc.is_in(batch["scenario_id"], broken)))
        for batch in pool.batches(pool.query("operations/keep"), {})
    )
    return pool.save(pool.lineage("check", query, parameters), name, rows, saving)


def _broken_sql(findings: Findings, is_strict: bool) -> str:
    """The rules as parts of a WITH clause, with all that they need: the lineage can run them again."""
    rules = [check.query for check in findings.checks if check.is_hard or is_strict]
    rules = rules or ["SELECT NULL AS scenario_id WHERE false"]
    union = "\nUNION ALL\n".join(f"SELECT scenario_id::VARCHAR AS scenario_id FROM (\n{rule}\n)" for rule in rules)
    datasets = sorted(set(findings.totals["dataset"].to_pylist()))
    budgets = [{"dataset": dataset, **asdict(converters.budgets(dataset))} for dataset in datasets]
    return (
        f"budgets AS ({_values(budgets, {'dataset': '', **asdict(Budgets())})}), "
        f"broken_files AS ({_values(findings.broken_files.to_pylist(), {'file': '', 'reason': ''})}), "
        f"broken AS (SELECT scenario_id FROM (\n{union}\n) WHERE scenario_id IS NOT NULL)"
    )


def _values(rows: list[dict[str, object]], like: Mapping[str, object]) -> str:
    """Rows as SQL; without any, no rows of the same types."""
    selects = ["SELECT " + ", ".join(f"{_literal(row[key])} AS {key}" for key in like) for row in rows or [dict(like)]]
    return " UNION ALL ".join(selects) + ("" if rows else " WHERE false")


def _literal(value: object) -> str:
    return quoted(value) if isinstance(value, str) else f"{value}::DOUBLE"
