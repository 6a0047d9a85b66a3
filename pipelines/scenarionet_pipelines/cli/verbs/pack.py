"""``scenarionet pack``: write a database with its scenarios as a portable lake."""

from __future__ import annotations

from dataclasses import asdict

import click

from scenarionet_pipelines.cli.advice import one_line
from scenarionet_pipelines.cli.group import verb
from scenarionet_pipelines.cli.output import count, print_json, print_table, size
from scenarionet_pipelines.cli.parameters import json_option, quiet_option
from scenarionet_pipelines.cli.progress import ProgressDisplay


@verb(
    "pack",
    "scenarionet pack lake busy busy_pack",
    "scenarionet pack lake busy_val busy_val.tar --tar",
    "scenarionet pack --verify busy_pack",
)
@click.argument("words", nargs=-1, metavar="LAKE DATABASE OUT")
@click.option("--tar", is_flag=True, help="Write a single tar file; it has to be unpacked before use.")
@click.option(
    "--publishable", is_flag=True, help="Refuse scenarios whose licence is not known to allow redistribution."
)
@click.option("--verify", "pack", metavar="PATH", help="Verify a pack (folder or tar file) instead of writing one.")
@json_option
@quiet_option
def command(words: tuple[str, ...], tar: bool, publishable: bool, pack: str | None, as_json: bool, quiet: bool) -> None:
    """Write a database and everything its scenarios need to OUT, a self-contained lake.

    OUT can be moved anywhere and is read by every verb and by the loader, also from read-only media. It contains the
    scenarios, the tiles of shared maps that they use, and user columns, but no quarantined scenarios.
    OUT/SHA256SUMS lists every file for `sha256sum -c`, OUT/README.md is a card for Hugging Face with the tables as
    configurations of `datasets.load_dataset(OUT)`.

    --verify reads every byte and verifies checksums, row counts and references (exit code 1 if something is wrong).
    """
    if pack is not None:
        if words or tar or publishable:
            raise click.UsageError("--verify PATH takes no other arguments")
        _verify(pack, as_json, quiet)
        return
    if len(words) != 3:
        raise click.UsageError("expected LAKE DATABASE OUT, or --verify PATH")
    _pack(*words, tar=tar, publishable=publishable, as_json=as_json, quiet=quiet)


def _pack(lake: str, database: str, out: str, *, tar: bool, publishable: bool, as_json: bool, quiet: bool) -> None:
    from scenarionet_data import Lake

    with ProgressDisplay(f"pack {database}", "step", is_quiet=quiet) as progress:
        done = Lake(lake).pack(database, out, tar=tar, publishable=publishable, on_progress=progress.update)
    if as_json:
        print_json(asdict(done))
    else:
        files = count(done.num_files, "file")
        click.echo(
            f"{done.path}: {done.reference}, {count(done.num_scenarios, 'scenario')}, {files}, {size(done.num_bytes)}"
        )


def _verify(path: str, as_json: bool, quiet: bool) -> None:
    from scenarionet_data.packs.verifying import verify_pack

    with ProgressDisplay(f"verify {path}", "file", is_quiet=quiet) as progress:
        found = verify_pack(path, progress.update)
    if as_json:
        print_json(asdict(found) | {"is_whole": found.is_whole})
    else:
        print_table((damage.file, one_line(damage.reason)) for damage in found.damages)
        verdict = "intact" if found.is_whole else count(len(found.damages), "file") + " broken"
        click.echo(f"{path}: {', '.join(found.references)}, {count(found.num_files, 'file')}: {verdict}")
    click.get_current_context().exit(0 if found.is_whole else 1)
