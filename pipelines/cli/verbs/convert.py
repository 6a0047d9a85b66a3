"""``scenarionet convert``: raw recordings into a lake."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import click

from pipelines.cli.crew import crew, share_rows
from pipelines.cli.group import one_line, verb
from pipelines.cli.interrupt import Interrupted
from pipelines.cli.output import count, duration, print_json, print_table, size
from pipelines.cli.parameters import cluster_option, json_option, lake_argument, pairs, quiet_option
from pipelines.cli.progress import Progress

if TYPE_CHECKING:
    from scenarionet_data.conversion import Plan, Report

_REASONS = 5


@verb(
    "convert",
    "scenarionet convert waymo raw/waymo/training lake",
    "scenarionet convert pg 0:200 lake --split train --workers 2",
    "scenarionet convert waymo raw/waymo/validation lake --limit 10",
    "scenarionet convert scenarionet pickles/nuscenes lake --dry-run",
    "scenarionet convert nuplan raw/nuplan lake --where 'location=us-nv-*' --files 0:10",
    "scenarionet convert waymo raw/waymo/training lake --cluster tcp://10.0.0.5:8786",
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
@click.option("--stale", is_flag=True, help="Replace what another version of the converter wrote.")
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
    no_check: bool,
    dry_run: bool,
    options: tuple[str, ...],
    as_json: bool,
    quiet: bool,
) -> None:
    """Convert recordings into a lake.

    DATASET is a converter (`scenarionet converters` lists them, and what RAW has to be: mostly the folder with
    the recordings), or a class of your own as module:Class. LAKE is a folder, made when it is not there.

    What is converted once is never converted again: run the same command after an interruption, or when
    recordings were added, and it goes on from there.

    A record that cannot be read, and a scenario that breaks a hard rule of `scenarionet check`, go to quarantine
    with the reason, and the run goes on; the exit code is 1 then.

    --where chooses by what is known before anything is converted, with shell patterns: the file of an input, the
    name of its shard, and what the dataset tells, for example the location, log, date and tags of nuPlan's logs
    (`scenarionet converters nuplan` lists them). --dry-run converts a few inputs into a folder that it throws away,
    to say how long the rest will take.

    --cluster lets a Dask cluster convert: `local` starts one on this machine, an address is that of a scheduler that
    runs already, other names and files are profiles (docs/cluster.md).
    """
    from pipelines.cli import converter
    from pipelines.machine import default_workers
    from scenarionet_data.conversion import Selection, convert, parse_slice, plan_conversion

    chosen = converter.parse_options(converter.find(dataset), options)
    common: dict[str, Any] = {
        "split": split,
        "version": version,
        "options": chosen,
        "selection": Selection(pairs(where, "--where"), parse_slice(files or ":")),
        "replace_old": replace,
        "stale": stale,
    }
    if dry_run:
        _print_plan(dataset, plan_conversion(dataset, raw, lake, **common), workers or default_workers(), as_json)
        return
    with (
        crew(cluster, workers, quiet=quiet) as run,
        Progress(f"convert {dataset}", "shard", is_quiet=quiet) as progress,
    ):
        try:
            report = convert(
                dataset,
                raw,
                lake,
                run=run,
                workers=workers or default_workers(),
                limit=limit,
                is_checked=not no_check,
                on_progress=progress.update,
                **common,
            )
        except KeyboardInterrupt as error:
            raise Interrupted(_kept(progress, lake)) from error
    _print_report(report, lake, as_json)
    click.get_current_context().exit(0 if report.is_clean else 1)


def _kept(progress: Progress, lake: str) -> str:
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
    print_table(rows + _stale_row(plan.num_stale))


def _stale_row(number: int) -> list[tuple[str, str]]:
    text = f"{count(number, 'shard')} written by another version of the converter; --stale converts them anew"
    return [("stale", text)] if number else []


# --- the report -------------------------------------------------------------------------------------------


def _print_report(report: Report, lake: str, as_json: bool) -> None:
    reasons = _reasons(report, lake)
    rate = report.converted / max(report.seconds, 1e-9)
    if as_json:
        failed = [{"shard": name, "reason": reason} for name, reason in report.failed]
        content = asdict(report) | {"failed": failed, "reasons": reasons, "is_clean": report.is_clean}
        content |= {"partitions": ["/".join(parts) for parts in sorted(report.partitions)]}
        print_json(content | {"scenarios_per_second": rate, "lake": lake, "next": _next(report, lake)})
        return
    print_table(_rows(report, reasons, rate))
    click.echo(_next(report, lake))


def _rows(report: Report, reasons: list[dict[str, Any]], rate: float) -> list[tuple[str, str]]:
    shards = count(report.shards, "shard")
    rows = [("converted", f"{count(report.converted, 'scenario')} in {shards}, {size(report.size)}")]
    rows += [("into", "/".join(parts)) for parts in sorted(report.partitions)]
    rows += [("quarantined", count(report.quarantined, "scenario"))] if report.quarantined else []
    rows += [("", f"{r['scenarios']} x {r['error']}: {one_line(r['example'])}") for r in reasons[:_REASONS]]
    for what, number, why in (
        ("skipped", report.skipped, "that the lake had already"),
        ("adopted", report.adopted, "that an interrupted run had finished"),
        ("replaced", report.replaced, "whose scenarios made way for newer ones"),
    ):
        rows += [(what, f"{count(number, 'shard')} {why}")] if number else []
    rows += _stale_row(report.stale)
    rows += [("failed", count(len(report.failed), "shard"))] if report.failed else []
    rows += [("", f"{name}: {one_line(reason)}") for name, reason in report.failed[:_REASONS]]
    rows += share_rows(report.workers) if len(report.workers) > 1 else []
    return [*rows, ("took", f"{duration(report.seconds)}, {rate:,.1f} scenarios/s")]


def _reasons(report: Report, lake: str) -> list[dict[str, Any]]:
    """Why scenarios of the report's partitions are in quarantine, the most frequent first."""
    from scenarionet_data import Lake

    if not report.quarantined:
        return []
    rows = Lake(lake).ask("quarantine_reasons").to_dicts()
    return [row for row in rows if (row["dataset"], row["version"], row["split"]) in report.partitions]


def _next(report: Report, lake: str) -> str:
    """What to do now, in a sentence."""
    if report.failed:
        return "Mend what failed and run the same command again: only the failed shards are left to do."
    if report.quarantined:
        return f"See every rejected scenario: scenarionet sql {lake} 'SELECT * FROM quarantine'"
    return f"See what the lake holds: scenarionet list {lake}"
