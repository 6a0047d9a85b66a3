"""Comparison of loaded scenarios with their metadata, in lakes whose metadata files cannot be verified.

A changed byte in such a file can lead to rows of another scenario. The content hash covers a scenario but for its id,
split, licence and source file; of these, all but the source file are compared with the files of its tracks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

from scenarionet_data.errors import LakeError
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.storage.files.errors import damaged
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.read.scenario_rows import RowAddress, ScenarioRows
from scenarionet_data.storage.snapshots.shard_record import partition
from scenarionet_data.storage.snapshots.snapshot import Snapshot

_MAX_TIMESTEPS = 100_000
"""Timesteps of a scenario in an older lake; arrays of as many are allocated for each object."""

_ERRORS = (ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError, MemoryError)
"""Errors of decoding inconsistent rows."""


class ContentComparison:
    """Compares scenarios with their metadata, each once.

    Args:
        files: The lake's files.
    """

    def __init__(self, files: LakeFiles) -> None:
        self._files = files
        self._compared: set[str] = set()

    @classmethod
    def if_needed(cls, files: LakeFiles, snapshot: Snapshot) -> Self | None:
        """Those of a snapshot; None where the metadata files verify themselves."""
        return None if files.are_verified(snapshot.metadata) else cls(files)

    def compare(
        self,
        metadata: Sequence[Mapping[str, Any]],
        decode: Callable[[Sequence[Mapping[str, Any]]], Sequence[ScenarioDescription]],
    ) -> None:
        """Compare scenarios.

        Args:
            metadata: Their rows of the metadata table.
            decode: Reads and decodes some of them.

        Raises:
            LakeError: A scenario is not as it was converted.
        """
        for row in metadata:
            if row["scenario_id"] in self._compared:
                continue
            if not 0 < row["num_timesteps"] <= _MAX_TIMESTEPS:
                raise _damage(self._files, row, f"{row['num_timesteps']:,} timesteps")
            try:
                (scenario,) = decode([row])
                _compare(self._files, row, scenario)
            except _ERRORS as error:
                raise _damage(self._files, row, f"it cannot be decoded ({error})") from error
            self._compared.add(row["scenario_id"])


def _compare(files: LakeFiles, row: Mapping[str, Any], scenario: ScenarioDescription) -> None:
    address = RowAddress(*(row[f"tracks_{part}"] for part in RowAddress._fields))
    if set(ScenarioRows(files, "tracks").read(address)["scenario_id"].to_pylist()) != {row["scenario_id"]}:
        raise _damage(files, row, "its tracks are those of another scenario")
    if content_hash(scenario) != row["content_hash"]:
        raise _damage(files, row, "its content differs from what was converted")
    if not row["tracks_file"].startswith(f"{partition('tracks', row['dataset'], row['version'], row['split'])}/"):
        raise _damage(files, row, "its tracks are in another partition")
    licence = (files.footer(row["tracks_file"]).metadata or {}).get(b"scenarionet.licence", b"")
    if row["licence"] not in str(licence, "utf-8", "replace"):
        raise _damage(files, row, "its tracks have another licence")


def _damage(files: LakeFiles, row: Mapping[str, Any], finding: str) -> LakeError:
    folder = partition("metadata", row["dataset"], row["version"], row["split"])
    return damaged(files.url(folder), f"the row of {row['scenario_id']} or its files are damaged, {finding}")
