"""``scenarionet filter``: save the scenarios that satisfy conditions as a database."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli.databases import described
from scenarionet_pipelines.cli.verb import ALLOW_EMPTY, DATABASE, EGO, LIMIT, MARGIN, ORDER_BY, LakeVerb, Saving, option

if TYPE_CHECKING:
    from scenarionet_data import Lake


class FilterVerb(LakeVerb, Saving):
    """Save the scenarios that satisfy all conditions as a database.

    A database is a list of scenario ids with the query that selected them; no scenario is copied. `scenarionet
    info filters` lists the named filters, `scenarionet info filters --columns` the columns for --where, and
    `scenarionet mine LAKE` the events. An id may also be the scenario's id in its source dataset; unknown ids are an
    error.

    --moments NAME saves the moments that `scenarionet mine --name NAME` has kept instead: each is cut out as a scenario
    of its own, now when it begins, so that every verb works with its window and roles. --where and --order-by know the
    columns of moments, too.
    """

    examples = (
        'scenarionet filter lake --where "ego_distance > 10 AND num_objects > 200" --name busy',
        "scenarionet filter lake --filter no_overpass --filter object_type:type=cyclist,min=3 --name cyclists",
        "scenarionet filter lake --database busy --where has_intersection --name crossings --replace",
        "scenarionet filter lake --where has_intersection --event cut_in:max_gap=20 --name cut_ins",
        "scenarionet filter lake --order-by 'difficulty DESC' --limit 20 --name hardest",
        "scenarionet filter lake --ids chosen.txt --name chosen",
        "scenarionet filter lake --moments risky --ego actor --order-by value --limit 20 --name closest",
    )
    where: str = option("SQL condition over the columns of metadata.", default="true", metavar="EXPR")
    filters: tuple[str, ...] = option("Apply a named filter; repeatable.", "--filter", metavar="NAME[:KEY=VALUE,...]")
    events: tuple[str, ...] = option("Require an event; repeatable.", "--event", metavar="NAME[:KEY=VALUE,...]")
    ids: tuple[str, ...] = option("Select a scenario by its id; repeatable.", "--id", metavar="ID")
    file: str | None = option("Select the scenarios listed in a file, one id per line.", "--ids")
    database: str | None = DATABASE
    order_by: str | None = ORDER_BY
    limit: int | None = LIMIT
    moments: str | None = option("Select moments that are kept under this name.", metavar="NAME")
    ego: str = EGO
    margin: float = MARGIN
    allow_empty: bool = ALLOW_EMPTY

    def run(self) -> bool:
        lake = self.open()
        if self.moments is not None:
            return self.save_moments(lake, self.moments)
        listed = [*self.ids, *(Path(self.file).read_text("utf-8").split() if self.file else ())]
        chosen = self.given(lake.filter) | {"ids": listed if self.ids or self.file else None}
        self.say(*described(lake.filter(**chosen)))
        return True

    def save_moments(self, lake: Lake, moments: str) -> bool:
        """Save kept moments; return whether all that were chosen could be cut out."""
        from scenarionet_data.variations import MomentChoice, cut_moments

        if self.filters or self.events or self.ids or self.file:
            raise click.UsageError("--moments goes with --where, --order-by, --limit and --database")
        made = cut_moments(
            lake, moments, MomentChoice(**self.given(MomentChoice)), name=self.name, replace=self.replace
        )
        content, text = described(made.database)
        left_out = made.wanted - len(made.database)
        self.say(content | {"wanted": made.wanted, "left_out": left_out}, text)
        why = f"scenarionet sql {self.lake} \"SELECT scenario_id, message FROM quarantine WHERE dataset = 'moment'\""
        self.complain([f"{left_out} of {made.wanted} moments could not be cut out: {why}"] if left_out else [])
        return not left_out
