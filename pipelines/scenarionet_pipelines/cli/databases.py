"""What verbs print about databases they made, and about what is different in two."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.output import count, print_json, print_table

if TYPE_CHECKING:
    from scenarionet_data import Database
    from scenarionet_data.operations.diff import Diff

_MAX_IDS, _MAX_CELL = 5, 60


def print_made(made: Database, as_json: bool, total: int | None = None) -> None:
    """Print a database: its reference and how many scenarios it has (of how many).

    Args:
        made: The database.
        as_json: As one JSON object, with its lineage.
        total: Scenarios it was chosen from.
    """
    if as_json:
        of = {} if total is None else {"of": total}
        print_json({"name": made.name, "reference": made.reference} | of | asdict(made.lineage))
    elif total is None:
        click.echo(f"{made.reference}: {count(len(made), 'scenario')}")
    else:
        click.echo(f"{made.reference}: {len(made):,} of {count(total, 'scenario')}")


def print_diff(diff: Diff) -> None:
    """Print what came, went and changed, a few of each by name."""
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
    """What :func:`print_diff` prints, whole."""
    return {
        "before": {"reference": diff.before, "count": diff.counts[0]},
        "after": {"reference": diff.after, "count": diff.counts[1]},
        **{what: diff.ids(what) for what in ("came", "went", "changed")},
        "columns": [asdict(column) for column in diff.columns],
    }
