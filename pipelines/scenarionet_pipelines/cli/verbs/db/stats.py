"""``scenarionet db stats``: compare statistics of databases."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from scenarionet_data.storage.files.places import local_path
from scenarionet_pipelines.cli.output import cell, table
from scenarionet_pipelines.cli.verb import OPTIONAL_DATABASES, SNAPSHOT, LakeVerb, option

if TYPE_CHECKING:
    from scenarionet_data.operations.comparison import DatabaseStatistics


class StatsVerb(LakeVerb):
    """Compare statistics of databases: track length, vehicles, intersections, construction and more.

    Values are mean ± standard deviation over scenarios. Without DATABASE, the whole lake is described. Charts require
    the extra `plots`.
    """

    examples = (
        "scenarionet db stats lake",
        "scenarionet db stats lake busy_train busy_val",
        "scenarionet db stats lake busy_train busy_val -o stats.svg",
    )
    databases: tuple[str, ...] = OPTIONAL_DATABASES
    output: str | None = option("Draw a chart to a .png, .svg or .pdf file.", "-o", "--output", metavar="FILE")
    snapshot: int | None = SNAPSHOT

    def run(self) -> None:
        if self.output:
            local_path(self.output, "a chart")
        found = self.open().compare(*self.databases)
        if self.output:
            from scenarionet_data.plots import write_comparison

            write_comparison(found, self.output)
            click.echo(f"wrote {self.output}", err=True)
        lines = [] if self.output else table(statistics(found), ["", *(each.name for each in found)])
        self.say({"databases": [asdict(each) for each in found]}, lines)


def statistics(found: list[DatabaseStatistics]) -> list[list[Any]]:
    """Return rows with one column per database."""
    rows: list[list[Any]] = [["scenarios", *(each.count for each in found)]]
    full = next((each.measures for each in found if each.measures), ())
    for place, measure in enumerate(full):
        unit = f" [{measure.unit}]" if measure.unit not in ("", "ratio") else ""
        rows.append([measure.measure + unit])
        for each in found:
            (value,) = each.measures[place : place + 1] or (None,)
            if value is None or value.std is None:
                rows[-1].append(cell(value and value.mean))
            else:
                rows[-1].append(f"{value.mean:,.2f} ± {value.std:,.2f}")
    return rows
