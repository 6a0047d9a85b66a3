"""Comparison of loaded scenarios with their metadata, in lakes whose metadata files cannot be verified.

Two such files may have been exchanged, and a changed byte in one can lead to rows of another scenario. The content hash
covers a scenario but for its id, split, licence and source file; of these, all but the source file are compared with
the files of its tracks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Self

import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.errors import LakeError
from scenarionet_data.scenario.content_hash import content_hash
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.storage.files.errors import damaged
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.read.scenario_rows import RowAddress, ScenarioRows
from scenarionet_data.storage.snapshots import manifests
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
        """Those of a snapshot; None where the metadata files verify themselves.

        Raises:
            LakeError: A metadata file is missing or damaged, or others are in its place.
        """
        return None if count_rows(files, snapshot) else cls(files)

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


def count_rows(files: LakeFiles, snapshot: Snapshot) -> bool:
    """Compare rows of the metadata with the shards of the snapshot, unless every byte of it is verified.

    Rows of listed files whose ids differ and that are as many as scenarios were converted are those of all scenarios.

    Returns:
        Whether every byte of the metadata is verified.

    Raises:
        LakeError: A metadata file is missing or damaged, or others are in its place.
    """
    if files.are_verified(snapshot.metadata):
        return True
    rows = pa.concat_tables([files.read(name, ["scenario_id", "tracks_file"]) for name in snapshot.metadata])
    listed = pc.list_flatten(manifests.column(files, snapshot, "files"))
    stray = pc.unique(rows["tracks_file"].filter(pc.invert(pc.is_in(rows["tracks_file"], listed)))).to_pylist()
    if stray:
        raise damaged(files.url("metadata"), f"it has rows of {min(stray)}, which no shard of the snapshot lists")
    num_ids = pc.count_distinct(rows["scenario_id"]).as_py()
    wanted = pc.sum(manifests.column(files, snapshot, "num_scenarios")).as_py()
    if not len(rows) == num_ids == wanted:
        finding = f"{len(rows):,} rows of {num_ids:,} scenarios, expected {wanted:,}: files were exchanged"
        raise damaged(files.url("metadata"), finding)
    return False


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
