"""``scenarionet maintain fsck``: verify the files of a lake."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli.advice import one_line
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table, size
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, quiet_option
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from scenarionet_data.maintenance import Fsck

_SHOWN = 20


@verb(
    "fsck",
    "scenarionet maintain fsck lake",
    "scenarionet maintain fsck lake --deep --workers 8 --json",
    "scenarionet maintain fsck lake --deep --repair",
    "scenarionet maintain fsck lake --upgrade",
)
@lake_argument
@click.option("--deep", is_flag=True, help="Read every byte and verify checksums and the scenario ids of all rows.")
@click.option(
    "--repair",
    "is_repair",
    is_flag=True,
    help="Remove damaged shards from the lake, so that they can be converted again.",
)
@click.option(
    "--upgrade",
    "is_upgrade",
    is_flag=True,
    help="Check deeply, then seal the files of a lake of an older version, so that every byte of it can be verified.",
)
@click.option("--workers", type=click.IntRange(1), metavar="N", help="Number of threads. [default: one per core]")
@json_option
@quiet_option
def command(
    lake: str, deep: bool, is_repair: bool, is_upgrade: bool, workers: int | None, as_json: bool, quiet: bool
) -> None:
    """Verify that every file of a lake exists and is intact.

    fsck examines files; `scenarionet maintain check` examines the content of scenarios. In every snapshot, each file
    must exist with its recorded size, footer and number of rows. In the newest snapshot, and in those that databases
    use, every row address, shared map, database member and user column is resolved. Each problem is printed with a
    remedy; the exit code is 1.

    --repair publishes a snapshot without the shards whose files are damaged and deletes those files. Run the
    original `scenarionet convert` again to restore them.

    --upgrade rewrites data files of the newest snapshot and seals all other files of a lake that an older version of
    this software wrote, unless the check finds problems. It can be interrupted and run again, and readers and writers
    can go on; the older version of this software cannot read the lake afterwards.
    """
    if is_upgrade:
        _upgrade(lake, is_repair=is_repair, workers=workers, as_json=as_json, quiet=quiet)
        return
    from scenarionet_data.maintenance import fsck, repair

    with ProgressDisplay(f"fsck {lake}", "file", is_quiet=quiet) as progress:
        found = fsck(lake, is_deep=deep, workers=workers, on_progress=progress.update)
    again = repair(lake, found) if is_repair and not found.is_whole else []
    if as_json:
        print_json(asdict(found) | {"is_whole": found.is_whole, "convert_again": again})
    else:
        _print(found, lake)
        if again:
            click.echo(f"convert again: {', '.join(again[:_SHOWN])}")
    click.get_current_context().exit(0 if found.is_whole else 1)


def _upgrade(lake: str, *, is_repair: bool, workers: int | None, as_json: bool, quiet: bool) -> None:
    """Check and upgrade a lake, and print the result."""
    from scenarionet_data.maintenance import upgrade

    if is_repair:
        raise click.UsageError("--upgrade does not repair: run --deep --repair first")
    with ProgressDisplay(f"upgrade {lake}", "file", is_quiet=quiet) as progress:
        done = upgrade(lake, workers=workers or 1, on_progress=progress.update)
    if as_json:
        print_json(asdict(done) | {"is_complete": done.is_complete})
    elif not done.check.is_whole:
        _print(done.check, lake)
        click.echo("nothing was upgraded: repair these problems first")
    else:
        rows = [("rewritten", count(done.shards, "shard")), ("sealed", count(done.sealed, "other file"))]
        rows += [("failed", f"{name}: {one_line(reason)}") for name, reason in done.failed[:_SHOWN]]
        if done.left:
            rows.append(
                ("left", f"{count(done.left, 'shard')} that other jobs kept changing: run the same command again")
            )
        print_table(rows)
    click.get_current_context().exit(0 if done.is_complete else 1)


def _print(found: Fsck, lake: str) -> None:
    for problem in found.problems[:_SHOWN]:
        click.echo(f"{problem.file}\n  {one_line(problem.reason)}\n  {problem.remedy.replace('LAKE', lake)}")
    if len(found.problems) > _SHOWN:
        click.echo(f"... and {len(found.problems) - _SHOWN:,} more; --json lists them all")
    verdict = "intact" if found.is_whole else count(len(found.problems), "problem")
    checked = f"{count(found.num_files, 'file')} of {count(len(found.snapshots), 'snapshot')}: {verdict}"
    rows = [("checked", checked)]
    rows += [("left over", f"{count(n.num_files, 'file')}, {size(n.size)}, {n.text}") for n in found.notes]
    if found.unsealed:
        unsealed = f"{count(len(found.unsealed), 'file')} of an older version, of which not every byte can be verified"
        rows.append(("unsealed", f"{unsealed}: `scenarionet maintain fsck {lake} --upgrade` seals them"))
    print_table(rows)
