"""The command ``scenarionet``: every verb is a file in ``verbs/`` that parses, makes one library call, and prints.

Exit codes: 0 ok, 1 problems with data, 2 usage, 130 interrupted. Results go to standard output, everything else
to standard error.
"""

from __future__ import annotations

import click

from scenarionet_pipelines.cli.group import Verbs
from scenarionet_pipelines.cli.interrupt import stop_cleanly

VERBS = {
    "Bring recordings in": ("convert", "converters"),
    "Look": ("list", "show", "sql", "mine", "stats", "files", "render", "browse", "report"),
    "Choose": ("filter", "filters", "split", "sample", "tag"),
    "Combine": ("merge", "intersect", "subtract", "diff", "overlap"),
    "Keep databases": ("lineage", "rebuild", "rebase", "copy", "rename", "drop", "checkout"),
    "Simulate": ("sim", "record"),
    "Hand on": ("export", "pack"),
    "Keep healthy": ("check", "fsck", "compact", "vacuum", "doctor"),
}
"""The verbs by what a person wants to do; ``<verb>`` is ``verbs/<verb>.py``."""


def _print_version(ctx: click.Context, option: click.Parameter, is_wanted: bool) -> None:  # noqa: ARG001
    from scenarionet_data import version

    if is_wanted:
        click.echo(version.name_and_version())
        ctx.exit()


@click.group("scenarionet", cls=Verbs, sections=VERBS, no_args_is_help=True)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_print_version, help="Show the version."
)
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def cli(debug: bool) -> None:
    """Traffic scenarios from every driving dataset in one columnar lake.

    Convert recordings once, ask them in SQL, choose what you need, load or export it.
    `scenarionet VERB --help` explains a verb and shows an example.
    """


def main() -> None:
    """Entry point of the command."""
    stop_cleanly()
    cli(prog_name="scenarionet")
