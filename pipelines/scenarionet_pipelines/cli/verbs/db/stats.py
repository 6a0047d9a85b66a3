"""``scenarionet db stats``: compare statistics of databases."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from scenarionet_data.storage.files.places import local_path
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import cell, print_json, print_table
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, snapshot_option

if TYPE_CHECKING:
    from scenarionet_data.operations.comparison import DatabaseStatistics, Measure


@verb(
    "stats",
    "scenarionet db stats lake",
    "scenarionet db stats lake busy_train busy_val",
    "scenarionet db stats lake busy_train busy_val -o stats.svg",
)
@lake_argument
@click.argument("databases", metavar="[DATABASE]...", nargs=-1)
@click.option(
    "-o", "--output", type=click.Path(dir_okay=False), metavar="FILE", help="Draw a chart to a .png, .svg or .pdf file."
)
@snapshot_option
@json_option
def command(lake: str, databases: tuple[str, ...], output: str | None, snapshot: int | None, as_json: bool) -> None:
    """Compare statistics of databases: track length, vehicles, intersections, construction and more.

    Values are mean ± standard deviation over scenarios. Without DATABASE, the whole lake is described. Charts require
    the extra `plots`.
    """
    from scenarionet_data import Lake

    if output:
        local_path(output, "a chart")
    found = Lake(lake, snapshot).compare(*databases)
    if output:
        from scenarionet_data.plots import write_comparison

        write_comparison(found, output)
        click.echo(f"wrote {output}", err=True)
    if as_json:
        print_json({"databases": [asdict(each) for each in found]})
    elif not output:
        _print(found)


def _print(found: list[DatabaseStatistics]) -> None:
    rows = [["scenarios", *(each.count for each in found)]]
    full = next((each.measures for each in found if each.measures), ())
    for place, measure in enumerate(full):
        unit = f" [{measure.unit}]" if measure.unit not in ("", "ratio") else ""
        rows.append([measure.measure + unit, *(_cell(each.measures[place : place + 1]) for each in found)])
    print_table(rows, ["", *(each.name for each in found)])


def _cell(measures: tuple[Measure, ...]) -> str:
    if not measures or measures[0].mean is None:
        return "-"
    (measure,) = measures
    return cell(measure.mean) if measure.std is None else f"{measure.mean:,.2f} ± {measure.std:,.2f}"
