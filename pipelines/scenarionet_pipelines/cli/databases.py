"""Output of verbs that create or compare databases: the JSON object, and the text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from scenarionet_pipelines.cli.output import count, table

if TYPE_CHECKING:
    from scenarionet_data.databases.record import DatabaseRecord
    from scenarionet_data.operations.diff import Diff

_MAX_IDS, _MAX_CELL = 5, 60


def described(created: DatabaseRecord) -> tuple[dict[str, Any], str]:
    """Return a new database with its lineage, and a line with its reference and number of scenarios."""
    content = {"name": created.name, "reference": created.reference} | asdict(created.lineage)
    return content, f"{created.reference}: {count(len(created), 'scenario')}"


def diff_lines(diff: Diff) -> Iterator[str]:
    """Yield the number of scenarios that came, went and changed, with a few ids of each."""
    words = ", ".join(f"{count(diff.count(what), 'scenario')} {what}" for what in ("came", "went", "changed"))
    yield f"{diff.before} -> {diff.after}: {words}; {diff.counts[0]:,} -> {diff.counts[1]:,}"
    for what in ("came", "went", "changed"):
        ids = diff.ids(what, _MAX_IDS)
        yield from table(("", what, name) for name in ids)
        if more := diff.count(what) - len(ids):
            yield f"  {what}  and {more:,} more: --json lists all"
    if diff.columns:
        head = ("column", "scenarios", "for example", "before", "after")
        yield from table([(c.name, c.count, c.scenario_id, c.before, c.after) for c in diff.columns], head, _MAX_CELL)


def diff_as_json(diff: Diff) -> dict[str, Any]:
    """Return everything that :func:`diff_lines` yields, without shortening."""
    return {
        "before": {"reference": diff.before, "count": diff.counts[0]},
        "after": {"reference": diff.after, "count": diff.counts[1]},
        **{what: diff.ids(what) for what in ("came", "went", "changed")},
        "columns": [asdict(column) for column in diff.columns],
    }
