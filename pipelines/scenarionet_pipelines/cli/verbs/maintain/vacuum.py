"""``scenarionet maintain vacuum``: expire old snapshots and delete the files only they use."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table, size
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, quiet_option, seconds
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from scenarionet_data.maintenance import Vacuum

_MAX_LISTED = 8


@verb(
    "vacuum",
    "scenarionet maintain vacuum lake --keep-last 1",
    "scenarionet maintain vacuum lake --older-than 30d --yes",
    "scenarionet maintain vacuum lake --keep-last 10 --older-than 7d --json",
)
@lake_argument
@click.option("--keep-last", type=click.IntRange(1), metavar="N", help="Keep the N newest snapshots.")
@click.option("--older-than", metavar="TIME", help="Keep snapshots younger than this: 30d, 12h, 2w, 90min.")
@click.option("--dry-run", is_flag=True, help="Print what would be deleted (the default without --yes).")
@click.option("--yes", is_flag=True, help="Delete.")
@json_option
@quiet_option
def command(
    lake: str,
    keep_last: int | None,
    older_than: str | None,
    dry_run: bool,
    yes: bool,
    as_json: bool,
    quiet: bool,
) -> None:
    """Expire old snapshots and delete the files that only they use.

    Without --yes, nothing is deleted. With both --keep-last and --older-than, a snapshot expires only if neither
    keeps it. The newest snapshot never expires, nor does one that a database uses: drop or rebase that database
    first. Databases, user columns and simulation results are not deleted.

    Other processes can convert and read at the same time: files younger than a day are never deleted. A reader of an
    expired snapshot gets an error that asks to open the lake again.
    """
    from scenarionet_data.maintenance import plan_vacuum, vacuum

    if keep_last is None and older_than is None:
        raise click.UsageError("choose the snapshots to expire: --keep-last N, --older-than 30d, or both")
    if yes and dry_run:
        raise click.UsageError("--dry-run and --yes contradict each other")
    age = None if older_than is None else seconds(older_than, "--older-than", allow_zero=True)
    if yes:
        with ProgressDisplay(f"vacuum {lake}", "file", is_quiet=quiet) as progress:
            done = vacuum(
                lake,
                keep_last=keep_last,
                older_than=age,
                on_progress=progress.update,
            )
    else:
        done = plan_vacuum(lake, keep_last=keep_last, older_than=age)
    _print(done, as_json)


def _print(done: Vacuum, as_json: bool) -> None:
    young = sum(listed.size for listed in done.young)
    if as_json:
        content = {"is_done": done.is_done, "expired": done.expired, "kept": done.kept, "needed": done.needed}
        tables = {name: {"files": number, "bytes": held} for name, (number, held) in done.tables.items()}
        content |= {"files": [listed.name for listed in done.files], "bytes": done.size, "tables": tables}
        print_json(content | {"young": {"files": len(done.young), "bytes": young}})
        return
    verb_ = "expired" if done.is_done else "would expire"
    rows = [(verb_, f"{count(len(done.expired), 'snapshot')}{_listed(done.expired)}")]
    rows += [("kept", f"{count(len(done.kept), 'snapshot')}{_listed(done.kept)}")]
    rows += [
        ("needed", f"snapshot {n} by {', '.join(names)}; rebase it and drop that version")
        for n, names in done.needed.items()
    ]
    rows += [
        ("deleted" if done.is_done else "would delete", f"{count(number, 'file')} of {name}, {size(held)}")
        for name, (number, held) in done.tables.items()
    ]
    if done.young:
        rows += [("left", f"{count(len(done.young), 'file')}, {size(young)}: unused, but younger than a day")]
    print_table(rows)
    if done.is_done:
        click.echo(f"freed {size(done.size)}")
    elif done.expired or done.files:
        click.echo(f"add --yes to delete; frees {size(done.size)}")
    else:
        click.echo("nothing to do")


def _listed(numbers: tuple[int, ...]) -> str:
    """A colon and the first numbers; empty without numbers."""
    shown = ", ".join(map(str, numbers[:_MAX_LISTED])) + (", ..." if len(numbers) > _MAX_LISTED else "")
    return f": {shown}" if numbers else ""
