"""``scenarionet split``: split a database into parts such as train and val."""

from __future__ import annotations

import click

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.group import Verb, verb
from scenarionet_pipelines.cli.output import count, print_json
from scenarionet_pipelines.cli.parameters import (
    allow_empty_option,
    json_option,
    lake_argument,
    new_version_option,
    optional_database_argument,
    pairs,
)


class _ManyFractions(Verb):
    """Accepts several words after ``--fractions``: ``--fractions train=0.9 val=0.1``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments with the option repeated before every word."""
        repeated: list[str] = []
        is_open = False
        for word in args:
            if is_open and not word.startswith("-"):
                repeated += ["--fractions", word]
            else:
                is_open = word == "--fractions"
                repeated += [] if is_open else [word]
        return super().parse_args(ctx, repeated)


@verb(
    "split",
    "scenarionet split lake busy --fractions train=0.9 val=0.1",
    "scenarionet split lake --fractions train=0.8 val=0.1 test=0.1 --seed 7 --by source_log --strict",
    "scenarionet split lake busy --fractions train=0.8 val=0.2 --stratify city",
    "scenarionet split lake busy --fractions past=0.8 recent=0.2 --along date",
    "scenarionet split lake busy --levels 10",
    "scenarionet split lake --each city",
    cls=_ManyFractions,
)
@lake_argument
@optional_database_argument
@click.option(
    "--fractions", multiple=True, metavar="PART=FRACTION ...", help="Parts and their fractions, which add up to 1."
)
@click.option(
    "--levels", type=int, metavar="N", help="Instead of fractions: N parts of equal size, from easy to difficult."
)
@click.option("--each", metavar="COLUMN", help="Instead of fractions: one part for each value of this column.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the random numbers.")
@click.option(
    "--by",
    metavar="COLUMN",
    default="scenario_id",
    show_default=True,
    help="Keep scenarios with equal values in one part.",
)
@click.option("--stratify", metavar="COLUMN", help="Keep the proportions of this column's values in every part.")
@click.option("--along", metavar="COLUMN", help="Split in the order of this column, for example by date.")
@click.option("--name", metavar="NAME", help="Name the parts NAME_PART. [default: DATABASE]")
@click.option("--strict", is_flag=True, help="Fail if scenarios of one source log are in several parts.")
@new_version_option
@allow_empty_option
@json_option
def command(
    lake: str,
    database: str | None,
    fractions: tuple[str, ...],
    levels: int | None,
    each: str | None,
    seed: int,
    by: str,
    stratify: str | None,
    along: str | None,
    name: str | None,
    strict: bool,
    replace: bool,
    allow_empty: bool,
    as_json: bool,
) -> None:
    """Split a database, or the whole lake, into disjoint parts that together contain every scenario.

    With fractions alone, a hash of the scenario id and the seed decides the part: the split is the same on every
    machine, and a scenario keeps its part as the lake grows. --by source_log keeps the scenarios of one recording
    together; a split that separates them causes a warning. --stratify and --along sort all scenarios and meet the
    fractions exactly. --levels makes a curriculum along the column difficulty.
    """
    from scenarionet_data import Lake

    wanted = {part: _fraction(part, word) for part, word in pairs(fractions, "--fractions").items()}
    made = Lake(lake).split(
        database,
        wanted or None,
        seed=seed,
        by=by,
        stratify=stratify,
        along=along,
        levels=levels,
        each=each,
        name=name,
        strict=strict,
        replace=replace,
        allow_empty=allow_empty,
    )
    if as_json:
        print_json({part: {"reference": db.reference, "count": len(db)} for part, db in made.items()})
        return
    total = max(1, sum(map(len, made.values())))
    for found in made.values():
        click.echo(f"{found.reference}: {count(len(found), 'scenario')} ({len(found) / total:.1%})")


def _fraction(part: str, word: str) -> float:
    try:
        return float(word)
    except ValueError as error:
        raise BadParameter(f"--fractions {part} expects a number such as 0.9, found {word!r}") from error
