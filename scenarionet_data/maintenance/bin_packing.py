"""Plan a compaction: group the shards that are worth rewriting into bins."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase

from scenarionet_data.errors import BadParameter
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.places import LakeFilesLike, open_files
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord
from scenarionet_data.storage.write import layouts
from scenarionet_data.storage.write.layouts import Layout

_SCENARIOS_PER_BIN = 1024
_MIN_FILL = 0.5
"""Files below this fill level are merged with others; rewriting fuller ones is not worth the work."""
_KEYS = ("dataset", "version", "split")


@dataclass(frozen=True)
class Bin:
    """Shards to write together; picklable.

    Attributes:
        lake: The lake's root.
        profile: Name of the profile.
        records: The current shards, all of one partition.
    """

    lake: str
    profile: str
    records: tuple[ShardRecord, ...]

    @property
    def num_scenarios(self) -> int:
        """Number of scenarios in its shards."""
        return sum(record.num_scenarios for record in self.records)


def plan_compaction(
    lake: LakeFilesLike, profile: str = "training", *, where: Mapping[str, str] | None = None
) -> list[Bin]:
    """Return the bins that :func:`.compact` would rewrite: up to 1,024 scenarios each, or a single larger shard.

    Raises:
        BadParameter: Unknown profile, or unknown key in ``where``.
        NoSuchSnapshot: Not a lake.
    """
    wanted, patterns, files = layouts.load(profile), dict(where or {}), open_files(lake)
    for key in sorted(set(patterns) - set(_KEYS)):
        raise BadParameter(f"where: unknown key {key!r}; select by {', '.join(_KEYS)}")
    base = snapshots.newest(files)
    manifests.schema_versions(files, base)
    groups: dict[tuple[str, ...], list[ShardRecord]] = defaultdict(list)
    for record in manifests.shards(files, base):
        if record.num_scenarios and all(fnmatchcase(getattr(record, key), patterns[key]) for key in patterns):
            # Only shards converted with the same converter version and options share files.
            kind = (record.dataset, record.version, record.split, record.converter_version, record.options)
            groups[kind].append(record)
    found = [bin_ for kind in sorted(groups) for bin_ in _bins(groups[kind], wanted)]
    return [Bin(str(files.root), profile, tuple(records)) for records in found]


def _bins(records: Iterable[ShardRecord], profile: Layout) -> Iterator[list[ShardRecord]]:
    """Group shards to write together; skip those with a good layout."""
    units: dict[str, list[ShardRecord]] = defaultdict(list)
    for record in records:
        units[layouts.unit_of(record)].append(record)
    loose = [unit for unit in units.values() if not _has_good_layout(unit, profile, _MIN_FILL)]
    bins, count = list[list[list[ShardRecord]]](), 0
    for unit in loose:
        size = sum(record.num_scenarios for record in unit)
        if not bins or count + size > _SCENARIOS_PER_BIN:
            bins.append([])
            count = 0
        bins[-1].append(unit)
        count += size
    for together in bins:
        is_alone = len(together) == 1
        if not (is_alone and _has_good_layout(together[0], profile, 0.0)):
            yield [record for unit in together for record in unit]


def _has_good_layout(unit: list[ShardRecord], profile: Layout, filled: float) -> bool:
    """Whether shards have a profile's layout, in the minimum number of files, filled to at least ``filled``."""
    num_files = sum(name.startswith("tracks/") for name in content_sizes(unit))
    scenarios = sum(record.num_scenarios for record in unit)
    is_least = num_files <= profile.num_files(scenarios)
    is_filled = scenarios >= filled * num_files * profile.scenarios_per_file
    return layouts.layout_of(unit[0]) == profile and (is_least if not filled else is_filled)


def content_sizes(records: Iterable[ShardRecord]) -> dict[str, int]:
    """Size of each file of tracks, lights and maps of some shards."""
    return {
        name: size
        for record in records
        for name, size in zip(record.files, record.sizes, strict=True)
        if name.split("/")[0] in tables.LOADED
    }
