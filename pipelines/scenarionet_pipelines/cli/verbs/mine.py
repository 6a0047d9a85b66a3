"""``scenarionet mine``: find events and moments in scenarios, and how often they happen."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.named import show_named
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.verb import DATABASE, PARAMETERS, SNAPSHOT, LakeVerb, argument, option

if TYPE_CHECKING:
    from scenarionet_data import Lake

_MAX_ROWS = 50


class MineVerb(LakeVerb):
    """List the occurrences of an event: scenario, objects involved, start and end; and how often it happens.

    Events are SQL files in sql/events, each with its definition, source and parameters; without EVENT they are
    listed. Moments of your own are defined in a TOML file as compositions of relations and events. `scenarionet filter
    --event cut_in` selects the scenarios with the event, `scenarionet db tag --event cut_in` stores its number of
    occurrences as a user column.
    """

    examples = (
        "scenarionet mine lake cut_in",
        "scenarionet mine lake time_to_collision -p max=2.5 --database busy --limit 20",
        "scenarionet mine lake hard_braking -p ego_only=true --json",
        "scenarionet mine lake close_behind --definitions moments.toml",
        "scenarionet mine lake close_behind --definitions moments.toml --explain",
        "scenarionet mine lake",
    )
    event: str | None = argument()
    parameters: tuple[str, ...] = PARAMETERS
    database: str | None = DATABASE
    definitions: Path | None = option(
        "TOML file that defines EVENT: see the guide on moments.", type=click.Path(path_type=Path, dir_okay=False)
    )
    explain: bool = option("Print the one SELECT that runs, and do not run it.", is_flag=True)
    limit: int | None = option(
        "Print at most N occurrences. [default: 50 in a table]", type=click.IntRange(0), metavar="N"
    )
    snapshot: int | None = SNAPSHOT

    def run(self) -> None:
        from scenarionet_data import Lake
        from scenarionet_data.operations.definitions import Definitions
        from scenarionet_data.operations.moments import event
        from scenarionet_data.query.named_sql import EVENTS

        definitions = None if self.definitions is None else Definitions(self.definitions)
        if self.event is None:
            if definitions is None:
                show_named(EVENTS, "events", self.as_json)
            elif self.as_json:
                print_json({"definitions": [{"name": name, "doc": doc} for name, doc in definitions.docs.items()]})
            else:
                print_table(definitions.docs.items(), ("moment", "what it is"))
            return
        if definitions is not None and self.parameters:
            raise click.UsageError("definitions have no parameters: write them into the file, or leave out -p")
        given = EVENTS.load(self.event).parse(pairs(self.parameters, "-p")) if definitions is None else {}
        moments = event(self.event, given) if definitions is None else definitions.find(self.event)
        if self.explain:
            click.echo(moments.sql)
            return
        lake = Lake(self.lake, self.snapshot)
        if definitions is None:
            self._print(lake, lake.mine(self.event, given, self.database))
        else:
            self._print(lake, lake.moments(moments, self.database))

    def _print(self, lake: Lake, found: Any) -> None:
        """Print a table of occurrences, and how often they happen."""
        from scenarionet_data.operations.rates import poisson_rate

        hits, scenarios = len(found), found["scenario_id"].n_unique()
        view = lake if self.database is None else lake.restrict_to(self.database)
        meters, seconds = view.sql("SELECT sum(ego_distance), sum(duration) FROM metadata").row(0)
        exposures = {"per_1000_km": (meters or 0) / 1e6, "per_hour": (seconds or 0) / 3600}
        rates = {name: poisson_rate(hits, exposure) for name, exposure in exposures.items() if exposure > 0}
        if self.as_json:
            shown = found if self.limit is None else found.head(self.limit)
            listed = {name: rate._asdict() for name, rate in rates.items()}
            totals = {"event": self.event, "hits": hits, "scenarios": scenarios}
            print_json(totals | listed | {"rows": shown.to_dicts()})
            return
        shown = found.head(_MAX_ROWS if self.limit is None else self.limit)
        print_table(shown.iter_rows(), shown.columns if len(shown) else ())
        click.echo(f"{count(hits, 'occurrence')} in {count(scenarios, 'scenario')}", err=True)
        for name, rate in rates.items():
            unit = "1,000 km of the egos" if name == "per_1000_km" else "hour"
            click.echo(f"{rate.rate:,.4g} per {unit} (95 %: {rate.low:,.4g} to {rate.high:,.4g})", err=True)
