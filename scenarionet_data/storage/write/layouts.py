"""How scenarios lie in files: as they are converted, for training, or many together, for analytics.

Which profile a shard has been rewritten to stands in the name of its metadata file, so that nobody has to open it.
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

_MARK = re.compile(r"-(training|analytics)-([0-9a-f]{16})\.parquet$")


@dataclass(frozen=True)
class Profile:
    """A way for scenarios to lie in files.

    Attributes:
        name: What it is good for.
        scenarios_per_group: Scenarios that share a row group.
        scenarios_per_file: Scenarios in a file at most.
    """

    name: str
    scenarios_per_group: int
    scenarios_per_file: int

    def num_files(self, num_scenarios: int) -> int:
        """Files of each table that so many scenarios need."""
        return math.ceil(num_scenarios / self.scenarios_per_file)


PROFILES = {
    "training": Profile("training", 1, SCENARIOS_PER_FILE),
    "analytics": Profile("analytics", 16, 1024),
}


def load(name: str) -> Profile:
    """The profile of that name.

    Raises:
        BadParameter: The message lists those there are.
    """
    if name not in PROFILES:
        raise BadParameter(f"no profile {name!r}; there are {', '.join(PROFILES)}")
    return PROFILES[name]


def profile_of(record: ShardRecord) -> Profile:
    """The profile of a shard; what was never rewritten is as it was converted."""
    found = _MARK.search(record.metadata_file or "")
    return PROFILES[found[1] if found else "training"]


def unit_of(record: ShardRecord) -> str:
    """What shards have in common that were rewritten together, and may share files."""
    found = _MARK.search(record.metadata_file or "")
    return found[2] if found else record.key


def rewritten_name(record: ShardRecord, profile: Profile, unit: str) -> str:
    """Name of a shard's metadata file once it is rewritten: known before, so that finished work is found."""
    folder = partition("metadata", record.dataset, record.version, record.split)
    return f"{folder}/{record.name}-{record.key}-{profile.name}-{unit}.parquet"


def new_unit(records: Iterable[ShardRecord], profile: Profile) -> str:
    """A name for shards that are rewritten together, from what they are now."""
    told = "\n".join((profile.name, *(str(record.metadata_file) for record in records)))
    return hashlib.blake2b(told.encode(), digest_size=8).hexdigest()
