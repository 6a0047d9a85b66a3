"""``scenarionet drop``: a database less; the scenarios stay."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import json_option, lake_argument


@verb("drop", "scenarionet drop lake busy", "scenarionet drop lake busy@1 --force")
@lake_argument
@click.argument("database", metavar="DB")
@click.option("--force", is_flag=True, help="Also when others were made from it; they cannot be rebuilt then.")
@json_option
def command(lake: str, database: str, force: bool, as_json: bool) -> None:
    """Remove a database, or one version of it (DB@VERSION). The scenarios stay in the lake."""
    from scenarionet_data import Lake

    Lake(lake).drop(database, force=force)
    if as_json:
        print_json({"dropped": database})
    else:
        click.echo(f"dropped {database}")
