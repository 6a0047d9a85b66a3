"""Output of verbs that create or compare databases."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.output import count, print_json, print_table

if TYPE_CHECKING:
    from scenarionet_data import Database
    from scenarionet_data.operations.diff import Diff

_MAX_IDS, _MAX_CELL = 5, 60


def print_created(created: Database, as_json: bool) -> None:
    """Print a new database: its reference and its number of scenarios, or its lineage as JSON.

    Args:
        created: The database.
        as_json: Print one JSON object.
    """
    if as_json:
        print_json({"name": created.name, "reference": created.reference} | asdict(created.lineage))
    else:
        click.echo(f"{created.reference}: {count(len(created), 'scenario')}")


def print_diff(diff: Diff) -> None:
    """Print the number of scenarios that came, went and changed, with a few ids of each."""
    words = ", ".join(f"{count(diff.count(what), 'scenario')} {what}" for what in ("came", "went", "changed"))
    click.echo(f"{diff.before} -> {diff.after}: {words}; {diff.counts[0]:,} -> {diff.counts[1]:,}")
    for what in ("came", "went", "changed"):
        ids = diff.ids(what, _MAX_IDS)
        more = diff.count(what) - len(ids)
        print_table(("", what, name) for name in ids)
        if more > 0:
            click.echo(f"  {what}  and {more:,} more: --json lists all")
    if diff.columns:
        head = ("column", "scenarios", "for example", "before", "after")
        rows = [(c.name, c.count, c.scenario_id, c.before, c.after) for c in diff.columns]
        print_table(rows, head, _MAX_CELL)


def diff_as_json(diff: Diff) -> dict[str, Any]:
    """Return everything :func:`print_diff` prints, without shortening."""
    return {
        "before": {"reference": diff.before, "count": diff.counts[0]},
        "after": {"reference": diff.after, "count": diff.counts[1]},
        **{what: diff.ids(what) for what in ("came", "went", "changed")},
        "columns": [asdict(column) for column in diff.columns],
    }
