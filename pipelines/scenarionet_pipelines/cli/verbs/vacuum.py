"""``scenarionet vacuum``: snapshots that nobody needs expire, and what only they name is deleted."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import click

from scenarionet_data.errors import BadParameter
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table, size
from scenarionet_pipelines.cli.parameters import json_option, lake_argument, quiet_option
from scenarionet_pipelines.cli.progress import ProgressDisplay

if TYPE_CHECKING:
    from scenarionet_data.maintenance import Vacuum

_SHOWN = 8
_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 24 * 3600.0, "w": 7 * 24 * 3600.0}


@verb(
    "vacuum",
    "scenarionet vacuum lake --keep-last 1",
    "scenarionet vacuum lake --older-than 30d --yes",
    "scenarionet vacuum lake --keep-last 10 --older-than 7d --json",
)
@lake_argument
@click.option("--keep-last", type=click.IntRange(1), metavar="N", help="Keep the N newest snapshots.")
@click.option("--older-than", metavar="TIME", help="Keep what is younger: 30d, 12h, 2w, 90min.")
@click.option("--dry-run", is_flag=True, help="Say what would go, and change nothing: so it is without --yes.")
@click.option("--yes", is_flag=True, help="Do it.")
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
    """Delete what older snapshots alone need.

    Without --yes it only says what would go. With both --keep-last and --older-than, a snapshot goes when neither
    keeps it. The newest snapshot never goes, nor one that a database was made on: drop or rebase that database first.
    Databases, users' columns and results of the simulator are not touched.

    Others may convert and read meanwhile: what nothing names yet stays for a day. Who reads a snapshot that goes is
    told to open the lake again.
    """
    from scenarionet_data.maintenance import plan_vacuum, vacuum

    if keep_last is None and older_than is None:
        raise click.UsageError("say which snapshots may go: --keep-last N, --older-than 30d, or both")
    if yes and dry_run:
        raise click.UsageError("--dry-run and --yes contradict each other")
    seconds = None if older_than is None else parse_time(older_than)
    if yes:
        with ProgressDisplay(f"vacuum {lake}", "file", is_quiet=quiet) as progress:
            done = vacuum(
                lake,
                keep_last=keep_last,
                older_than=seconds,
                on_progress=progress.update,
            )
    else:
        done = plan_vacuum(lake, keep_last=keep_last, older_than=seconds)
    _print(done, as_json)


def parse_time(text: str) -> float:
    """Seconds of ``30d``, ``12h``, ``2w``, ``90min`` or ``45s``.

    Raises:
        BadParameter: It is none of these.

    Example:
        >>> parse_time("12h")
        43200.0
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?)(s|min|h|d|w)", text)
    if not match:
        raise BadParameter(f"--older-than {text!r}: wanted a number and s, min, h, d or w, for example 30d")
    return float(match[1]) * _UNITS[match[2]]


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
    rows += [("stay", f"{count(len(done.kept), 'snapshot')}{_listed(done.kept)}")]
    rows += [
        ("needed", f"snapshot {n} by {', '.join(names)}; rebase it and drop this version")
        for n, names in done.needed.items()
    ]
    rows += [
        ("deleted" if done.is_done else "would delete", f"{count(number, 'file')} of {name}, {size(held)}")
        for name, (number, held) in done.tables.items()
    ]
    if done.young:
        rows += [("left", f"{count(len(done.young), 'file')}, {size(young)}: named by nothing, but not a day old")]
    print_table(rows)
    if done.is_done:
        click.echo(f"{size(done.size)} are free again")
    elif done.expired or done.files:
        click.echo(f"--yes does it: {size(done.size)} would be free again")
    else:
        click.echo("nothing to do")


def _listed(numbers: tuple[int, ...]) -> str:
    """The numbers behind a colon; nothing when there are none."""
    shown = ", ".join(map(str, numbers[:_SHOWN])) + (", ..." if len(numbers) > _SHOWN else "")
    return f": {shown}" if numbers else ""
