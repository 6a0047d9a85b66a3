"""``scenarionet sample``: save a random sample of a database."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.databases import print_created
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.parameters import (
    json_option,
    lake_argument,
    name_option,
    new_version_option,
    optional_database_argument,
)


@verb(
    "sample",
    "scenarionet sample lake busy -n 1000 --name few",
    "scenarionet sample lake --fraction 0.01 --stratify dataset --name tiny",
    "scenarionet sample lake busy -n 500 --balance city --weights difficulty --seed 3 --name hard",
    "scenarionet sample lake busy -n 500 --levels 5 --name curriculum",
)
@lake_argument
@optional_database_argument
@click.option("-n", type=int, metavar="N", help="Number of scenarios.")
@click.option("--fraction", type=float, help="Number of scenarios as a fraction of the database.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the random numbers.")
@click.option(
    "--weights", default="1", metavar="EXPR", help="Sampling weight: SQL expression over the columns of metadata."
)
@click.option("--stratify", metavar="COLUMN", help="Keep the proportions of this column's values.")
@click.option(
    "--balance", metavar="COLUMN", help="Draw equally often from each value of this column, as far as possible."
)
@click.option(
    "--levels",
    type=int,
    metavar="N",
    help="Draw equally often from N levels of difficulty, sorted from easy to difficult.",
)
@name_option
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
    """Save a random sample of a database, or of the whole lake, drawn without replacement.

    The same seed draws the same scenarios on every machine. They keep the order of the database; with --levels, a
    curriculum, they are sorted by difficulty.
    """
    from scenarionet_data import Lake

    created = Lake(lake).sample(
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
    print_created(created, as_json)
