"""``scenarionet mine``: find events in scenarios."""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.named import show_named
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.verb import DATABASE, PARAMETERS, SNAPSHOT, LakeVerb, argument, option

_MAX_ROWS = 50


class MineVerb(LakeVerb):
    """List the occurrences of an event: scenario, objects involved, start and end.

    Events are SQL files in sql/events, each with its definition, source and parameters; without EVENT they are
    listed. `scenarionet filter --event cut_in` selects the scenarios with the event, `scenarionet db tag --event
    cut_in` stores its number of occurrences as a user column.
    """

    examples = (
        "scenarionet mine lake cut_in",
        "scenarionet mine lake time_to_collision -p max=2.5 --database busy --limit 20",
        "scenarionet mine lake hard_braking -p ego_only=true --json",
        "scenarionet mine lake",
    )
    event: str | None = argument()
    parameters: tuple[str, ...] = PARAMETERS
    database: str | None = DATABASE
    limit: int | None = option(
        "Print at most N occurrences. [default: 50 in a table]", type=click.IntRange(0), metavar="N"
    )
    snapshot: int | None = SNAPSHOT

    def run(self) -> None:
        from scenarionet_data import Lake
        from scenarionet_data.query.named_sql import EVENTS

        if self.event is None:
            show_named(EVENTS, "events", self.as_json)
            return
        found = Lake(self.lake, self.snapshot).mine(
            self.event, EVENTS.load(self.event).parse(pairs(self.parameters, "-p")), self.database
        )
        hits, scenarios = len(found), found["scenario_id"].n_unique()
        if self.as_json:
            shown = found if self.limit is None else found.head(self.limit)
            print_json({"event": self.event, "hits": hits, "scenarios": scenarios, "rows": shown.to_dicts()})
            return
        shown = found.head(_MAX_ROWS if self.limit is None else self.limit)
        print_table(shown.iter_rows(), shown.columns if len(shown) else ())
        click.echo(f"{count(hits, 'occurrence')} in {count(scenarios, 'scenario')}", err=True)
