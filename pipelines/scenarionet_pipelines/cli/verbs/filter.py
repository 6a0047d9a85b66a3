"""``scenarionet filter``: save the scenarios that satisfy conditions as a database."""

from __future__ import annotations

from pathlib import Path

import click

from scenarionet_pipelines.cli.databases import described
from scenarionet_pipelines.cli.verb import ALLOW_EMPTY, DATABASE, LakeVerb, Saving, option


class FilterVerb(LakeVerb, Saving):
    """Save the scenarios that satisfy all conditions as a database.

    A database is a list of scenario ids with the query that selected them; no scenario is copied. `scenarionet
    info filters` lists the named filters, `scenarionet info filters --columns` the columns for --where, and
    `scenarionet mine LAKE` the events. An id may also be the scenario's id in its source dataset; unknown ids are an
    error.
    """

    examples = (
        'scenarionet filter lake --where "ego_distance > 10 AND num_objects > 200" --name busy',
        "scenarionet filter lake --filter no_overpass --filter object_type:type=cyclist,min=3 --name cyclists",
        "scenarionet filter lake --database busy --where has_intersection --name crossings --replace",
        "scenarionet filter lake --where has_intersection --event cut_in:max_gap=20 --name cut_ins",
        "scenarionet filter lake --order-by 'difficulty DESC' --limit 20 --name hardest",
        "scenarionet filter lake --ids chosen.txt --name chosen",
    )
    where: str = option("SQL condition over the columns of metadata.", default="true", metavar="EXPR")
    filters: tuple[str, ...] = option("Apply a named filter; repeatable.", "--filter", metavar="NAME[:KEY=VALUE,...]")
    events: tuple[str, ...] = option("Require an event; repeatable.", "--event", metavar="NAME[:KEY=VALUE,...]")
    ids: tuple[str, ...] = option("Select a scenario by its id; repeatable.", "--id", metavar="ID")
    file: str | None = option("Select the scenarios listed in a file, one id per line.", "--ids")
    database: str | None = DATABASE
    order_by: str | None = option(
        "Order the scenarios by this, as 'difficulty DESC'; unknown values come last.", metavar="EXPR"
    )
    limit: int | None = option("Keep the first N scenarios.", type=click.IntRange(1), metavar="N")
    allow_empty: bool = ALLOW_EMPTY

    def run(self) -> None:
        lake = self.open()
        listed = [*self.ids, *(Path(self.file).read_text("utf-8").split() if self.file else ())]
        chosen = self.given(lake.filter) | {"ids": listed if self.ids or self.file else None}
        self.say(*described(lake.filter(**chosen)))
