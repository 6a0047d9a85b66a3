"""Shards: small, picklable units of conversion work, and the raw items they consist of."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.errors import BadParameter, CorruptSource
from scenarionet_data.ingest.input_properties import InputProperties
from scenarionet_data.ingest.options import Options
from scenarionet_data.scenario.settings import check_is

OptionsType = TypeVar("OptionsType", bound=Options)

ABSENT = "absent"
"""Fingerprint of a listed input without a readable file; it is quarantined, and converted once it has one."""


@dataclass(frozen=True)
class RawItem:
    """One raw input of a shard: a file, the folder of one scenario, or a seed.

    Attributes:
        name: Relative to the raw folder; the same on every machine.
        fingerprint: Changes with the content, see :func:`fingerprint`; ``ABSENT`` without a file.
        properties: Its properties, in addition to the shard's.

    Raises:
        CorruptSource: The name is not UTF-8, which a lake cannot record; the message shows its bytes.
    """

    name: str
    fingerprint: str
    properties: InputProperties = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        try:
            self.name.encode()
        except UnicodeEncodeError as error:
            shown = self.name.encode(errors="backslashreplace").decode()
            raise CorruptSource(f"{shown}: the name is not UTF-8; rename the file or folder") from error


@dataclass(frozen=True)
class Shard:
    """The unit of work, commit, retry and resume; small and picklable.

    Attributes:
        dataset, version, split: Partition of the lake.
        name: Names the shard's files; ``[A-Za-z0-9._-]+``, unique within the partition.
        root: The raw folder, or its URL in an object store; not part of the key, so recordings may be moved.
        items: Raw inputs. Inputs that are in the lake already are removed before the shard is converted.
        options: The converter's options.
        properties: Properties of all its items; not part of the key.
    """

    dataset: str
    version: str
    split: str
    name: str
    root: str
    items: tuple[RawItem, ...]
    options: Options
    properties: InputProperties = field(default_factory=dict, hash=False)

    def options_as(self, kind: type[OptionsType]) -> OptionsType:
        """Return the options, which are of a converter's class.

        Raises:
            BadParameter: They are another converter's.
        """
        if not isinstance(self.options, kind):
            raise BadParameter(f"{self.name}: expected {kind.__name__}, found {type(self.options).__name__}")
        return self.options

    @property
    def options_text(self) -> str:
        """The options that the output depends on, as canonical JSON."""
        return json.dumps(self.options.identity, sort_keys=True)

    @property
    def paths(self) -> list[Path]:
        """Paths of the items."""
        return [Path(self.root) / item.name for item in self.items]

    def key(self, converter_version: str) -> str:
        """16 hex digits that depend on the inputs, options and converter, and not on the machine."""
        identity = [self.dataset, self.version, self.split, self.name, self.options_text, converter_version]
        for item in self.items:
            identity.append(f"{item.name}={item.fingerprint}")
        return hashlib.blake2b("\n".join(identity).encode(), digest_size=8).hexdigest()


def fingerprint(paths: Iterable[Path], sample: int = 65536) -> str:
    """16 hex digits that change with the files' names, sizes, and first or last ``sample`` bytes.

    Hashing whole recordings would cost as much as converting them.

    Raises:
        CorruptSource: A file cannot be opened: no permission, or a link that leads nowhere.
    """
    check_is("paths", paths, Iterable, "several Paths")
    digest = hashlib.blake2b(digest_size=8)
    for path in paths:
        check_is("path", path, Path, "a Path")
        try:
            with path.open("rb") as file:
                size = os.fstat(file.fileno()).st_size
                digest.update(os.fsencode(f"{path.name}:{size}\n"))
                digest.update(file.read(sample))
                if size > sample:
                    file.seek(max(sample, size - sample))
                    digest.update(file.read(sample))
        except OSError as error:
            raise CorruptSource(f"{path}: cannot be read ({error.strerror}); repair or remove it") from error
    return digest.hexdigest()


def bucket(items: Iterable[RawItem], size: int = 64) -> dict[str, tuple[RawItem, ...]]:
    """Group items of one scenario each into buckets by a hash of their name.

    The number of buckets is a power of two, with about ``size`` items in each, so that a growing dataset rarely
    changes its buckets.

    Returns:
        Bucket name to its items, both sorted.
    """
    items = list(items) if isinstance(items, Iterable) else [items]
    for item in items:
        if not isinstance(item, RawItem):
            raise BadParameter(f"items: expected RawItems, found {item!r}")
    if not is_count(size, 1):
        raise BadParameter(f"size={size!r}; expected a whole number of 1 or more")
    ordered = sorted(items, key=lambda item: item.name)
    count = 1
    while count * size < len(ordered):
        count *= 2
    buckets: dict[str, list[RawItem]] = {}
    for item in ordered:
        number = int.from_bytes(hashlib.blake2b(item.name.encode(), digest_size=8).digest(), "big") % count
        buckets.setdefault(f"{number:05d}-of-{count:05d}", []).append(item)
    return {name: tuple(buckets[name]) for name in sorted(buckets)}
