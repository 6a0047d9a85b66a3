"""Profiles: how to get a cluster, in a TOML file: one of ``pipelines/profiles`` or the user's own."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

from scenarionet_data.errors import BadParameter

FOLDER = Path(__file__).parents[1] / "profiles"

KINDS = ("scheduler", "local", "ssh", "slurm", "kubernetes")


@dataclass(frozen=True)
class Profile:
    """How to get a cluster, and how to use it.

    Attributes:
        kind: One of KINDS.
        doc: What it is for, in a line.
        address: Of the scheduler, for the kind ``scheduler``.
        workers: How many to start; 0 for as many as this machine has room for.
        in_flight: Jobs that a worker has or waits with; more would only make the scheduler remember them.
        patience: Seconds to wait for the first worker, or for another one when the last is gone.
        options: Handed to Dask's class for this kind as they are.
        config: Dask's configuration for this cluster, for example ``"distributed.scheduler.allowed-failures" = 1``.
    """

    kind: str
    doc: str = ""
    address: str | None = None
    workers: int = 0
    in_flight: int = 2
    patience: float = 300.0
    options: Mapping[str, Any] = field(default_factory=dict)
    config: Mapping[str, Any] = field(default_factory=dict)


def names() -> list[str]:
    """Profiles that come along, sorted."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def find(name: str) -> Profile:
    """A profile by name, by the path of a file, or the address of a scheduler.

    Raises:
        BadParameter: There is none, or it is none; the message says what there is.

    Example:
        >>> find("tcp://10.0.0.5:8786").kind
        'scheduler'
    """
    if "://" in name:
        return Profile("scheduler", address=name)
    path = Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    if not path.is_file():
        near = difflib.get_close_matches(name, names(), n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise BadParameter(
            f"no cluster {name!r}; {hint}there are {', '.join(names())}, a profile of your own (FILE.toml), "
            "or a scheduler's address (tcp://HOST:8786)"
        )
    return parse(path.read_text("utf-8"), str(path))


def parse(text: str, where: str) -> Profile:
    """A profile from the text of its file.

    Raises:
        BadParameter: It is no TOML, or has a key or kind that is unknown.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadParameter(f"{where}: {error}") from error
    known = [each.name for each in fields(Profile)]
    unknown = sorted(set(content) - set(known))
    if unknown:
        raise BadParameter(f"{where}: unknown key {unknown[0]!r}; a profile has {', '.join(known)}")
    if content.get("kind") not in KINDS:
        raise BadParameter(f"{where}: wanted a kind out of {', '.join(KINDS)}, found {content.get('kind')!r}")
    if content["kind"] == "scheduler" and not content.get("address"):
        raise BadParameter(f'{where}: wanted the scheduler\'s address, for example "tcp://10.0.0.5:8786"')
    return Profile(**content)
