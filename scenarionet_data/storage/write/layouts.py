"""File layouts: one scenario per row group for training (as converted) and archives, or many together for analytics.

The name of a shard's metadata file tells which layout the shard was rewritten to, without opening the file.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from scenarionet_data.errors import BadParameter
from scenarionet_data.storage.snapshots.shard_record import ShardRecord, partition
from scenarionet_data.storage.write.shard_writer import SCENARIOS_PER_FILE

_MARK = re.compile(r"-(training|analytics|archive)-([0-9a-f]{16})\.parquet$")


@dataclass(frozen=True)
class Layout:
    """Number of scenarios in row groups and files.

    Attributes:
        name: The purpose.
        scenarios_per_group: Scenarios that share a row group.
        scenarios_per_file: Scenarios in a file at most.
        zstd_level: Level of zstd for all columns; those that scenarios are decoded from are in LZ4 by default.
    """

    name: str
    scenarios_per_group: int
    scenarios_per_file: int
    zstd_level: int | None = None

    def num_files(self, num_scenarios: int) -> int:
        """Files of each table for this number of scenarios."""
        return math.ceil(num_scenarios / self.scenarios_per_file)


LAYOUTS = {
    "training": Layout("training", 1, SCENARIOS_PER_FILE),
    "analytics": Layout("analytics", 16, 1024),
    "archive": Layout("archive", 1, SCENARIOS_PER_FILE, zstd_level=9),
}


def load(name: str) -> Layout:
    """The layout of that name.

    Raises:
        BadParameter: No such layout; the message lists the existing ones.
    """
    if name not in LAYOUTS:
        raise BadParameter(f"no profile {name!r}; choose one of {', '.join(LAYOUTS)}")
    return LAYOUTS[name]


def layout_of(record: ShardRecord) -> Layout:
    """The layout of a shard; shards that were never rewritten have the training layout."""
    found = _MARK.search(record.metadata_file or "")
    return LAYOUTS[found[1] if found else "training"]


def unit_of(record: ShardRecord) -> str:
    """Identifier shared by shards that were rewritten together and may share files."""
    found = _MARK.search(record.metadata_file or "")
    return found[2] if found else record.key


def rewritten_name(record: ShardRecord, layout: Layout, unit: str) -> str:
    """Name of a shard's metadata file after rewriting; known in advance, so that finished work is found."""
    folder = partition("metadata", record.dataset, record.version, record.split)
    return f"{folder}/{record.name}-{record.key}-{layout.name}-{unit}.parquet"


def new_unit(records: Iterable[ShardRecord], layout: Layout, left_out: Iterable[str] = ()) -> str:
    """Identifier for shards that are rewritten together, from their present metadata files and what is left out."""
    names = "\n".join((layout.name, *(str(record.metadata_file) for record in records), *sorted(left_out)))
    return hashlib.blake2b(names.encode(), digest_size=8).hexdigest()
