"""Bins: which of a lake's shards are worth rewriting in a profile, and which of them together."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from fnmatch import fnmatchcase

from scenarionet_data.errors import BadParameter
from scenarionet_data.storage.files.opening import LakeLike, open_files
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.shard_record import ShardRecord
from scenarionet_data.storage.write import layouts, rewriting
from scenarionet_data.storage.write.layouts import Layout

_SCENARIOS_PER_BIN = 1024
_WELL_FILLED = 0.5
"""Files that are filled less are merged with others; those filled more are not worth the work."""
_KEYS = ("dataset", "version", "split")


@dataclass(frozen=True)
class Bin:
    """Shards to be written together; picklable.

    Attributes:
        lake: The lake's root.
        profile: Name of the profile.
        records: The shards as they are, of one partition.
    """

    lake: str
    profile: str
    records: tuple[ShardRecord, ...]

    @property
    def num_scenarios(self) -> int:
        """Scenarios of its shards."""
        return sum(record.num_scenarios for record in self.records)


def plan_compaction(lake: LakeLike, profile: str = "training", *, where: Mapping[str, str] | None = None) -> list[Bin]:
    """What :func:`.compact` would rewrite: bins of up to 1,024 scenarios; a larger shard is a bin of its own.

    Raises:
        BadParameter: There is no such profile, or ``where`` names something else.
        NoSuchSnapshot: There is no lake.
    """
    wanted, patterns, files = layouts.load(profile), dict(where or {}), open_files(lake)
    for key in sorted(set(patterns) - set(_KEYS)):
        raise BadParameter(f"--where {key}: choose by {', '.join(_KEYS)}")
    base = snapshots.newest(files)
    manifests.check_schemas(files, base)
    kinds: dict[tuple[str, ...], list[ShardRecord]] = defaultdict(list)
    for record in manifests.shards(files, base):
        if record.num_scenarios and all(fnmatchcase(getattr(record, key), patterns[key]) for key in patterns):
            # What was converted alike stays told apart from the rest.
            kind = (record.dataset, record.version, record.split, record.converter_version, record.options)
            kinds[kind].append(record)
    found = [bin_ for kind in sorted(kinds) for bin_ in _bins(kinds[kind], wanted)]
    return [Bin(str(files.root), profile, tuple(records)) for records in found]


def _bins(records: Iterable[ShardRecord], profile: Layout) -> Iterator[list[ShardRecord]]:
    """Shards to write together; those that lie well already are left out."""
    units: dict[str, list[ShardRecord]] = defaultdict(list)
    for record in records:
        units[layouts.unit_of(record)].append(record)
    loose = [unit for unit in units.values() if not _is_well(unit, profile, _WELL_FILLED)]
    for together in _filled(loose):
        is_alone = len(together) == 1
        if not (is_alone and _is_well(together[0], profile, 0.0)):
            yield [record for unit in together for record in unit]


def _is_well(unit: list[ShardRecord], profile: Layout, filled: float) -> bool:
    """Whether shards lie in files of a profile, no more than they need, and filled at least that much."""
    num_files = sum(name.startswith("tracks/") for name in content_sizes(unit))
    scenarios = sum(record.num_scenarios for record in unit)
    is_least = num_files <= profile.num_files(scenarios)
    is_filled = scenarios >= filled * num_files * profile.scenarios_per_file
    return layouts.layout_of(unit[0]) == profile and (is_least if not filled else is_filled)


def _filled(units: list[list[ShardRecord]]) -> Iterator[list[list[ShardRecord]]]:
    """Units in order, as many together as make a bin."""
    together: list[list[ShardRecord]] = []
    count = 0
    for unit in units:
        size = sum(record.num_scenarios for record in unit)
        if together and count + size > _SCENARIOS_PER_BIN:
            yield together
            together, count = [], 0
        together.append(unit)
        count += size
    if together:
        yield together


def content_sizes(records: Iterable[ShardRecord]) -> dict[str, int]:
    """Size of each file of tracks, lights and maps that some shards lie in."""
    return {
        name: size
        for record in records
        for name, size in zip(record.files, record.sizes, strict=True)
        if name.split("/")[0] in rewriting.TABLES
    }
