"""``scenarionet show``: what is known about one scenario."""

from __future__ import annotations

import click

from pipelines.cli.group import verb
from pipelines.cli.output import print_json, print_table
from pipelines.cli.parameters import json_option, lake_argument, snapshot_option


@verb("show", "scenarionet show lake waymo/v1.2/637f20cafde22ff8", "scenarionet show lake 637f20caf --json")
@lake_argument
@click.argument("scenario_id", metavar="ID")
@snapshot_option
@json_option
def command(lake: str, scenario_id: str, snapshot: int | None, as_json: bool) -> None:
    """Show one scenario's facts, with their units.

    ID is the scenario's id, or a part of it that only this scenario has.
    """
    from scenarionet_data import Lake, tables

    facts = Lake(lake, snapshot).facts(scenario_id)
    if as_json:
        print_json(facts)
        return
    metadata = tables.load("metadata")
    units = {column.name: column.unit for column in (*metadata.columns, *metadata.derived)}
    rows = [(name, value, units.get(name, "")) for name, value in facts.items() if value is not None]
    print_table(rows, max_cell=100)
