"""What is left to convert: the shards of the raw recordings, less what the lake holds already."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from scenarionet_data.errors import DuplicateScenario
from scenarionet_data.ingest.shard import RawItem, Shard
from scenarionet_data.schema import tables
from scenarionet_data.storage.snapshots.shard_record import ShardRecord


@dataclass(frozen=True)
class Plan:
    """Work to do.

    Attributes:
        shards: To convert, in order.
        num_skipped: Shards the lake holds already.
        replaced: Key of each shard in the lake that makes way, with the inputs that must be converted first.
        num_stale: Shards in the lake that another converter version wrote, and that stay.
    """

    shards: tuple[Shard, ...]
    num_skipped: int
    replaced: Mapping[str, frozenset[str]]
    num_stale: int

    @property
    def anew(self) -> list[Shard]:
        """Those of the shards that take the place of some in the lake."""
        old = {item for items in self.replaced.values() for item in items}
        return [shard for shard in self.shards if any(item.name in old for item in shard.items)]

    def settle(self, finished: Sequence[ShardRecord]) -> tuple[list[ShardRecord], frozenset[str]]:
        """What may be committed of the finished shards, and which old shards then go.

        An old shard goes when all of its inputs have been converted anew; until then the new shards that
        would take its place wait (the next run adopts them).
        """
        ready = list(finished)
        while True:
            coming = {item for record in ready for item in record.items}
            gone = frozenset(key for key, items in self.replaced.items() if items <= coming)
            waiting = {item for key, items in self.replaced.items() if key not in gone for item in items}
            kept = [record for record in ready if waiting.isdisjoint(record.items)]
            if len(kept) == len(ready):
                return kept, gone
            ready = kept


def make_plan(
    wanted: Iterable[Shard],
    held: Sequence[ShardRecord],
    converter_version: str,
    *,
    replace_old: bool = False,
    stale: bool = False,
) -> Plan:
    """Decide item by item: new inputs are converted, known ones skipped, changed ones refused or replaced.

    Args:
        wanted: Shards of the raw recordings.
        held: Shards of the lake.
        converter_version: Version that would convert.
        replace_old: Replace shards with other options, changed inputs or another converter version.
        stale: Replace shards of another converter version.

    Raises:
        DuplicateScenario: An input is in the lake with other options or other content, and ``replace_old`` is
            False; or a replaced shard holds inputs that are not among the wanted.
    """
    owners = _owners(held)
    replaced: dict[str, ShardRecord] = {}
    old: set[str] = set()
    planned = list(wanted)
    for shard in planned:
        for item in shard.items:
            owner = owners.get(_place(shard, item))
            if owner and _must_go(owner, shard, item, converter_version, replace_old, stale):
                replaced[owner.key] = owner
            elif owner and owner.converter_version != converter_version:
                old.add(owner.key)
    shards = [_without_held(shard, owners, replaced) for shard in planned]
    left = tuple(shard for shard in shards if shard.items)
    _check_nothing_is_lost(left, replaced.values())
    needed = {key: frozenset(record.items) for key, record in replaced.items()}
    return Plan(left, len(shards) - len(left), needed, len(old - set(replaced)))


def _without_held(
    shard: Shard, owners: Mapping[tuple[str, str, str, str], ShardRecord], replaced: Mapping[str, ShardRecord]
) -> Shard:
    """The shard with only those inputs that the lake lacks or is about to replace."""
    left = []
    for item in shard.items:
        owner = owners.get(_place(shard, item))
        if owner is None or owner.key in replaced:
            left.append(item)
    return replace(shard, items=tuple(left))


def _place(shard: Shard, item: RawItem) -> tuple[str, str, str, str]:
    return shard.dataset, shard.version, shard.split, item.name


def _owners(held: Sequence[ShardRecord]) -> dict[tuple[str, str, str, str], ShardRecord]:
    return {(record.dataset, record.version, record.split, item): record for record in held for item in record.items}


def _must_go(
    owner: ShardRecord, shard: Shard, item: RawItem, converter_version: str, replace_old: bool, stale: bool
) -> bool:
    """Whether the lake's shard has to make way for ``item`` of ``shard``."""
    if owner.options != shard.options_text:
        _refuse_unless(replace_old, item, owner, f"with other options ({owner.options})")
        return True
    if owner.schemas != tables.content_tag():
        _refuse_unless(replace_old, item, owner, f"under another version of the contract ({owner.schemas})")
        return True
    if owner.fingerprints[owner.items.index(item.name)] != item.fingerprint:
        _refuse_unless(replace_old, item, owner, "and has changed since")
        return True
    if owner.max_scenarios is not None:
        return True
    return owner.converter_version != converter_version and (stale or replace_old)


def _refuse_unless(is_allowed: bool, item: RawItem, owner: ShardRecord, why: str) -> None:
    if not is_allowed:
        raise DuplicateScenario(
            f"{item.name} is in the lake already, converted {why}; add --replace to take its place, "
            f"or --version to keep both (the lake has {owner.dataset} {owner.version})"
        )


def _check_nothing_is_lost(shards: Iterable[Shard], replaced: Iterable[ShardRecord]) -> None:
    coming = {item.name for shard in shards for item in shard.items}
    for record in replaced:
        lost = [name for name in record.items if name not in coming]
        if lost and record.max_scenarios is None:
            raise DuplicateScenario(
                f"replacing shard {record.name} would drop {lost[0]}, which is not among the recordings given; "
                "give the whole raw folder"
            )


def largest_first(shards: Iterable[Shard]) -> list[Shard]:
    """Shards by the size of their files, then by the number of their inputs.

    A large one at the end would keep one worker busy while the others have nothing left to do.
    """
    return sorted(shards, key=lambda shard: (-sum(map(_size, shard.paths)), -len(shard.items), shard.name))


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:  # a seed, or something inside of a file; who cannot read a file says so when it is converted
        return 0
