"""``scenarionet compact``: fewer, larger files, in the profile that suits what is done with them."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli.execution import executor_from_options
from scenarionet_pipelines.cli.group import one_line, verb
from scenarionet_pipelines.cli.interrupt import Interrupted
from scenarionet_pipelines.cli.output import count, duration, print_json, print_table, size
from scenarionet_pipelines.cli.parameters import cluster_option, json_option, lake_argument, pairs, quiet_option
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from scenarionet_data.maintenance.bin_packing import Bin
    from scenarionet_data.maintenance.compaction import Compaction


@verb(
    "compact",
    "scenarionet compact lake",
    "scenarionet compact lake --profile analytics --workers 4",
    "scenarionet compact lake --cluster tcp://10.0.0.5:8786",
    "scenarionet compact lake --profile analytics --where dataset=waymo --where 'split=val*' --dry-run",
)
@lake_argument
@click.option(
    "--profile",
    type=click.Choice(["training", "analytics"]),
    default="training",
    show_default=True,
    help="What the files are for.",
)
@click.option("--where", multiple=True, metavar="KEY=PATTERN", help="Only this dataset, version or split; repeatable.")
@click.option("--workers", type=click.IntRange(1), help="Processes. [default: one a core, 2 GB of memory each]")
@cluster_option
@click.option("--dry-run", is_flag=True, help="Say what there is to do.")
@json_option
@quiet_option
def command(
    lake: str,
    profile: str,
    where: tuple[str, ...],
    workers: int | None,
    cluster: str | None,
    dry_run: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Rewrite many small files as few.

    training: one scenario a row group and up to 64 a file, as converted; random scenarios load quickest.
    analytics: 16 scenarios a row group and up to 1,024 a file; SQL over tracks is quicker and the files are smaller,
    but a random scenario takes several times as long to load.

    Scenarios, ids and databases stay as they are; only where they lie changes, in one new snapshot. Others may read
    and convert meanwhile. What lies well already is left alone, and what an interrupted run has finished is kept. The
    old files stay until `scenarionet vacuum` lets the snapshots expire that name them.
    """
    from scenarionet_data.maintenance import compact, plan_compaction
    from scenarionet_pipelines.machine import default_workers

    chosen = pairs(where, "--where")
    if dry_run:
        _print_plan(plan_compaction(lake, profile, where=chosen), profile, as_json)
        return
    with (
        executor_from_options(cluster, workers, quiet=quiet) as execution,
        ProgressDisplay(f"compact {lake}", "bin", is_quiet=quiet) as progress,
    ):
        try:
            done = compact(
                lake,
                profile,
                where=chosen,
                workers=workers or default_workers(),
                executor=execution.executor,
                on_progress=progress.update,
            )
        except KeyboardInterrupt as error:
            finished = f"{progress.done:,} of {count(progress.total, 'bin')} rewritten and kept"
            raise Interrupted(f"{finished}; the same command goes on from there, and commits them all") from error
    _print(done, lake, as_json)
    click.get_current_context().exit(1 if done.failed or done.left else 0)


def _print_plan(bins: list[Bin], profile: str, as_json: bool) -> None:
    scenarios, shards = sum(each.num_scenarios for each in bins), sum(len(each.records) for each in bins)
    if as_json:
        print_json({"profile": profile, "bins": len(bins), "shards": shards, "scenarios": scenarios})
        return
    what = f"{count(scenarios, 'scenario')} of {count(shards, 'shard')}, in {count(len(bins), 'bin')}"
    click.echo(f"would rewrite {what}" if bins else f"nothing to do: everything lies well for {profile}")


def _print(done: Compaction, lake: str, as_json: bool) -> None:
    if as_json:
        failed = [{"shard": name, "reason": reason} for name, reason in done.failed]
        print_json(asdict(done) | {"failed": failed})
        return
    rows = [
        ("rewritten", f"{count(done.scenarios, 'scenario')} of {count(done.shards, 'shard')} for {done.profile}"),
        ("files", f"{done.files_before:,} before, {done.files_after:,} now"),
        ("bytes", f"{size(done.bytes_before)} before, {size(done.bytes_after)} now"),
    ]
    rows += [("left", f"{count(done.left, 'shard')} that others changed meanwhile")] if done.left else []
    rows += [("failed", f"{name} and what is with it: {one_line(reason)}") for name, reason in done.failed]
    print_table([*rows, ("took", duration(done.seconds))] if done.shards or len(rows) > 3 else [])
    if done.failed:
        click.echo(f"See what is damaged: scenarionet fsck {lake}")
    elif done.shards:
        click.echo(f"The old files go with: scenarionet vacuum {lake} --keep-last 1")
    else:
        click.echo(f"nothing to do: everything lies well for {done.profile}")
