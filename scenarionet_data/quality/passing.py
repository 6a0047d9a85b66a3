"""Databases of the scenarios that pass checks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

import pyarrow.compute as pc

from scenarionet_data import converters
from scenarionet_data.converters.base import Budgets
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.operations.database_query import DatabaseQuery
from scenarionet_data.quality.report import CheckReport
from scenarionet_data.query.statements import quoted


def save_passing(
    report: CheckReport, name: str, *, strict: bool = False, replace: bool = False, allow_empty: bool = False
) -> DatabaseRecord:
    """Save the checked scenarios that violate no hard rule, in their order.

    Args:
        report: Report of the lake or database.
        name: Name of the new database.
        strict: Leave out scenarios that violate a soft rule, too.
        replace: Add a version if the database exists.
        allow_empty: Save a database without members, too.

    Raises:
        DatabaseExists: The database exists and ``replace`` is False.
        EmptyResult: No scenario passes and ``allow_empty`` is False.
    """
    query = DatabaseQuery.over(report.view, report.database)
    rules = [check.query for check in report.checks if check.is_hard or strict]
    rules = rules or ["SELECT NULL AS scenario_id WHERE false"]
    union = "\nUNION ALL\n".join(f"SELECT scenario_id::VARCHAR AS scenario_id FROM (\n{rule}\n)" for rule in rules)
    datasets = sorted(set(report.totals["dataset"].to_pylist()))
    budgets = [{"dataset": dataset, **asdict(converters.budgets(dataset))} for dataset in datasets]
    sql = query.query(
        "operations/passing",
        {
            "rules": (
                f"budgets AS ({_values(budgets, {'dataset': '', **asdict(Budgets())})}), "
                f"broken_files AS ({_values(report.broken_files.to_pylist(), {'file': '', 'reason': ''})}), "
                f"broken AS (SELECT scenario_id FROM (\n{union}\n) WHERE scenario_id IS NOT NULL)"
            )
        },
    )
    parameters = {"checks": [check.name for check in report.checks], "is_strict": strict}
    failing = report.failing_ids(strict=strict)
    rows = (
        batch.filter(pc.invert(pc.is_in(batch["scenario_id"], failing)))
        for batch in query.batches(query.query("operations/keep"), {})
    )
    return query.save(query.lineage("check", sql, parameters), name, rows, replace=replace, allow_empty=allow_empty)


def _values(rows: list[dict[str, object]], like: Mapping[str, object]) -> str:
    """Return SQL for rows; without rows, for an empty relation of the same types."""
    selects = ["SELECT " + ", ".join(f"{_literal(row[key])} AS {key}" for key in like) for row in rows or [dict(like)]]
    return " UNION ALL ".join(selects) + ("" if rows else " WHERE false")


def _literal(value: object) -> str:
    return quoted(value) if isinstance(value, str) else f"{value}::DOUBLE"
