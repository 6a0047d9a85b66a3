"""``scenarionet maintain compact``: rewrite small files as fewer, larger ones."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli.advice import one_line
from scenarionet_pipelines.cli.execution import executor_from_options
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.interrupt import Interrupted
from scenarionet_pipelines.cli.output import count, duration, print_json, print_table, size
from scenarionet_pipelines.cli.parameters import (
    cluster_option,
    json_option,
    lake_argument,
    pairs,
    quiet_option,
    workers_option,
)
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from scenarionet_data.maintenance.bin_packing import Bin
    from scenarionet_data.maintenance.compaction import Compaction


@verb(
    "compact",
    "scenarionet maintain compact lake",
    "scenarionet maintain compact lake --profile analytics --workers 4",
    "scenarionet maintain compact lake --cluster tcp://10.0.0.5:8786",
    "scenarionet maintain compact lake --profile analytics --where dataset=waymo --where 'split=val*' --dry-run",
)
@lake_argument
@click.option(
    "--profile",
    type=click.Choice(["training", "analytics"]),
    default="training",
    show_default=True,
    help="Access pattern to optimise for.",
)
@click.option(
    "--where", multiple=True, metavar="KEY=PATTERN", help="Only matching datasets, versions or splits; repeatable."
)
@workers_option
@cluster_option
@click.option("--dry-run", is_flag=True, help="Print what would be rewritten.")
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
    """Rewrite small files as fewer, larger ones, in one new snapshot.

    training: one scenario per row group and up to 64 per file, as converted; loads random scenarios fastest.
    analytics: 16 scenarios per row group and up to 1,024 per file; files are smaller and SQL over tracks is faster,
    but loading a random scenario takes several times longer.

    Scenarios, ids and databases do not change. Other processes can read and convert at the same time. Files that
    already fit the profile are skipped, and work finished by an interrupted run is reused. The old files remain
    until `scenarionet maintain vacuum` expires the snapshots that refer to them.
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
            raise Interrupted(f"{finished}; run the same command again to continue") from error
    _print(done, lake, as_json)
    click.get_current_context().exit(1 if done.failed or done.left else 0)


def _print_plan(bins: list[Bin], profile: str, as_json: bool) -> None:
    scenarios, shards = sum(each.num_scenarios for each in bins), sum(len(each.records) for each in bins)
    if as_json:
        print_json({"profile": profile, "bins": len(bins), "shards": shards, "scenarios": scenarios})
        return
    what = f"{count(scenarios, 'scenario')} of {count(shards, 'shard')}, in {count(len(bins), 'bin')}"
    click.echo(f"would rewrite {what}" if bins else f"nothing to do: all files fit the profile {profile}")


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
    rows += [("left", f"{count(done.left, 'shard')} changed by another process in the meantime")] if done.left else []
    rows += [("failed", f"{name} and the rest of its file: {one_line(reason)}") for name, reason in done.failed]
    print_table([*rows, ("took", duration(done.seconds))] if done.shards or len(rows) > 3 else [])
    if done.failed:
        click.echo(f"Find the damage: scenarionet maintain fsck {lake}")
    elif done.shards:
        click.echo(f"Delete the old files: scenarionet maintain vacuum {lake} --keep-last 1")
    else:
        click.echo(f"nothing to do: all files fit the profile {done.profile}")
