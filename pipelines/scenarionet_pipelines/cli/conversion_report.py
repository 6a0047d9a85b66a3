"""Output of ``scenarionet convert``: a table, or JSON."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.execution import worker_rows
from scenarionet_pipelines.cli.output import count, duration, print_json, print_table, size
from scenarionet_pipelines.messages import one_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenarionet_data.conversion import ConversionReport
    from scenarionet_data.ingest.passed_over import PassedOver

_MAX_REASONS = 5


def print_report(report: ConversionReport, lake: str, as_json: bool) -> None:
    """Print a conversion's report.

    Args:
        report: The report.
        lake: The lake as typed, for the suggested next command.
        as_json: Print one JSON object with all fields.
    """
    reasons = _reasons(report, lake)
    rate = report.converted / max(report.seconds, 1e-9)
    if as_json:
        failed = [{"shard": name, "reason": reason} for name, reason in report.failed]
        content = asdict(report) | {"failed": failed, "reasons": reasons, "is_clean": report.is_clean}
        content |= {"dropped": report.dropped, "assumed": report.assumed}
        content |= {"partitions": ["/".join(parts) for parts in sorted(report.partitions)]}
        print_json(content | {"scenarios_per_second": rate, "lake": lake, "next": _next(report, lake)})
        return
    print_table(_rows(report, reasons, rate))
    click.echo(_next(report, lake))


def _rows(report: ConversionReport, reasons: list[dict[str, Any]], rate: float) -> list[tuple[str, str]]:
    shards = count(report.shards, "shard")
    rows = [("converted", f"{count(report.converted, 'scenario')} in {shards}, {size(report.size)}")]
    rows += [("into", "/".join(parts)) for parts in sorted(report.partitions)]
    rows += [("quarantined", count(report.quarantined, "scenario"))] if report.quarantined else []
    duplicates = count(report.duplicates, "scenario")
    rows += [("duplicates", f"{duplicates} of these: the lake has their ids already")] if report.duplicates else []
    rows += [("", f"{r['scenarios']} x {r['error']}: {one_line(r['example'])}") for r in reasons[:_MAX_REASONS]]
    rows += _defect_rows(report)
    rows += passed_over_rows(report.passed_over)
    for what, number, why in (
        ("skipped", report.skipped, "already in the lake"),
        ("adopted", report.adopted, "finished by an interrupted run"),
        ("replaced", report.replaced, "superseded by newer ones"),
    ):
        rows += [(what, f"{count(number, 'shard')} {why}")] if number else []
    rows += stale_row(report.stale)
    rows += [("failed", count(len(report.failed), "shard"))] if report.failed else []
    rows += [("", f"{name}: {one_line(reason)}") for name, reason in report.failed[:_MAX_REASONS]]
    rows += worker_rows(report.workers) if len(report.workers) > 1 else []
    return [*rows, ("took", f"{duration(report.seconds)}, {rate:,.1f} scenarios/s")]


def _defect_rows(report: ConversionReport) -> list[tuple[str, str]]:
    """What was dropped and assumed, with the first reasons."""
    rows = []
    for action, number in (("dropped", report.dropped), ("assumed", report.assumed)):
        found = sorted((d for d in report.defects if d.action == action), key=lambda defect: -defect.count)
        rows += [(action, f"{count(number, 'row')} or features of recordings")] if number else []
        rows += [
            ("", f"{d.count:,} in {d.file}: {d.field}: {one_line(d.reason)} ({d.location})")
            for d in found[:_MAX_REASONS]
        ]
        rows += (
            [("", f"{len(found) - _MAX_REASONS:,} more kinds; --json lists all")] if len(found) > _MAX_REASONS else []
        )
    return rows


def passed_over_rows(passed_over: Sequence[PassedOver]) -> list[tuple[str, str]]:
    """Table rows about raw files that are not used."""
    rows = [f"{each.count:,} {each.what}: {each.reason}" for each in passed_over[:_MAX_REASONS]]
    more = len(passed_over) - _MAX_REASONS
    rows += [f"{more:,} more kinds; --json lists all"] if more > 0 else []
    return [("passed over" if not number else "", row) for number, row in enumerate(rows)]


def _reasons(report: ConversionReport, lake: str) -> list[dict[str, Any]]:
    """Reasons why scenarios of the report's partitions were quarantined, the most frequent first."""
    from scenarionet_data import Lake

    if not report.quarantined:
        return []
    rows = Lake(lake).named_query("quarantine_reasons").to_dicts()
    return [row for row in rows if (row["dataset"], row["version"], row["split"]) in report.partitions]


def _next(report: ConversionReport, lake: str) -> str:
    """The suggested next step."""
    if report.failed:
        return "Fix the cause and run the same command again: only the failed shards are converted."
    if report.defects and not report.quarantined:
        return f"Show what was dropped or assumed: scenarionet sql {lake} 'SELECT * FROM defects'"
    if report.quarantined:
        return f"Show the quarantined scenarios: scenarionet sql {lake} 'SELECT * FROM quarantine'"
    return f"Show what the lake contains: scenarionet list {lake}"


def stale_row(number: int) -> list[tuple[str, str]]:
    """Table row about shards written by another version of the converter; empty without such shards."""
    text = f"{count(number, 'shard')} written by another version of the converter; --reconvert-stale replaces them"
    return [("stale", text)] if number else []
