"""Coverage of published splits by a lake, compared with the numbers that dataset owners publish (``releases.toml``)."""

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
    """Published numbers of a split; the fields are described in ``releases.toml``."""

    inputs: int
    unit: str
    source: str
    scenarios: int | None = None
    shards: str = "*"


@dataclass(frozen=True)
class Coverage:
    """Coverage of a published split.

    Attributes:
        release: The published numbers.
        inputs: Number of raw inputs that are completely in the lake.
        records: Number of their scenarios, converted or quarantined.
    """

    release: Release
    inputs: int
    records: int

    @property
    def is_whole(self) -> bool:
        """Whether the lake has every input of the split."""
        return self.inputs >= self.release.inputs

    @property
    def is_as_published(self) -> bool | None:
        """Whether a complete split has the published numbers of inputs and scenarios; None if it is incomplete."""
        if not self.is_whole:
            return None
        wanted = (self.release.inputs, self.release.scenarios or self.records)
        return (self.inputs, self.records) == wanted

    @property
    def text(self) -> str:
        """The coverage in a few words.

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
    """Load the published splits, by dataset, version and split."""
    declared = tomllib.loads(Path(__file__).with_name("releases.toml").read_text("utf-8"))
    return {
        (dataset, version, split): Release(**fields)
        for dataset, versions in declared.items()
        for version, splits in versions.items()
        for split, fields in splits.items()
    }


def coverage(partition: tuple[str, str, str], shards: Iterable[ShardRecord]) -> Coverage | None:
    """Return the coverage of a partition's published split; None if no numbers are published for it.

    Args:
        partition: Dataset, version and split.
        shards: Shards of the lake.
    """
    release = load().get(partition)
    if release is None:
        return None
    found = [shard for shard in shards if (shard.dataset, shard.version, shard.split) == partition]
    of_release = [shard for shard in found if fnmatchcase(shard.name, release.shards)]
    if found and not of_release:
        return None
    complete = [
        shard for shard in of_release if shard.max_scenarios is None
    ]  # a limited conversion does not cover its input
    inputs = {item for shard in complete for item in shard.items}
    return Coverage(release, len(inputs), sum(shard.num_scenarios + shard.num_quarantined for shard in complete))
