"""``scenarionet convert``: convert recordings into a lake."""

from __future__ import annotations

import importlib
import sys
from dataclasses import asdict
from functools import partial
from importlib.abc import MetaPathFinder
from typing import TYPE_CHECKING, Any

import click

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.conversion_report import passed_over_rows, print_report, stale_row
from scenarionet_pipelines.cli.execution import executor_from_options
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.interrupt import Interrupted, stop
from scenarionet_pipelines.cli.output import count, duration, print_json, print_table
from scenarionet_pipelines.cli.parameters import (
    cluster_option,
    json_option,
    lake_argument,
    pairs,
    quiet_option,
    seconds,
    workers_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from scenarionet_data.conversion import ConversionPlan, ConversionReport

_MAX_LISTED = 20


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
@click.option(
    "--split",
    metavar="NAME",
    help="Split, named as in the lake (train, val, test, mini) or as in the dataset's folders (training, "
    "validation_interactive, test_obs, ...); `scenarionet info converters DATASET` lists them. [default: inferred from "
    "the folder's name]",
)
@click.option("--version", help="Release of the dataset. [default: the converter's]")
@workers_option
@cluster_option
@click.option("--limit", type=click.IntRange(1), metavar="N", help="Stop after N scenarios, for a quick look.")
@click.option("--files", metavar="START:END", help="Only this range of raw inputs, counted from 0: 0:10, or 10:.")
@click.option(
    "--where", multiple=True, metavar="KEY=PATTERN", help="Only matching inputs: file, name, log, ...; repeatable."
)
@click.option("--replace", is_flag=True, help="Replace shards whose input or options have changed.")
@click.option(
    "--reconvert-stale", is_flag=True, help="Replace shards written by another version of the converter; asks first."
)
@click.option("--yes", is_flag=True, help="Do not ask for confirmation.")
@click.option(
    "--watch", "is_watching", is_flag=True, help="Keep converting new recordings as they arrive, until Ctrl-C."
)
@click.option(
    "--every", default="30s", metavar="TIME", show_default=True,
    help="With --watch: interval between scans; a file has to be unchanged for as long.",
)  # fmt: skip
@click.option("--no-check", is_flag=True, help="Do not apply the rules of `scenarionet maintain check`.")
@click.option("--dry-run", is_flag=True, help="Print what would be converted and how long it would take.")
@click.option(
    "-p", "--parameter", "options", multiple=True, metavar="NAME=VALUE", help="Option of the converter; repeatable."
)
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
    reconvert_stale: bool,
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
    _leave_pandas_out()
    from scenarionet_data.conversion import InputSelection, parse_slice, plan_conversion
    from scenarionet_pipelines.cli import converter
    from scenarionet_pipelines.machine import default_workers

    chosen = converter.parse_options(converter.find(dataset), options)
    common: dict[str, Any] = {
        "split": split,
        "version": version,
        "options": chosen,
        "selection": InputSelection(pairs(where, "--where"), parse_slice(files or ":")),
        "replace": replace,
        "reconvert_stale": reconvert_stale,
    }
    if limit and (cluster or is_watching):
        raise BadParameter("--limit converts one shard at a time: leave out --cluster and --watch")
    if dry_run:
        _print_plan(dataset, plan_conversion(dataset, raw, lake, **common), workers or default_workers(), as_json)
        return
    if reconvert_stale and not yes:
        _confirm(plan_conversion(dataset, raw, lake, **common))
    how = {"workers": workers or default_workers(), "check": not no_check, **common}
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


def _convert(dataset: str, raw: str, lake: str, quiet: bool, **how: Any) -> ConversionReport:
    from scenarionet_data.conversion import convert

    with ProgressDisplay(f"convert {dataset}", "shard", is_quiet=quiet) as progress:
        try:
            return convert(dataset, raw, lake, on_progress=progress.update, **how)
        except KeyboardInterrupt as error:
            raise Interrupted(_kept(progress, lake)) from error


class _WithoutPandas(MetaPathFinder):
    """Imports do not find pandas."""

    def find_spec(self, fullname: str, *_: object) -> None:
        """Find nothing; raise for pandas."""
        if fullname == "pandas":
            raise ModuleNotFoundError(fullname)


def _leave_pandas_out() -> None:
    """Let Arrow look for pandas while there is none to be found: it imports it, in 0.3 s, to recognise its objects."""
    finder = _WithoutPandas()
    sys.meta_path.insert(0, finder)
    try:
        importlib.import_module("pyarrow").array([])
    finally:
        sys.meta_path.remove(finder)


def _watch(dataset: str, raw: str, lake: str, every: float, as_json: bool, **how: Any) -> bool:
    """Convert new recordings until a signal; return whether every report was clean."""
    from scenarionet_data.conversion import convert, watch

    click.echo(f"watching {raw} every {duration(every)}; stop with Ctrl-C", err=True)
    is_clean = True
    try:
        selection = how.pop("selection")
        for report in watch(partial(convert, dataset, raw, lake, **how), every=every, selection=selection):
            print_report(report, lake, as_json)
            is_clean = is_clean and report.is_clean
    except KeyboardInterrupt:
        stop(f"stopped watching {raw}; finished shards are kept in {lake}")
    return is_clean


def _confirm(plan: ConversionPlan) -> None:
    """List the shards that would be converted again and ask for confirmation."""
    if not plan.replaced:
        return
    shards = [f"{shard.dataset}/{shard.version}/{shard.split}/{shard.name}" for shard in plan.replacing]
    click.echo(
        f"would convert again {count(len(shards), 'shard')} written by another version of the converter:", err=True
    )
    for name in shards[:_MAX_LISTED]:
        click.echo(f"  {name}", err=True)
    if len(shards) > _MAX_LISTED:
        click.echo(f"  and {len(shards) - _MAX_LISTED:,} more; --dry-run --json lists all", err=True)
    if not _is_interactive():
        raise BadParameter(
            "standard input is not a terminal, cannot ask for confirmation: add --yes, or leave out --reconvert-stale"
        )
    click.confirm("continue?", abort=True, err=True)


def _is_interactive() -> bool:
    """Whether standard input is a terminal."""
    return sys.stdin.isatty()


def _kept(progress: ProgressDisplay, lake: str) -> str:
    done = f"{progress.done:,} of {count(progress.total, 'shard')} ({count(progress.scenarios, 'scenario')})"
    kept = f"{done} converted and kept in {lake}" if progress.done else "no shard was finished"
    return f"{kept}; run the same command again to continue"


def _print_plan(dataset: str, plan: ConversionPlan, workers: int, as_json: bool) -> None:
    from scenarionet_data.conversion import measure_pace

    num_inputs = sum(len(shard.items) for shard in plan.shards)
    pace = measure_pace(dataset, plan.shards)
    processes = min(workers, len(plan.shards))
    seconds = pace.duration(num_inputs, processes) if pace else None
    if as_json:
        facts: dict[str, Any] = {"skipped": plan.num_skipped, "replaced": len(plan.replaced), "stale": plan.num_stale}
        facts |= {"passed_over": [asdict(each) for each in plan.passed_over]}
        names = [f"{shard.dataset}/{shard.version}/{shard.split}/{shard.name}" for shard in plan.shards]
        print_json({"shards": names, "inputs": num_inputs, "seconds": seconds, **facts})
        return
    rows = [
        ("would convert", f"{count(len(plan.shards), 'shard')} with {count(num_inputs, 'raw input')}"),
        ("would skip", f"{count(plan.num_skipped, 'shard')} already in the lake"),
        ("would replace", count(len(plan.replaced), "shard")),
    ]
    if pace and seconds is not None:
        measured = f"measured on {count(pace.inputs, 'input')} with {count(pace.scenarios, 'scenario')}"
        rows += [("would take", f"about {duration(seconds)} with {count(processes, 'worker')}, {measured}")]
    print_table(rows + stale_row(plan.num_stale) + passed_over_rows(plan.passed_over))
