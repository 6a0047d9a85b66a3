"""Shards: small, picklable units of conversion work, and the raw items they consist of."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path

from scenarionet_data.ingest.input_properties import Facts


@dataclass(frozen=True)
class RawItem:
    """One raw input of a shard: a file, a folder of one scenario, a seed.

    Attributes:
        name: Relative to the raw folder; the same on every machine.
        fingerprint: Changes when the content does, see :func:`fingerprint`.
        facts: What is known of it besides the shard's facts.
    """

    name: str
    fingerprint: str
    facts: Facts = field(default_factory=dict, hash=False)


@dataclass(frozen=True)
class Options:
    """What a converter can be told; subclasses add fields with defaults and ``metadata={"doc": ...}``.

    A field with ``"is_place": True`` too says where something lies on this machine: it does not tell shards apart.
    """

    @property
    def places(self) -> dict[str, str]:
        """The fields that say where something lies; may be empty texts, or several paths joined as in ``$PATH``."""
        return {each.name: getattr(self, each.name) for each in fields(self) if each.metadata.get("is_place")}


@dataclass(frozen=True)
class Shard:
    """The unit of work, commit, retry and resume; small and picklable.

    Attributes:
        dataset, version, split: Partition of the lake.
        name: Names the shard's files; ``[A-Za-z0-9._-]+``, unique within the partition.
        root: The raw folder, or its URL in an object store; not part of the key, so that recordings may move.
        items: Raw inputs; when some of them are in the lake already, the rest becomes the shard.
        options: The converter's options.
        facts: What is known of all its items; not part of the key.
    """

    dataset: str
    version: str
    split: str
    name: str
    root: str
    items: tuple[RawItem, ...]
    options: Options
    facts: Facts = field(default_factory=dict, hash=False)

    @property
    def options_text(self) -> str:
        """The options as canonical JSON, but for those that say where something lies."""
        places = self.options.places
        told = {name: value for name, value in asdict(self.options).items() if name not in places}
        return json.dumps(told, sort_keys=True)

    @property
    def paths(self) -> list[Path]:
        """Where the items lie."""
        return [Path(self.root) / item.name for item in self.items]

    def key(self, converter_version: str) -> str:
        """16 hex digits: the same for the same input, options and converter, on every machine."""
        identity = [self.dataset, self.version, self.split, self.name, self.options_text, converter_version]
        identity += [f"{item.name}={item.fingerprint}" for item in self.items]
        return hashlib.blake2b("\n".join(identity).encode(), digest_size=8).hexdigest()


def fingerprint(paths: Iterable[Path], sample: int = 65536) -> str:
    """16 hex digits that change with the files' names, sizes, first or last ``sample`` bytes.

    Reading whole recordings to list them would cost as much as converting them.
    """
    digest = hashlib.blake2b(digest_size=8)
    for path in paths:
        size = path.stat().st_size
        digest.update(f"{path.name}:{size}\n".encode())
        with path.open("rb") as file:
            digest.update(file.read(sample))
            if size > sample:
                file.seek(max(sample, size - sample))
                digest.update(file.read(sample))
    return digest.hexdigest()


def bucket(items: Iterable[RawItem], size: int = 64) -> dict[str, tuple[RawItem, ...]]:
    """Groups items of one scenario each into buckets by a hash of their name.

    The number of buckets is a power of two, so that about ``size`` items share one and a growing dataset
    keeps its buckets for long.

    Returns:
        Bucket name to its items, both sorted.
    """
    ordered = sorted(items, key=lambda item: item.name)
    count = 1
    while count * size < len(ordered):
        count *= 2
    buckets: dict[str, list[RawItem]] = {}
    for item in ordered:
        number = int.from_bytes(hashlib.blake2b(item.name.encode(), digest_size=8).digest(), "big") % count
        buckets.setdefault(f"{number:05d}-of-{count:05d}", []).append(item)
    return {name: tuple(buckets[name]) for name in sorted(buckets)}
