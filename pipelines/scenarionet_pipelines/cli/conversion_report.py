"""Output of ``scenarionet convert``: JSON, and a table."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from scenarionet_pipelines.cli.execution import worker_rows
from scenarionet_pipelines.cli.output import count, duration, size, table
from scenarionet_pipelines.messages import one_line

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scenarionet_data.conversion import ConversionReport
    from scenarionet_data.ingest.passed_over import PassedOver

_MAX_REASONS = 5


def report_content(report: ConversionReport, lake: str) -> tuple[dict[str, Any], list[str]]:
    """Return a conversion's report as a JSON object with all fields, and as lines of text.

    Args:
        report: The report.
        lake: The lake as typed, for the suggested next command.
    """
    reasons, next_step = _reasons(report, lake), _next(report, lake)
    rate = report.converted / max(report.seconds, 1e-9)
    content = asdict(report) | {"reasons": reasons, "is_clean": report.is_clean}
    content |= {"failed": [{"shard": name, "reason": reason} for name, reason in report.failed]}
    content |= {"dropped": report.dropped, "assumed": report.assumed}
    content |= {"partitions": ["/".join(parts) for parts in sorted(report.partitions)]}
    shards = f"{count(report.shards, 'shard')}, {size(report.size)}"
    rows = [("converted", f"{count(report.converted, 'scenario')} in {shards}")]
    rows += [("into", name) for name in content["partitions"]]
    rows += [("quarantined", count(report.quarantined, "scenario"))] if report.quarantined else []
    duplicates = f"{count(report.duplicates, 'scenario')} of these: the lake has their ids already"
    rows += [("duplicates", duplicates)] if report.duplicates else []
    rows += [("", f"{r['scenarios']} x {r['error']}: {one_line(r['example'])}") for r in reasons[:_MAX_REASONS]]
    for action, number in (("dropped", report.dropped), ("assumed", report.assumed)):
        found = sorted((d for d in report.defects if d.action == action), key=lambda defect: -defect.count)
        texts = [f"{d.count:,} in {d.file}: {d.field}: {one_line(d.reason)} ({d.location})" for d in found]
        rows += [(action, f"{count(number, 'row')} or features of recordings")] if number else []
        rows += [("", text) for text in _first(texts)]
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
    rows += [("took", f"{duration(report.seconds)}, {rate:,.1f} scenarios/s")]
    return content | {"scenarios_per_second": rate, "lake": lake, "next": next_step}, [*table(rows), next_step]


def _first(texts: list[str]) -> list[str]:
    """Return the first texts, and how many more there are."""
    more = len(texts) - _MAX_REASONS
    return texts[:_MAX_REASONS] + ([f"{more:,} more kinds; --json lists all"] if more > 0 else [])


def passed_over_rows(passed_over: Sequence[PassedOver]) -> list[tuple[str, str]]:
    """Table rows about raw files that are not used."""
    rows = _first([f"{each.count:,} {each.what}: {each.reason}" for each in passed_over])
    return [("" if number else "passed over", row) for number, row in enumerate(rows)]


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
