"""Select raw inputs to convert by properties that are known before the recordings are read.

Known are the shard's ``name``, the ``file`` of each input, and the properties that the converter lists for the shard
and for each input, for example a log's location and date.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Protocol

from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.input_properties import is_local
from scenarionet_data.ingest.shard import RawItem, Shard

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
    files: slice = field(default_factory=lambda: slice(None))

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
