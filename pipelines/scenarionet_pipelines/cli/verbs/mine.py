"""``scenarionet mine``: find events and moments in scenarios, and how often they happen."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from scenarionet_pipelines.cli.named import show_named
from scenarionet_pipelines.cli.output import count, print_json, print_table
from scenarionet_pipelines.cli.parameters import pairs
from scenarionet_pipelines.cli.verb import (
    DATABASE,
    ORDER_BY,
    PARAMETERS,
    SNAPSHOT,
    LakeVerb,
    Progressing,
    argument,
    option,
)

if TYPE_CHECKING:
    import polars as pl

    from scenarionet_data import Lake

_MAX_ROWS = 50


class MineVerb(LakeVerb, Progressing):
    """List the occurrences of an event: scenario, objects involved, start and end; and how often it happens.

    Events are SQL files in sql/events, each with its definition, source and parameters; without EVENT they are
    listed. Relations of sql/relations are mined by their names, too. Moments of your own are defined in a TOML file as
    compositions of relations and events. `scenarionet filter --event cut_in` selects the scenarios with the event,
    `scenarionet db tag --event cut_in` stores its number of occurrences as a user column.

    --name keeps the moments of one or more definitions in the lake, as rows of the view `moments`. Only scenarios that
    a definition was not mined over yet are read, and a definition that has changed is mined again by itself; without
    EVENT, what was kept under the name before is mined over new scenarios.
    """

    examples = (
        "scenarionet mine lake cut_in",
        "scenarionet mine lake time_to_collision -p max=2.5 --database busy --limit 20",
        "scenarionet mine lake time_to_collision --order-by value --limit 20",
        "scenarionet mine lake hard_braking -p ego_only=true --json",
        "scenarionet mine lake close_behind --definitions moments.toml",
        "scenarionet mine lake close_behind --definitions moments.toml --explain",
        "scenarionet mine lake cut_in near_miss following --name risky",
        "scenarionet mine lake --name risky",
        "scenarionet mine lake",
    )
    events: tuple[str, ...] = argument("[EVENT]...", required=False)
    parameters: tuple[str, ...] = PARAMETERS
    database: str | None = DATABASE
    definitions: Path | None = option(
        "TOML file that defines EVENT: see the guide on moments.", type=click.Path(path_type=Path, dir_okay=False)
    )
    name: str | None = option("Keep the moments in the lake under this name.", metavar="NAME")
    explain: bool = option("Print the one SELECT that runs, and do not run it.", is_flag=True)
    order_by: str | None = ORDER_BY
    limit: int | None = option(
        "Print at most N occurrences. [default: 50 in a table]", type=click.IntRange(0), metavar="N"
    )
    snapshot: int | None = SNAPSHOT

    def run(self) -> None:
        from scenarionet_data import Lake
        from scenarionet_data.operations.definitions import Definitions
        from scenarionet_data.operations.mining import Defined, defined, keep_moments, kept_definitions
        from scenarionet_data.query.named_sql import EVENTS

        definitions = None if self.definitions is None else Definitions(self.definitions)
        if self.name is None and not self.events:
            if definitions is None:
                show_named(EVENTS, "events", self.as_json)
            elif self.as_json:
                print_json({"definitions": [{"name": name, "doc": doc} for name, doc in definitions.docs.items()]})
            else:
                print_table(definitions.docs.items(), ("moment", "what it is"))
            return
        if self.parameters and (definitions is not None or len(self.events) != 1):
            raise click.UsageError(
                "-p is for one event or relation: write parameters of others into a file of definitions"
            )
        if self.name is None and len(self.events) > 1:
            raise click.UsageError(f"mine {' and '.join(self.events)} one by one, or keep them with --name NAME")
        given = pairs(self.parameters, "-p")
        found = {
            event: defined(event, given)
            if definitions is None
            else Defined(definitions.find(event), doc=definitions.docs[event])
            for event in self.events
        }
        if self.explain:
            for each in found.values():
                click.echo(each.moments.sql)
            return
        lake = Lake(self.lake, self.snapshot)
        if self.name is not None:
            with self.progress(f"mine {self.name}", "scenario") as progress:
                wanted = found or kept_definitions(lake, self.name)
                mined = keep_moments(lake, self.name, wanted, self.database, progress.update)
            if self.as_json:
                print_json({"name": self.name, "definitions": [asdict(each) for each in mined]})
                return
            rows = [(each.definition, each.version, each.scenarios, each.moments) for each in mined]
            print_table(rows, ("definition", "version", "scenarios mined", "moments found"))
            click.echo(f"`SELECT * FROM moments WHERE name = '{self.name}'` has them all", err=True)
            return
        ((event, each),) = found.items()
        if event in EVENTS.names():
            self._print(lake, lake.mine(event, each.parameters, self.database))
        else:
            self._print(lake, lake.moments(each.moments, self.database))

    def _print(self, lake: Lake, found: Any) -> None:
        """Print a table of occurrences, and how often they happen."""
        from scenarionet_data.operations.rates import poisson_rate

        hits, scenarios = len(found), found["scenario_id"].n_unique()
        found = found if self.order_by is None else in_order(lake, found, self.order_by)
        view = lake if self.database is None else lake.restrict_to(self.database)
        meters, seconds = view.sql("SELECT sum(ego_distance), sum(duration) FROM metadata").row(0)
        exposures = {"per_1000_km": (meters or 0) / 1e6, "per_hour": (seconds or 0) / 3600}
        rates = {name: poisson_rate(hits, exposure) for name, exposure in exposures.items() if exposure > 0}
        if self.as_json:
            shown = found if self.limit is None else found.head(self.limit)
            listed = {name: rate._asdict() for name, rate in rates.items()}
            totals = {"event": self.events[0], "hits": hits, "scenarios": scenarios}
            print_json(totals | listed | {"rows": shown.to_dicts()})
            return
        shown = found.head(_MAX_ROWS if self.limit is None else self.limit)
        print_table(shown.iter_rows(), shown.columns if len(shown) else ())
        click.echo(f"{count(hits, 'occurrence')} in {count(scenarios, 'scenario')}", err=True)
        for name, rate in rates.items():
            unit = "1,000 km of the egos" if name == "per_1000_km" else "hour"
            click.echo(f"{rate.rate:,.4g} per {unit} (95 %: {rate.low:,.4g} to {rate.high:,.4g})", err=True)


def in_order(lake: Lake, found: pl.DataFrame, order_by: str) -> pl.DataFrame:
    """Return occurrences ordered by an expression over their columns and those of ``metadata``."""
    import polars

    from scenarionet_data.operations.filter import IN_ORDER, ranked

    numbered = found.with_row_index(IN_ORDER).to_arrow()
    sql = f"SELECT numbered.* EXCLUDE ({IN_ORDER}) FROM numbered JOIN metadata USING (scenario_id) ORDER BY "
    return polars.DataFrame(lake.engine.arrow(sql + ranked(order_by), tables={"numbered": numbered}))
