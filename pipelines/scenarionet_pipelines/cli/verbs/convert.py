"""``scenarionet convert``: convert recordings into a lake."""

from __future__ import annotations

import sys
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any

import click

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.conversion_report import passed_over_rows, report_content, stale_row
from scenarionet_pipelines.cli.interrupt import keeping, stop
from scenarionet_pipelines.cli.output import count, duration, table
from scenarionet_pipelines.cli.parameters import pairs, seconds
from scenarionet_pipelines.cli.verb import Distributed, argument, option

if TYPE_CHECKING:
    from collections.abc import Iterable

    from scenarionet_data.conversion import ConversionPlan
    from scenarionet_data.ingest.shard import Shard

_MAX_LISTED = 20


class ConvertVerb(Distributed):
    """Convert recordings into a lake.

    DATASET is a converter or a class of your own, module:Class. `scenarionet info converters` lists the converters and
    what each expects as RAW, usually the folder of the recordings or its URL in an object store. LAKE is a folder or
    a URL; it is created if it does not exist.

    Recordings already in the lake are skipped: run the same command again after an interruption, or when
    recordings have been added.

    Rows and map features that cannot be used (NaN, a size of 0, a place that no road user can reach, ...) are dropped
    and reported. Records that cannot be read, or have too many such rows (-p max_bad_rows=0.2), and scenarios that
    violate a hard rule of `scenarionet maintain check` are quarantined with the reason; the conversion continues and
    the exit code is 1. --no-check accepts scenarios that violate such a rule, unless they cannot be stored.

    --where selects inputs before they are converted, with shell patterns: by file, by the name of the shard, and by
    properties of the dataset such as location, log, date and tags of nuPlan (`scenarionet info converters nuplan` lists
    them). --dry-run converts a few inputs into a temporary folder to estimate the duration.

    --cluster runs on a Dask cluster: `local` starts one on this machine, tcp://HOST:PORT connects to a running
    scheduler, other names and files are profiles (see docs/guides/cluster.md).

    --watch scans for new recordings repeatedly and converts each once it is unchanged between two scans.
    """

    examples = (
        "scenarionet convert waymo raw/waymo/training lake",
        "scenarionet convert pg 0:200 lake --split train --workers 2",
        "scenarionet convert waymo raw/waymo/validation lake --limit 10",
        "scenarionet convert scenarionet pickles/nuscenes lake --dry-run",
        "scenarionet convert nuplan raw/nuplan lake --where 'location=us-nv-*' --files 0:10",
        "scenarionet convert waymo raw/waymo/training lake --cluster tcp://10.0.0.5:8786",
        "scenarionet convert nuplan raw/nuplan lake --watch --every 5min",
        "scenarionet convert nuplan s3://bucket/nuplan s3://bucket/lake",
    )
    dataset: str = argument()
    raw: str = argument()
    lake: str = argument()
    split: str | None = option(
        "Split, named as in the lake (train, val, test, mini) or as in the dataset's folders (training, "
        "validation_interactive, test_obs, ...); `scenarionet info converters DATASET` lists them. [default: inferred "
        "from the folder's name]",
        metavar="NAME",
    )
    version: str | None = option("Release of the dataset. [default: the converter's]")
    limit: int | None = option("Stop after N scenarios, for a quick look.", type=click.IntRange(1), metavar="N")
    files: str | None = option("Only this range of raw inputs, counted from 0: 0:10, or 10:.", metavar="START:END")
    where: tuple[str, ...] = option("Only matching inputs: file, name, log, ...; repeatable.", metavar="KEY=PATTERN")
    replace: bool = option("Replace shards whose input or options have changed.")
    reconvert_stale: bool = option("Replace shards written by another version of the converter; asks first.")
    yes: bool = option("Do not ask for confirmation.")
    is_watching: bool = option("Keep converting new recordings as they arrive, until Ctrl-C.", "--watch")
    every: str = option(
        "With --watch: interval between scans; a file has to be unchanged for as long.", default="30s", metavar="TIME"
    )
    no_check: bool = option("Do not apply the rules of `scenarionet maintain check`.")
    dry_run: bool = option("Print what would be converted and how long it would take.")
    options: tuple[str, ...] = option("Option of the converter; repeatable.", "-p", "--parameter", metavar="NAME=VALUE")

    def run(self) -> bool:
        from scenarionet_data.conversion import InputSelection, convert, parse_slice, plan_conversion
        from scenarionet_pipelines.cli import converter

        what: dict[str, Any] = self.given(plan_conversion) | {
            "options": converter.parse_options(converter.find(self.dataset), self.options),
            "selection": InputSelection(pairs(self.where, "--where"), parse_slice(self.files or ":")),
        }
        if self.limit and (self.cluster or self.is_watching):
            raise BadParameter("--limit converts one shard at a time: leave out --cluster and --watch")
        if self.dry_run:
            self.show_plan(plan_conversion(**what))
            return True
        if self.reconvert_stale and not self.yes:
            self.confirm(plan_conversion(**what))
        what |= {"workers": self.num_workers, "check": not self.no_check}
        with self.execution() as execution:
            if self.is_watching:
                return self.watch(what | {"executor": execution.executor})
            with self.progress(f"convert {self.dataset}", "shard") as progress:

                def kept() -> str:
                    shards = f"{progress.done:,} of {count(progress.total, 'shard')}"
                    done = f"{shards} ({count(progress.scenarios, 'scenario')}) converted and kept in {self.lake}"
                    return done if progress.done else "no shard was finished"

                with keeping(kept):
                    what |= {"limit": self.limit, "executor": execution.executor}
                    report = convert(**what, on_progress=progress.update)
        self.say(*report_content(report, self.lake))
        return report.is_clean

    def watch(self, what: dict[str, Any]) -> bool:
        """Convert new recordings until a signal; return whether every report was clean."""
        from scenarionet_data.conversion import convert, watch

        every = seconds(self.every, "--every")
        click.echo(f"watching {self.raw} every {duration(every)}; stop with Ctrl-C", err=True)
        is_clean, selection = True, what.pop("selection")
        try:
            job = partial(convert, **what)
            for report in watch(job, every=every, selection=selection):
                self.say(*report_content(report, self.lake))
                is_clean = is_clean and report.is_clean
        except KeyboardInterrupt:
            stop(f"stopped watching {self.raw}; finished shards are kept in {self.lake}")
        return is_clean

    def confirm(self, plan: ConversionPlan) -> None:
        """List the shards that would be converted again and ask for confirmation."""
        if not plan.replaced:
            return
        shards = shard_names(plan.replacing)
        again = f"{count(len(shards), 'shard')} written by another version of the converter"
        click.echo(f"would convert again {again}:", err=True)
        for name in shards[:_MAX_LISTED]:
            click.echo(f"  {name}", err=True)
        if len(shards) > _MAX_LISTED:
            click.echo(f"  and {len(shards) - _MAX_LISTED:,} more; --dry-run --json lists all", err=True)
        if not is_interactive():
            raise BadParameter(
                "standard input is not a terminal, cannot ask for confirmation: add --yes, or leave out "
                "--reconvert-stale"
            )
        click.confirm("continue?", abort=True, err=True)

    def show_plan(self, plan: ConversionPlan) -> None:
        """Print what would be converted, and how long it would take."""
        from scenarionet_data.conversion import measure_pace

        num_inputs = sum(len(shard.items) for shard in plan.shards)
        pace = measure_pace(self.dataset, plan.shards)
        processes = min(self.num_workers, len(plan.shards))
        time = pace.duration(num_inputs, processes) if pace else None
        facts: dict[str, Any] = {"shards": shard_names(plan.shards), "inputs": num_inputs, "seconds": time}
        facts |= {"skipped": plan.num_skipped, "replaced": len(plan.replaced), "stale": plan.num_stale}
        facts |= {"passed_over": [asdict(each) for each in plan.passed_over]}
        rows = [
            ("would convert", f"{count(len(plan.shards), 'shard')} with {count(num_inputs, 'raw input')}"),
            ("would skip", f"{count(plan.num_skipped, 'shard')} already in the lake"),
            ("would replace", count(len(plan.replaced), "shard")),
        ]
        if pace and time is not None:
            measured = f"measured on {count(pace.inputs, 'input')} with {count(pace.scenarios, 'scenario')}"
            rows += [("would take", f"about {duration(time)} with {count(processes, 'worker')}, {measured}")]
        self.say(facts, table(rows + stale_row(plan.num_stale) + passed_over_rows(plan.passed_over)))


def is_interactive() -> bool:
    """Whether standard input is a terminal."""
    return sys.stdin.isatty()


def shard_names(shards: Iterable[Shard]) -> list[str]:
    """Return the names of shards in a lake."""
    return [f"{shard.dataset}/{shard.version}/{shard.split}/{shard.name}" for shard in shards]
