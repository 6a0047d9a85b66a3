"""Comparison of loaded scenarios with their metadata, in lakes whose metadata files have no seals.

A changed byte in such a file can lead to rows of another scenario. The content hash covers a scenario but for its id,
split, licence and source file; of these, all but the source file are compared with the files of its tracks.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

from scenarionet_data.codec import ScenarioColumns
from scenarionet_data.errors import LakeError
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.storage.files.errors import damaged
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.snapshots.shard_record import partition

_MAX_TIMESTEPS = 100_000
"""Timesteps of a scenario in an older lake; arrays of as many are allocated for each object."""

_ERRORS = (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError, MemoryError)
"""Errors of decoding inconsistent rows."""


@contextmanager
def comparing(files: LakeFiles, metadata: Sequence[Mapping[str, Any]]) -> Iterator[list[ScenarioDescription]]:
    """Compare the scenarios that the block puts into the list with their metadata rows.

    Raises:
        LakeError: A scenario is not as it was converted.
    """
    for row in metadata:
        if not 0 < row["num_timesteps"] <= _MAX_TIMESTEPS:
            raise _damage(files, row, f"{row['num_timesteps']:,} timesteps")
    loaded: list[ScenarioDescription] = []
    try:
        yield loaded
        for row, scenario in zip(metadata, loaded, strict=True):
            _compare(files, row, scenario)
    except LakeError:
        raise
    except _ERRORS as error:
        raise _damage(files, metadata[0], f"it cannot be decoded ({error})") from error


def check_ids(files: LakeFiles, metadata: Sequence[Mapping[str, Any]], tracks: ScenarioColumns) -> None:
    """Compare the ids of scenarios with those of their tracks.

    Raises:
        LakeError: They differ.
    """
    stored = tracks.columns.strings("scenario_id")
    for row, start, end in zip(metadata, tracks.bounds, tracks.bounds[1:], strict=False):
        if set(stored[start:end].tolist()) != {row["scenario_id"]}:
            raise _damage(files, row, "its tracks are those of another scenario")


def _compare(files: LakeFiles, row: Mapping[str, Any], scenario: ScenarioDescription) -> None:
    if content_hash(scenario) != row["content_hash"]:
        raise _damage(files, row, "its content differs from what was converted")
    if not row["tracks_file"].startswith(f"{partition('tracks', row['dataset'], row['version'], row['split'])}/"):
        raise _damage(files, row, "its tracks are in another partition")
    if row["licence"] not in _licence(files, row["tracks_file"]):
        raise _damage(files, row, "its tracks have another licence")


@lru_cache(512)
def _licence(files: LakeFiles, name: str) -> str:
    """Licence in the footer of a file."""
    entries = files.footer(name).metadata or {}
    return str(entries.get(b"scenarionet.licence", b""), "utf-8", "replace")


def _damage(files: LakeFiles, row: Mapping[str, Any], finding: str) -> LakeError:
    folder = partition("metadata", row["dataset"], row["version"], row["split"])
    return damaged(files.url(folder), f"the row of {row['scenario_id']} or its files are damaged, {finding}")
