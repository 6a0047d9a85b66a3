"""Arguments and options that several verbs share."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable
from pathlib import Path

import click

from scenarionet_data.errors import BadParameter

lake_argument = click.argument("lake")
json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
quiet_option = click.option("--quiet", is_flag=True, help="No progress.")
replace_option = click.option("--replace", is_flag=True, help="Replace what is there.")
new_version_option = click.option("--replace", is_flag=True, help="Make a new version of an existing database.")
allow_empty_option = click.option("--allow-empty", is_flag=True, help="Save a database without members too.")
to_option = click.option("--to", "name", required=True, metavar="NAME", help="Name of the new database.")
cluster_option = click.option(
    "--cluster", metavar="NAME", help="Let a Dask cluster do it: local, a profile, FILE.toml, or tcp://HOST:8786."
)
databases_argument = click.argument("databases", metavar="DB...", nargs=-1, required=True)
snapshot_option = click.option("--snapshot", type=click.IntRange(0), help="Look at this snapshot, not the newest.")


def combination_options(command: Callable[..., None]) -> Callable[..., None]:
    """What verbs take that make one database of several: ``LAKE DB... --to NAME`` and how it is saved and told."""
    for add in (json_option, allow_empty_option, new_version_option, to_option, databases_argument, lake_argument):
        command = add(command)  # the last one added comes first in the help
    return command


def look_in_current_folder(name: str) -> None:
    """Let ``module:Class`` name a module of the current folder, here and in worker processes."""
    here = str(Path.cwd())
    if ":" in name and here not in sys.path:
        sys.path.append(here)


def pairs(words: Iterable[str], option: str) -> dict[str, str]:
    """``key=value`` words as a mapping.

    Args:
        words: As typed.
        option: What they were given to, for the message.

    Raises:
        BadParameter: A word is no pair, or a key comes twice.

    Example:
        >>> pairs(["train=0.9", "val=0.1"], "--fractions")
        {'train': '0.9', 'val': '0.1'}
    """
    found: dict[str, str] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key:
            raise BadParameter(f"{option} wants name=value, found {word!r}")
        if key in found:
            raise BadParameter(f"{option} has {key!r} twice")
        found[key] = value
    return found


_UNITS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}


def seconds(text: str, option: str) -> float:
    """A duration such as ``30s``, ``5min`` or ``1h``, in seconds.

    Args:
        text: As typed.
        option: What it was given to, for the message.

    Raises:
        BadParameter: It is none, or not above 0.

    Example:
        >>> seconds("5min", "--every")
        300.0
    """
    match = re.fullmatch(r"(\d+(?:\.\d+)?)\s*([a-z]*)", text.strip())
    if not match or match[2] not in _UNITS or not float(match[1]):
        raise BadParameter(f"{option} wants a duration such as 30s, 5min or 1h, found {text!r}")
    return float(match[1]) * _UNITS[match[2]]
