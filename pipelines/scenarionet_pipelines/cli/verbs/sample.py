"""``scenarionet sample``: some scenarios of a database, drawn by seed."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.databases import print_made
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, new_version_option, to_option


@verb(
    "sample",
    "scenarionet sample lake busy -n 1000 --to few",
    "scenarionet sample lake --fraction 0.01 --stratify dataset --to tiny",
    "scenarionet sample lake busy -n 500 --balance city --weights difficulty --seed 3 --to hard",
    "scenarionet sample lake busy -n 500 --levels 5 --to curriculum",
)
@lake_argument
@click.argument("database", metavar="DB", required=False)
@click.option("-n", type=int, help="How many scenarios, exactly.")
@click.option("--fraction", type=float, help="How many scenarios, as a share.")
@click.option("--seed", type=int, default=0, show_default=True, help="Another seed, another sample.")
@click.option("--weights", default="1", metavar="EXPR", help="SQL over metadata: who has more is drawn more often.")
@click.option("--stratify", metavar="COLUMN", help="Its values keep their proportions.")
@click.option("--balance", metavar="COLUMN", help="Of each value as many, while there are any.")
@click.option("--levels", type=int, help="Of so many levels of difficulty as many, from easy to difficult.")
@to_option
@new_version_option
@json_option
def command(
    lake: str,
    database: str | None,
    n: int | None,
    fraction: float | None,
    seed: int,
    weights: str,
    stratify: str | None,
    balance: str | None,
    levels: int | None,
    name: str,
    replace: bool,
    as_json: bool,
) -> None:
    """Save scenarios of a database (or of the whole lake), drawn without replacement.

    The same seed draws the same scenarios on every machine. They keep the order of the database; with --levels,
    which draws a curriculum, they are sorted by difficulty.
    """
    from scenarionet_data import Lake

    opened = Lake(lake)
    made = opened.sample(
        database,
        name=name,
        n=n,
        fraction=fraction,
        seed=seed,
        weights=weights,
        stratify=stratify,
        balance=balance,
        levels=levels,
        replace=replace,
    )
    print_made(made, as_json, len(opened.database(database)) if database else len(opened))
