"""What a conversion did, for a person or as JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.execution import worker_rows
from scenarionet_pipelines.cli.group import one_line
from scenarionet_pipelines.cli.output import count, duration, print_json, print_table, size

if TYPE_CHECKING:
    from scenarionet_data.conversion import Report

_REASONS = 5


def print_report(report: Report, lake: str, as_json: bool) -> None:
    """Print a conversion's report.

    Args:
        report: What it did.
        lake: The lake as it was typed.
        as_json: One object, with everything.
    """
    reasons = _reasons(report, lake)
    rate = report.converted / max(report.seconds, 1e-9)
    if as_json:
        failed = [{"shard": name, "reason": reason} for name, reason in report.failed]
        content = asdict(report) | {"failed": failed, "reasons": reasons, "is_clean": report.is_clean}
        content |= {"partitions": ["/".join(parts) for parts in sorted(report.partitions)]}
        print_json(content | {"scenarios_per_second": rate, "lake": lake, "next": _next(report, lake)})
        return
    print_table(_rows(report, reasons, rate))
    click.echo(_next(report, lake))


def _rows(report: Report, reasons: list[dict[str, Any]], rate: float) -> list[tuple[str, str]]:
    shards = count(report.shards, "shard")
    rows = [("converted", f"{count(report.converted, 'scenario')} in {shards}, {size(report.size)}")]
    rows += [("into", "/".join(parts)) for parts in sorted(report.partitions)]
    rows += [("quarantined", count(report.quarantined, "scenario"))] if report.quarantined else []
    rows += [("", f"{r['scenarios']} x {r['error']}: {one_line(r['example'])}") for r in reasons[:_REASONS]]
    for what, number, why in (
        ("skipped", report.skipped, "that the lake had already"),
        ("adopted", report.adopted, "that an interrupted run had finished"),
        ("replaced", report.replaced, "whose scenarios made way for newer ones"),
    ):
        rows += [(what, f"{count(number, 'shard')} {why}")] if number else []
    rows += stale_row(report.stale)
    rows += [("failed", count(len(report.failed), "shard"))] if report.failed else []
    rows += [("", f"{name}: {one_line(reason)}") for name, reason in report.failed[:_REASONS]]
    rows += worker_rows(report.workers) if len(report.workers) > 1 else []
    return [*rows, ("took", f"{duration(report.seconds)}, {rate:,.1f} scenarios/s")]


def _reasons(report: Report, lake: str) -> list[dict[str, Any]]:
    """Why scenarios of the report's partitions are in quarantine, the most frequent first."""
    from scenarionet_data import Lake

    if not report.quarantined:
        return []
    rows = Lake(lake).named_query("quarantine_reasons").to_dicts()
    return [row for row in rows if (row["dataset"], row["version"], row["split"]) in report.partitions]


def _next(report: Report, lake: str) -> str:
    """What to do now, in a sentence."""
    if report.failed:
        return "Mend what failed and run the same command again: only the failed shards are left to do."
    if report.quarantined:
        return f"See every rejected scenario: scenarionet sql {lake} 'SELECT * FROM quarantine'"
    return f"See what the lake holds: scenarionet list {lake}"


def stale_row(number: int) -> list[tuple[str, str]]:
    """A line about shards that another version of the converter wrote, if there are any."""
    text = f"{count(number, 'shard')} written by another version of the converter; --stale converts them anew"
    return [("stale", text)] if number else []
