"""Which of the raw recordings to convert: chosen by what is known of them without reading them.

A shard knows its ``name``, the ``file`` of each of its inputs, and the facts that its converter tells of it and of
each input, for example a log's location and date.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Protocol

from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.input_properties import is_at_hand
from scenarionet_data.ingest.shard import RawItem, Shard

_SLICE = re.compile(r"(\d*):(\d*)")
_SHOWN = 5


class Choice(Protocol):
    """Chooses among the shards of raw recordings."""

    def of(self, shards: Iterable[Shard]) -> list[Shard]:
        """The shards with the wanted inputs, without those that have none."""
        ...


@dataclass(frozen=True)
class Selection:
    """What is wanted of the raw recordings; all of them unless told otherwise.

    Attributes:
        where: Shell patterns (``*``, ``?``, ``[...]``) by key, for example ``{"location": "us-nv-*"}``; all hold.
            One that has several values holds for one of them.
        files: Which of the raw inputs that are left, counted over all shards in their order.
    """

    where: Mapping[str, str] = field(default_factory=dict)
    files: slice = field(default_factory=lambda: slice(None))

    def of(self, shards: Iterable[Shard]) -> list[Shard]:
        """The shards with the wanted inputs, without those that have none.

        Raises:
            BadParameter: A key is unknown to every shard, or nothing is wanted.
        """
        if not self.where and self.files == slice(None):
            return list(shards)
        listed = list(shards)
        self._check_keys(listed)
        chosen = [
            replace(shard, items=tuple(item for item in shard.items if self._is_wanted(shard, item)))
            for shard in listed
        ]
        kept = [shard for shard in _sliced(chosen, self.files) if shard.items]
        if listed and not kept:
            raise BadParameter(f"nothing is left of {len(listed)} shards{self._advice(listed)}")
        return kept

    def _is_wanted(self, shard: Shard, item: RawItem) -> bool:
        return all(
            any(fnmatchcase(value, pattern) for value in _values(shard, item, key))
            for key, pattern in self.where.items()
        )

    def _check_keys(self, shards: list[Shard]) -> None:
        told = {key for shard in shards for item in shard.items for key in (*shard.facts, *item.facts)}
        known = {"file", "name"} | told
        unknown = sorted(set(self.where) - known)
        if unknown and shards:
            is_here = all(is_at_hand(path) for shard in shards for path in shard.paths)
            hint = "" if is_here else "; to choose by what recordings in an object store hold, copy them to a folder"
            raise BadParameter(f"--where {unknown[0]}: known before reading are {', '.join(sorted(known))}{hint}")

    def _advice(self, shards: list[Shard]) -> str:
        """The values there are, for the first key."""
        for key in self.where:
            values = sorted({v for shard in shards for item in shard.items for v in _values(shard, item, key)})
            more = ", ..." if len(values) > _SHOWN else ""
            return f"; there is {key} {', '.join(values[:_SHOWN])}{more}"
        return f"; --files counts {sum(len(shard.items) for shard in shards)} raw inputs, from 0"


def _values(shard: Shard, item: RawItem, key: str) -> tuple[str, ...]:
    """What is known of an input under a key; nothing where that is not known."""
    for known in ({"name": shard.name, "file": item.name}, item.facts, shard.facts):
        value = known.get(key)
        if value is not None:
            return (value,) if isinstance(value, str) else value
    return ()


def _sliced(shards: list[Shard], files: slice) -> list[Shard]:
    """The shards with those inputs whose number, over all shards, is in the slice."""
    numbers = range(sum(len(shard.items) for shard in shards))[files]
    kept, first = [], 0
    for shard in shards:
        items = tuple(item for number, item in enumerate(shard.items, start=first) if number in numbers)
        first += len(shard.items)
        kept.append(replace(shard, items=items))
    return kept


def parse_slice(text: str) -> slice:
    """``START:END`` with either left out, from 0, END not included.

    Raises:
        BadParameter: It is none.

    Example:
        >>> parse_slice("0:10")
        slice(0, 10, None)
    """
    match = _SLICE.fullmatch(text)
    if not match:
        raise BadParameter(f"--files wants START:END, for example 0:10, found {text!r}")
    start, end = (int(number) if number else None for number in match.groups())
    return slice(start, end)
