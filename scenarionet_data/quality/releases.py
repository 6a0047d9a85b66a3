"""How much of an owner's split a lake holds: the numbers that owners publish, in ``releases.toml``."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cache
from pathlib import Path

from scenarionet_data.storage.snapshots.shard_record import ShardRecord


@dataclass(frozen=True)
class Release:
    """A split as its owner publishes it; the fields are described in ``releases.toml``."""

    inputs: int
    unit: str
    source: str
    scenarios: int | None = None
    shards: str = "*"


@dataclass(frozen=True)
class Coverage:
    """How much of a published split is there.

    Attributes:
        release: What is published.
        inputs: Raw inputs that are in the lake, whole.
        records: Scenarios that they gave, converted or quarantined.
    """

    release: Release
    inputs: int
    records: int

    @property
    def is_whole(self) -> bool:
        """Whether every input of the split is there."""
        return self.inputs >= self.release.inputs

    @property
    def is_as_published(self) -> bool | None:
        """Whether a whole split has as many inputs and scenarios as published; None for what cannot be compared."""
        if not self.is_whole:
            return None
        wanted = (self.release.inputs, self.release.scenarios or self.records)
        return (self.inputs, self.records) == wanted

    @property
    def text(self) -> str:
        """In a few words.

        Example:
            >>> Coverage(Release(1000, "files", "their names"), 12, 5847).text
            'incomplete: 12 of 1,000 files'
        """
        release = self.release
        if not self.is_whole:
            return f"incomplete: {self.inputs:,} of {release.inputs:,} {release.unit}"
        if self.inputs > release.inputs:
            return f"{self.inputs:,} {release.unit}, published are {release.inputs:,}"
        if release.scenarios is None:
            return f"whole: {self.inputs:,} {release.unit}; the number of scenarios is not published"
        published = "as published" if self.is_as_published else f"published are {release.scenarios:,}"
        return f"whole: {self.records:,} scenarios read, {published}"


@cache
def load() -> dict[tuple[str, str, str], Release]:
    """Published splits, by dataset, version and split."""
    declared = tomllib.loads(Path(__file__).with_name("releases.toml").read_text("utf-8"))
    return {
        (dataset, version, split): Release(**fields)
        for dataset, versions in declared.items()
        for version, splits in versions.items()
        for split, fields in splits.items()
    }


def coverage(partition: tuple[str, str, str], shards: Iterable[ShardRecord]) -> Coverage | None:
    """How much of a partition's published split is there; None when nothing is published about what is there.

    Args:
        partition: Dataset, version and split.
        shards: Of the lake.
    """
    release = load().get(partition)
    if release is None:
        return None
    found = [shard for shard in shards if (shard.dataset, shard.version, shard.split) == partition]
    of_release = [shard for shard in found if fnmatchcase(shard.name, release.shards)]
    if found and not of_release:
        return None
    held = [shard for shard in of_release if shard.max_scenarios is None]  # a quick look is no whole input
    inputs = {item for shard in held for item in shard.items}
    return Coverage(release, len(inputs), sum(shard.num_scenarios + shard.num_quarantined for shard in held))
