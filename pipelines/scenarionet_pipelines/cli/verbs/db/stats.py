"""``scenarionet db stats``: compare statistics of databases."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from scenarionet_data.storage.files.places import local_path
from scenarionet_pipelines.cli.output import cell, print_json, print_table
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
        if self.as_json:
            print_json({"databases": [asdict(each) for each in found]})
        elif not self.output:
            print_statistics(found)


def print_statistics(found: list[DatabaseStatistics]) -> None:
    """Print one column per database."""
    rows = [["scenarios", *(each.count for each in found)]]
    full = next((each.measures for each in found if each.measures), ())
    for place, measure in enumerate(full):
        unit = f" [{measure.unit}]" if measure.unit not in ("", "ratio") else ""
        rows.append([measure.measure + unit])
        for each in found:
            (value,) = each.measures[place : place + 1] or (None,)
            if value is None or value.mean is None:
                rows[-1].append("-")
            else:
                spread = f"{value.mean:,.2f} ± {value.std:,.2f}" if value.std is not None else cell(value.mean)
                rows[-1].append(spread)
    print_table(rows, ["", *(each.name for each in found)])
