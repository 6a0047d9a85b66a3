"""The members that break no rule, saved as a database."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict

import pyarrow as pa

from scenarionet_data import converters, software
from scenarionet_data.catalog import database as databases
from scenarionet_data.catalog.checks import Findings
from scenarionet_data.catalog.database import Database, Lineage
from scenarionet_data.catalog.engine import Engine
from scenarionet_data.converters.base import Budgets
from scenarionet_data.errors import BadParameter
from scenarionet_data.store import snapshot as snapshots


def save_good(findings: Findings, name: str, *, is_strict: bool = False, overwrite: bool = False) -> Database:
    """Save the scenarios that were looked at and break no hard rule, in their order.

    Args:
        findings: Of the lake or database.
        name: Name of the new database.
        is_strict: Leave out what breaks a soft rule, too.
        overwrite: Make a further version of an existing database.

    Raises:
        BadParameter: Nothing is left.
        DatabaseExists: And ``overwrite`` is False.
    """
    databases.check_name(name)
    parent, holder = findings.database, findings.holder
    tables = {"broken": pa.table({"scenario_id": findings.broken_ids(is_strict=is_strict)})}
    source, weight, order = "metadata", "1.0", "scenario_id"
    if parent is not None:
        tables["members"] = parent.members
        source = "metadata JOIN (SELECT scenario_id, position, weight FROM members) USING (scenario_id)"
        weight, order = "weight", "position"
    select = f"SELECT scenario_id, {weight} AS weight, content_hash FROM {source}"
    engine = Engine(holder.files, holder.snapshot)
    members = engine.arrow(f"{select} ANTI JOIN broken USING (scenario_id) ORDER BY {order}", **tables)
    engine.close()
    if not members.num_rows:
        raise BadParameter(f"every scenario breaks a rule, so there is nothing to save as {name!r}; see --broken FILE")
    lineage = Lineage(
        operation="check",
        sql=f"{_broken_sql(findings, is_strict)}\n{select} ANTI JOIN broken USING (scenario_id) ORDER BY {order}",
        parameters={"checks": [check.name for check in findings.checks], "is_strict": is_strict},
        parents=[parent.reference] if parent is not None else [],
        snapshot=holder.snapshot.number,
        created_at=snapshots.now(),
        count=members.num_rows,
        created_with=software.name_and_version(),
    )
    return databases.save(holder.files, name, members, lineage, overwrite=overwrite)


def _broken_sql(findings: Findings, is_strict: bool) -> str:
    """The rules as one WITH clause that stands alone, so that the database can be made again from its lineage."""
    rules = [check.query for check in findings.checks if check.is_hard or is_strict]
    rules = rules or ["SELECT NULL AS scenario_id WHERE false"]
    union = "\nUNION ALL\n".join(f"SELECT scenario_id::VARCHAR AS scenario_id FROM (\n{rule}\n)" for rule in rules)
    datasets = sorted(set(findings.totals["dataset"].to_pylist()))
    budgets = [{"dataset": dataset, **asdict(converters.budgets(dataset))} for dataset in datasets]
    return (
        f"WITH budgets AS ({_values(budgets, {'dataset': '', **asdict(Budgets())})}), "
        f"broken_files AS ({_values(findings.broken_files.to_pylist(), {'file': '', 'reason': ''})}), "
        f"broken AS (SELECT scenario_id FROM (\n{union}\n) WHERE scenario_id IS NOT NULL)"
    )


def _values(rows: list[dict[str, object]], like: Mapping[str, object]) -> str:
    """Rows as SQL; without any, no rows of the same types."""
    selects = ["SELECT " + ", ".join(f"{_literal(row[key])} AS {key}" for key in like) for row in rows or [dict(like)]]
    return " UNION ALL ".join(selects) + ("" if rows else " WHERE false")


def _literal(value: object) -> str:
    return "'" + value.replace("'", "''") + "'" if isinstance(value, str) else f"{value}::DOUBLE"
