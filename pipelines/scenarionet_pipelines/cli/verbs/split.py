"""``scenarionet split``: a database in parts, such as train and val."""

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
    pairs,
)


class _ManyFractions(Verb):
    """Lets ``--fractions`` take several words: ``--fractions train=0.9 val=0.1``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Repeat the option before every word."""
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
@click.argument("database", metavar="DB", required=False)
@click.option("--fractions", multiple=True, metavar="PART=FRACTION ...", help="They add up to 1.")
@click.option("--levels", type=int, help="Instead of fractions: parts of equal size, from easy to difficult.")
@click.option("--each", metavar="COLUMN", help="Instead of fractions: a part for every value.")
@click.option("--seed", type=int, default=0, show_default=True, help="Another seed, another split.")
@click.option("--by", default="scenario_id", show_default=True, help="Column whose equal values stay together.")
@click.option("--stratify", metavar="COLUMN", help="Give every part its fraction of each value of this column.")
@click.option("--along", metavar="COLUMN", help="Parts follow each other in the order of this column.")
@click.option("--prefix", help="Parts are named PREFIX_PART. [default: DB]")
@click.option("--strict", is_flag=True, help="Refuse a split with scenarios of one source log in several parts.")
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
    prefix: str | None,
    strict: bool,
    replace: bool,
    allow_empty: bool,
    as_json: bool,
) -> None:
    """Part a database (or the whole lake): nobody is in two parts, and nobody is left out.

    By fractions alone, which part a scenario falls into depends on its id and the seed: the parts are the same on
    every machine, and a scenario keeps its part as the lake grows. With --by source_log, scenarios of one recording
    stay on one side; a split that tears them apart is reported before it is saved. --stratify and --along look at
    the whole, and part it exactly. --levels makes a curriculum along the column difficulty.
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
        name=prefix,
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
        raise BadParameter(f"--fractions {part} wants a number such as 0.9, found {word!r}") from error
