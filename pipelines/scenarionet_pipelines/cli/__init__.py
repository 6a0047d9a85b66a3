"""The ``scenarionet`` command. Each verb is a module in ``verbs/`` that parses, makes one library call and prints.

Exit codes: 0 success, 1 problems with the data, 2 usage errors, 130 after Ctrl-C, 143 after
SIGTERM. Results are written to standard output; progress, warnings and errors to standard error.
"""

from __future__ import annotations

import gc
import os
import sys
from io import TextIOWrapper

import click

from scenarionet_pipelines.cli.group import CommandLine
from scenarionet_pipelines.cli.interrupt import finish, handle_signals
from scenarionet_pipelines.verb_tree import SECTIONS


def _print_version(ctx: click.Context, option: click.Parameter, is_wanted: bool) -> None:  # noqa: ARG001
    from scenarionet_data import version

    if is_wanted:
        click.echo(version.name_and_version())
        ctx.exit()


@click.group("scenarionet", cls=CommandLine, sections=SECTIONS, no_args_is_help=True)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_print_version, help="Show the version."
)
@click.option("--debug", is_flag=True, help="Show the full traceback of an error.")
def cli(debug: bool) -> None:
    """Convert, query, select, load and simulate traffic scenarios from any driving dataset.

    A lake is a folder, or a URL in an object store, that holds converted scenarios as Parquet files.
    Run `scenarionet VERB --help` for the options of a verb, with examples. Begin with
    `scenarionet convert pg 0:100 lake` and `scenarionet list lake`.
    """


def main() -> None:
    """Run the command line; the entry point of the installed script."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # whose threads nothing here needs: 0.04 s and address space
    gc.set_threshold(100_000)  # imports make many objects and no garbage: a tenth of the time of a short command
    handle_signals()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):  # names of files may have bytes or letters that the terminal has not
            stream.reconfigure(errors="backslashreplace")
    try:
        cli(prog_name="scenarionet")
    except SystemExit as end:
        finish(end.code)
        raise
