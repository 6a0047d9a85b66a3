"""Cluster profiles: TOML files that describe how to start or reach a cluster, shipped or the user's own."""

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
class ClusterProfile:
    """How to start or reach a cluster, and how to use it.

    Attributes:
        kind: One of KINDS.
        doc: Purpose, in one line.
        address: The scheduler's address, for the kind ``scheduler``.
        workers: Number of workers to start; 0 for the maximum that fits on this machine.
        in_flight: Jobs submitted per worker, running or queued.
        patience: How long to wait for the first worker, or for a new one after the last has left [s].
        options: Keyword arguments of Dask's class for this kind.
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
    """Names of the shipped profiles, sorted."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def find(name: str) -> ClusterProfile:
    """Return a profile by name, by file, or for the address of a scheduler.

    Raises:
        BadParameter: Unknown profile, listing the known ones; or an invalid file.

    Example:
        >>> find("tcp://10.0.0.5:8786").kind
        'scheduler'
    """
    if "://" in name:
        return ClusterProfile("scheduler", address=name)
    path = Path(name) if name.endswith(".toml") else FOLDER / f"{name}.toml"
    if not path.is_file():
        near = difflib.get_close_matches(name, names(), n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise BadParameter(
            f"no cluster {name!r}; {hint}known profiles: {', '.join(names())}; or give a profile file (FILE.toml) "
            "or a scheduler's address (tcp://HOST:8786)"
        )
    return parse(path.read_text("utf-8"), str(path))


def parse(text: str, where: str) -> ClusterProfile:
    """Parse a profile file.

    Raises:
        BadParameter: Invalid TOML, or an unknown key or kind.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise BadParameter(f"{where}: {error}") from error
    known = [each.name for each in fields(ClusterProfile)]
    unknown = sorted(set(content) - set(known))
    if unknown:
        raise BadParameter(f"{where}: unknown key {unknown[0]!r}; a profile has {', '.join(known)}")
    if content.get("kind") not in KINDS:
        raise BadParameter(f"{where}: expected a kind out of {', '.join(KINDS)}, found {content.get('kind')!r}")
    if content["kind"] == "scheduler" and not content.get("address"):
        raise BadParameter(f'{where}: expected the scheduler\'s address, for example "tcp://10.0.0.5:8786"')
    return ClusterProfile(**content)
