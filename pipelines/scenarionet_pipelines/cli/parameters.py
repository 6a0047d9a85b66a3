"""Arguments and options shared by several verbs, and parsers of their values."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import click

from scenarionet_data.errors import BadParameter

lake_argument = click.argument("lake")
database_argument = click.argument("database", metavar="DATABASE")
optional_database_argument = click.argument("database", metavar="[DATABASE]", required=False)
databases_argument = click.argument("databases", metavar="DATABASE...", nargs=-1, required=True)
database_option = click.option("--database", metavar="DATABASE", help="Search this database instead of the whole lake.")
name_option = click.option("--name", required=True, metavar="NAME", help="Name of the new database.")
new_version_option = click.option(
    "--replace", is_flag=True, help="Save a new version if a database of that name exists."
)
allow_empty_option = click.option("--allow-empty", is_flag=True, help="Save the database even if it has no scenarios.")
parameter_option = click.option(
    "-p", "--parameter", "parameters", multiple=True, metavar="NAME=VALUE", help="Value of a parameter; repeatable."
)
snapshot_option = click.option(
    "--snapshot", type=click.IntRange(0), metavar="N", help="Read this snapshot instead of the newest."
)
workers_option = click.option(
    "--workers",
    type=click.IntRange(1),
    metavar="N",
    help="Number of processes. [default: one per core and 2 GB of memory]",
)
cluster_option = click.option(
    "--cluster",
    metavar="NAME",
    help="Run on a Dask cluster: `local`, the name of a profile, a profile file, or a scheduler's tcp:// address.",
)
replace_option = click.option("--replace", is_flag=True, help="Overwrite existing output.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
quiet_option = click.option("--quiet", is_flag=True, help="Do not print progress.")


def combination_options(command: Callable[..., None]) -> Callable[..., None]:
    """Add the parameters of verbs that combine databases: ``LAKE DATABASE... --name NAME`` and how to save."""
    for add in (json_option, allow_empty_option, new_version_option, name_option, databases_argument, lake_argument):
        command = add(command)  # the last one added comes first in the help
    return command


def look_in_current_folder(name: str) -> None:
    """Make modules of the current folder importable for ``module:Class``, also in worker processes."""
    here = str(Path.cwd())
    if ":" in name and here not in sys.path:
        sys.path.append(here)


def pairs(words: Iterable[str], option: str) -> dict[str, str]:
    """Parse ``key=value`` words into a mapping.

    Args:
        words: Words as typed.
        option: The option that takes them, for error messages.

    Raises:
        BadParameter: A word has no ``=``, or a key is repeated.

    Example:
        >>> pairs(["train=0.9", "val=0.1"], "--fractions")
        {'train': '0.9', 'val': '0.1'}
    """
    found: dict[str, str] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key:
            raise BadParameter(f"{option} expects name=value, found {word!r}")
        if key in found:
            raise BadParameter(f"{option} has {key!r} twice")
        found[key] = value
    return found


_UNITS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 24 * 3600.0, "w": 7 * 24 * 3600.0}


def seconds(text: str, option: str, *, allow_zero: bool = False) -> float:
    """Parse a duration such as ``30s``, ``90min``, ``12h``, ``7d`` or ``2w`` and return seconds.

    Args:
        text: Duration as typed.
        option: The option that takes it, for error messages.
        allow_zero: Accept 0.

    Raises:
        BadParameter: The text is not a positive duration with a unit.

    Example:
        >>> seconds("5min", "--every")
        300.0
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*(s|min|h|d|w)", text.strip())
    if not match or not (allow_zero or float(match[1])):
        raise BadParameter(f"{option} expects a duration such as 30s, 90min, 12h, 7d or 2w, found {text!r}")
    return float(match[1]) * _UNITS[match[2]]
