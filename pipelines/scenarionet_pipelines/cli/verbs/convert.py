"""``scenarionet convert``: raw recordings into a lake."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import click

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.conversion_report import print_report, stale_row
from scenarionet_pipelines.cli.execution import executor_from_options
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.interrupt import Interrupted
from scenarionet_pipelines.cli.output import count, duration, print_json, print_table
from scenarionet_pipelines.cli.parameters import (
    cluster_option,
    json_option,
    lake_argument,
    pairs,
    quiet_option,
    seconds,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from scenarionet_data.conversion import Plan, Report

_LISTED = 20


@verb(
    "convert",
    "scenarionet convert waymo raw/waymo/training lake",
    "scenarionet convert pg 0:200 lake --split train --workers 2",
    "scenarionet convert waymo raw/waymo/validation lake --limit 10",
    "scenarionet convert scenarionet pickles/nuscenes lake --dry-run",
    "scenarionet convert nuplan raw/nuplan lake --where 'location=us-nv-*' --files 0:10",
    "scenarionet convert waymo raw/waymo/training lake --cluster tcp://10.0.0.5:8786",
    "scenarionet convert nuplan raw/nuplan lake --watch --every 5min",
    "scenarionet convert nuplan s3://bucket/nuplan s3://bucket/lake",
)
@click.argument("dataset")
@click.argument("raw")
@lake_argument
@click.option("--split", help="The owner's split: train, val, ... [default: guessed from the folder's name]")
@click.option("--version", help="The dataset's release. [default: the converter's]")
@click.option("--workers", type=click.IntRange(1), help="Processes. [default: one a core, 2 GB of memory each]")
@cluster_option
@click.option("--limit", type=click.IntRange(1), help="Stop after that many scenarios, for a quick look.")
@click.option("--files", metavar="START:END", help="Only these of the raw inputs, counted from 0: 0:10, or 10:.")
@click.option("--where", multiple=True, metavar="KEY=PATTERN", help="Only what is known to be so: file, name, log, ...")
@click.option("--replace", is_flag=True, help="Replace what was converted with other options or has changed.")
@click.option("--stale", is_flag=True, help="Replace what another version of the converter wrote; asks first.")
@click.option("--yes", is_flag=True, help="Do not ask.")
@click.option("--watch", "is_watching", is_flag=True, help="Go on and convert what arrives, until Ctrl-C.")
@click.option(
    "--every", default="30s", metavar="TIME", help="How often to look, and how long a file has to stand still."
)
@click.option("--no-check", is_flag=True, help="Take scenarios that break a hard rule of `scenarionet check`, too.")
@click.option("--dry-run", is_flag=True, help="Say what there is to do, and about how long it takes.")
@click.option("-O", "options", multiple=True, metavar="KEY=VALUE", help="An option of the converter; repeatable.")
@json_option
@quiet_option
def command(
    dataset: str,
    raw: str,
    lake: str,
    split: str | None,
    version: str | None,
    workers: int | None,
    cluster: str | None,
    limit: int | None,
    files: str | None,
    where: tuple[str, ...],
    replace: bool,
    stale: bool,
    yes: bool,
    is_watching: bool,
    every: str,
    no_check: bool,
    dry_run: bool,
    options: tuple[str, ...],
    as_json: bool,
    quiet: bool,
) -> None:
    """Convert recordings into a lake.

    DATASET is a converter (`scenarionet converters` lists them, and what RAW has to be: mostly the folder with
    the recordings, or its URL in an object store), or a class of your own as module:Class. LAKE is a folder or a URL,
    made when it is not there.

    What is converted once is never converted again: run the same command after an interruption, or when
    recordings were added, and it goes on from there.

    A record that cannot be read, and a scenario that breaks a hard rule of `scenarionet check`, go to quarantine
    with the reason, and the run goes on; the exit code is 1 then.

    --where chooses by what is known before anything is converted, with shell patterns: the file of an input, the
    name of its shard, and what the dataset tells, for example the location, log, date and tags of nuPlan's logs
    (`scenarionet converters nuplan` lists them). --dry-run converts a few inputs into a folder that it throws away,
    to say how long the rest will take.

    --cluster lets a Dask cluster convert: `local` starts one on this machine, an address is that of a scheduler that
    runs already, other names and files are profiles (docs/guides/cluster.md).

    --watch looks for new recordings again and again, and converts each as soon as it has not changed between two looks.
    """
    from scenarionet_data.conversion import Selection, parse_slice, plan_conversion
    from scenarionet_pipelines.cli import converter
    from scenarionet_pipelines.machine import default_workers

    chosen = converter.parse_options(converter.find(dataset), options)
    common: dict[str, Any] = {
        "split": split,
        "version": version,
        "options": chosen,
        "selection": Selection(pairs(where, "--where"), parse_slice(files or ":")),
        "replace_old": replace,
        "stale": stale,
    }
    if limit and (cluster or is_watching):
        raise BadParameter("--limit is a quick look, one shard after the other: leave out --cluster and --watch")
    if dry_run:
        _print_plan(dataset, plan_conversion(dataset, raw, lake, **common), workers or default_workers(), as_json)
        return
    if stale and not yes:
        _ask_about(plan_conversion(dataset, raw, lake, **common))
    how = {"workers": workers or default_workers(), "is_checked": not no_check, **common}
    with executor_from_options(cluster, workers, quiet=quiet) as execution:
        if is_watching:
            is_clean = _watch(
                dataset, raw, lake, seconds(every, "--every"), as_json, executor=execution.executor, **how
            )
        else:
            report = _convert(dataset, raw, lake, quiet, executor=execution.executor, limit=limit, **how)
            print_report(report, lake, as_json)
            is_clean = report.is_clean
    click.get_current_context().exit(0 if is_clean else 1)


def _convert(dataset: str, raw: str, lake: str, quiet: bool, **how: Any) -> Report:
    from scenarionet_data.conversion import convert

    with ProgressDisplay(f"convert {dataset}", "shard", is_quiet=quiet) as progress:
        try:
            return convert(dataset, raw, lake, on_progress=progress.update, **how)
        except KeyboardInterrupt as error:
            raise Interrupted(_kept(progress, lake)) from error


def _watch(dataset: str, raw: str, lake: str, every: float, as_json: bool, **how: Any) -> bool:
    """Convert what arrives until Ctrl-C; returns whether all of it was clean."""
    from scenarionet_data.conversion import watch

    click.echo(f"watching {raw}: a look every {duration(every)}, until Ctrl-C", err=True)
    is_clean = True
    try:
        for report in watch(dataset, raw, lake, every=every, **how):
            print_report(report, lake, as_json)
            is_clean = is_clean and report.is_clean
    except KeyboardInterrupt:
        click.echo(f"stopped watching {raw}; what is finished is kept in {lake}", err=True)
    return is_clean


def _ask_about(plan: Plan) -> None:
    """List what would be converted again, and go on only if that is wanted."""
    if not plan.replaced:
        return
    anew = [f"{shard.dataset}/{shard.version}/{shard.split}/{shard.name}" for shard in plan.anew]
    click.echo(
        f"would convert again {count(len(anew), 'shard')} that another version of the converter wrote:", err=True
    )
    for name in anew[:_LISTED]:
        click.echo(f"  {name}", err=True)
    if len(anew) > _LISTED:
        click.echo(f"  and {len(anew) - _LISTED:,} more; --dry-run --json names all", err=True)
    if not _is_there():
        raise BadParameter("nobody is there to be asked: add --yes to convert them again, or leave out --stale")
    click.confirm("go on?", abort=True, err=True)


def _is_there() -> bool:
    """Whether somebody can be asked."""
    return sys.stdin.isatty()


def _kept(progress: ProgressDisplay, lake: str) -> str:
    done = f"{progress.done:,} of {count(progress.total, 'shard')} ({count(progress.scenarios, 'scenario')})"
    kept = f"{done} converted and kept in {lake}" if progress.done else "no shard was finished"
    return f"{kept}; the same command goes on from there"


def _print_plan(dataset: str, plan: Plan, workers: int, as_json: bool) -> None:
    from scenarionet_data.conversion import measure_pace

    num_inputs = sum(len(shard.items) for shard in plan.shards)
    pace = measure_pace(dataset, plan.shards)
    processes = min(workers, len(plan.shards))
    seconds = pace.duration(num_inputs, processes) if pace else None
    if as_json:
        facts = {"skipped": plan.num_skipped, "replaced": len(plan.replaced), "stale": plan.num_stale}
        names = [f"{shard.dataset}/{shard.version}/{shard.split}/{shard.name}" for shard in plan.shards]
        print_json({"shards": names, "inputs": num_inputs, "seconds": seconds, **facts})
        return
    rows = [
        ("would convert", f"{count(len(plan.shards), 'shard')} with {count(num_inputs, 'raw input')}"),
        ("would skip", f"{count(plan.num_skipped, 'shard')} that the lake has already"),
        ("would replace", count(len(plan.replaced), "shard")),
    ]
    if pace and seconds is not None:
        measured = f"as {count(pace.inputs, 'input')} with {count(pace.scenarios, 'scenario')} took"
        rows += [("would take", f"about {duration(seconds)} with {count(processes, 'worker')}, {measured}")]
    print_table(rows + stale_row(plan.num_stale))
