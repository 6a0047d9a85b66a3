"""``scenarionet db drop``: remove a database."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import print_json
from scenarionet_pipelines.cli.parameters import database_argument, json_option, lake_argument


@verb("drop", "scenarionet db drop lake busy", "scenarionet db drop lake busy@1 --force")
@lake_argument
@database_argument
@click.option(
    "--force", is_flag=True, help="Drop it even if other databases were made from it; those cannot be rebuilt."
)
@json_option
def command(lake: str, database: str, force: bool, as_json: bool) -> None:
    """Remove a database, or one version of it (DATABASE@VERSION). The scenarios stay in the lake."""
    from scenarionet_data import Lake

    Lake(lake).drop(database, force=force)
    if as_json:
        print_json({"dropped": database})
    else:
        click.echo(f"dropped {database}")
