"""Plans: which shards of the raw recordings are left to convert, given the shards in the lake."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from functools import partial
from pathlib import Path
from typing import Protocol

from scenarionet_data.errors import BadParameter, DuplicateScenario
from scenarionet_data.ingest.input_properties import is_local
from scenarionet_data.ingest.passed_over import PassedOver
from scenarionet_data.ingest.shard import ABSENT, RawItem, Shard
from scenarionet_data.schema import tables
from scenarionet_data.storage.snapshots.shard_record import ShardRecord


@dataclass(frozen=True)
class ConversionPlan:
    """Work to do.

    Attributes:
        shards: Shards to convert, in order.
        num_skipped: Number of shards that are in the lake already.
        replaced: Key of each old shard that is removed, with the inputs that have to be converted before.
        num_stale: Number of shards in the lake written by another converter version and kept.
        passed_over: Raw files that were recognised and not used.
    """

    shards: tuple[Shard, ...]
    num_skipped: int
    replaced: Mapping[str, frozenset[str]]
    num_stale: int
    passed_over: tuple[PassedOver, ...] = ()

    @property
    def replacing(self) -> list[Shard]:
        """Shards that replace old ones."""
        old = {item for items in self.replaced.values() for item in items}
        return [shard for shard in self.shards if any(item.name in old for item in shard.items)]

    def settle(self, finished: Sequence[ShardRecord]) -> tuple[list[ShardRecord], frozenset[str]]:
        """Finished shards that may be committed, and keys of the old shards to remove with them.

        An old shard is removed once all of its inputs are converted again. Until then the new shards that replace it
        wait; the next run adopts them.
        """
        if not self.replaced:
            return list(finished), frozenset()
        ready = list(finished)
        while True:
            inputs = {item for record in ready for item in record.items}
            removed = frozenset(key for key, items in self.replaced.items() if items <= inputs)
            waiting = {item for key, items in self.replaced.items() if key not in removed for item in items}
            kept = [record for record in ready if waiting.isdisjoint(record.items)]
            if len(kept) == len(ready):
                return kept, removed
            ready = kept


def make_plan(
    wanted: Iterable[Shard],
    existing: Sequence[ShardRecord],
    converter_version: str,
    *,
    may_replace: bool = False,
    reconvert_stale: bool = False,
) -> ConversionPlan:
    """Decide input by input: convert new ones, skip known ones, refuse or replace changed ones.

    An input that was absent when the lake's shard was converted is new once it is present.

    Args:
        wanted: Shards of the raw recordings.
        existing: Shards in the lake.
        converter_version: Version of the converter that would run.
        may_replace: Replace shards with other options, changed inputs or another converter version.
        reconvert_stale: Replace shards written by another converter version.

    Raises:
        DuplicateScenario: An input is in the lake with other options or other content and ``may_replace`` is False;
            or a replaced shard has inputs that are not among the wanted ones.
    """
    owners: dict[tuple[str, str, str, str], ShardRecord] = {}
    absent: set[tuple[str, str, str, str]] = set()
    for record in existing:
        for name, mark in zip(record.items, record.fingerprints, strict=True):
            address = (record.dataset, record.version, record.split, name)
            if mark != ABSENT or address not in owners:  # a shard that contains the input precedes one that lacked it
                owners[address] = record
                (absent.add if mark == ABSENT else absent.discard)(address)
    shards: list[Shard] = []
    num_skipped = 0
    replaced: dict[str, ShardRecord] = {}
    stale: set[str] = set()
    listed: list[tuple[Shard, list[ShardRecord | None]]] = []
    for shard in wanted:
        listed.append((shard, []))
        for item in shard.items:
            address = (shard.dataset, shard.version, shard.split, item.name)
            owner = None if address in absent and item.fingerprint != ABSENT else owners.get(address)
            listed[-1][1].append(owner)
            if owner and _is_outdated(owner, shard, item, converter_version, may_replace, reconvert_stale):
                replaced[owner.key] = owner
            elif owner and (owner.converter_version, owner.schemas) != (converter_version, tables.content_tag()):
                stale.add(owner.key)
    for shard, found in listed:  # after the loop above: a replaced shard may share its inputs with several new ones
        missing = []
        for item, owner in zip(shard.items, found, strict=True):
            if owner is None or owner.key in replaced:
                missing.append(item)
        if missing:
            shards.append(replace(shard, items=tuple(missing)))
        else:
            num_skipped += 1
    needed = {}
    for key, record in replaced.items():
        marks = zip(record.items, record.fingerprints, strict=True)
        needed[key] = frozenset(name for name, mark in marks if mark != ABSENT)
    converted = {item.name for shard in shards for item in shard.items if item.fingerprint != ABSENT}
    for key, record in replaced.items():
        lost = sorted(needed[key] - converted)
        if lost and record.max_scenarios is None:
            raise DuplicateScenario(
                f"replacing shard {record.name} would drop {lost[0]}, which is not among the given recordings; "
                "give the whole raw folder"
            )
    return ConversionPlan(tuple(shards), num_skipped, needed, len(stale - set(replaced)))


def _is_outdated(
    owner: ShardRecord, shard: Shard, item: RawItem, converter_version: str, may_replace: bool, reconvert_stale: bool
) -> bool:
    """Whether the lake's shard ``owner`` has to be replaced for ``item`` of ``shard``."""
    if owner.options != shard.options_text:
        reason = f"with other options ({owner.options})"
    elif not tables.reads_content(owner.schemas):
        reason = f"under another version of the contract ({owner.schemas})"
    elif item.fingerprint not in (ABSENT, owner.fingerprints[owner.items.index(item.name)]):
        reason = "and has changed since"
    elif owner.max_scenarios is not None:
        return True
    else:
        is_stale = owner.converter_version != converter_version or owner.schemas != tables.content_tag()
        return is_stale and (reconvert_stale or may_replace)
    if not may_replace:
        raise DuplicateScenario(
            f"{item.name} is in the lake already, converted {reason}; pass replace=True to replace it, "
            f"or another version to keep both (the lake has {owner.dataset} {owner.version})"
        )
    return True


def largest_first(shards: Iterable[Shard]) -> list[Shard]:
    """Sort shards by decreasing file size, then by number of inputs.

    A large shard at the end would keep one worker busy while the others are idle.
    """

    def size(path: Path) -> int:
        try:
            return path.stat().st_size
        except OSError:  # a seed, or part of a file; an unreadable file is reported when it is converted
            return 0

    return sorted(shards, key=lambda shard: (-sum(map(size, shard.paths)), -len(shard.items), shard.name))


_SLICE = re.compile(r"(\d*):(\d*)")
_SHOWN = 5


class ShardFilter(Protocol):
    """Selects among the shards of raw recordings."""

    def select(self, shards: Iterable[Shard]) -> list[Shard]:
        """Shards reduced to the selected inputs, without those that have none."""
        ...


@dataclass(frozen=True)
class InputSelection:
    """Raw inputs to convert; all of them by default.

    Attributes:
        where: Shell patterns (``*``, ``?``, ``[...]``) by property, for example ``{"location": "us-nv-*"}``. All have
            to match; a property with several values matches if one of them does.
        files: Slice of the matching inputs, counted over all shards in order.
    """

    where: Mapping[str, str] = field(default_factory=dict)
    files: slice = field(default_factory=partial(slice, None))

    def select(self, shards: Iterable[Shard]) -> list[Shard]:
        """Shards reduced to the selected inputs, without those that have none.

        Raises:
            BadParameter: A property is unknown to every shard, or nothing matches.
        """
        if not self.where and self.files == slice(None):
            return list(shards)
        listed = list(shards)
        self._check_properties(listed)
        matching = [
            replace(shard, items=tuple(item for item in shard.items if self._matches(shard, item))) for shard in listed
        ]
        numbers = range(sum(len(shard.items) for shard in matching))[self.files]
        selected, first = [], 0
        for shard in matching:
            items = tuple(item for number, item in enumerate(shard.items, start=first) if number in numbers)
            first += len(shard.items)
            if items:
                selected.append(replace(shard, items=items))
        if listed and not selected:
            raise BadParameter(f"the selection matches nothing in {len(listed)} shards{self._hint(listed)}")
        return selected

    def _matches(self, shard: Shard, item: RawItem) -> bool:
        return all(
            any(fnmatchcase(value, pattern) for value in _values(shard, item, key))
            for key, pattern in self.where.items()
        )

    def _check_properties(self, shards: list[Shard]) -> None:
        listed = {key for shard in shards for item in shard.items for key in (*shard.properties, *item.properties)}
        known = {"file", "name"} | listed
        unknown = sorted(set(self.where) - known)
        if unknown and shards:
            are_local = all(is_local(path) for shard in shards for path in shard.paths)
            hint = "" if are_local else "; to select by the content of recordings in an object store, copy them first"
            raise BadParameter(
                f"unknown property {unknown[0]!r}: inputs can be selected by {', '.join(sorted(known))}{hint}"
            )

    def _hint(self, shards: list[Shard]) -> str:
        """Existing values of the first property, or the number of inputs."""
        for key in self.where:
            values = sorted({v for shard in shards for item in shard.items for v in _values(shard, item, key)})
            more = ", ..." if len(values) > _SHOWN else ""
            return f"; values of {key}: {', '.join(values[:_SHOWN])}{more}"
        return f"; there are {sum(len(shard.items) for shard in shards)} raw inputs, numbered from 0"


def _values(shard: Shard, item: RawItem, key: str) -> tuple[str, ...]:
    """Values of an input's property; empty if unknown."""
    for known in ({"name": shard.name, "file": item.name}, item.properties, shard.properties):
        value = known.get(key)
        if value is not None:
            return (value,) if isinstance(value, str) else value
    return ()


def parse_slice(text: str) -> slice:
    """Parse ``START:END``; either may be left out, END is exclusive.

    Raises:
        BadParameter: Invalid text.

    Example:
        >>> parse_slice("0:10")
        slice(0, 10, None)
    """
    match = _SLICE.fullmatch(text)
    if not match:
        raise BadParameter(f"--files takes START:END, for example 0:10, found {text!r}")
    start, end = (int(number) if number else None for number in match.groups())
    return slice(start, end)
