"""The files of the Waymo Open Motion Dataset: those of scenarios, and what is beside them."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from scenarionet_data.converters.base import find_files
from scenarionet_data.converters.formats.protowire import DamagedMessage, Messages
from scenarionet_data.converters.formats.tfrecord import read_records
from scenarionet_data.errors import CorruptSource, SourceNotFound
from scenarionet_data.ingest.passed_over import PassedOver

EXAMPLE = "training.tfrecord-00000-of-01000"

_SIDECARS = (".gstmp", ".crc", ".crc32c", ".md5", ".sha256", ".json", ".idx", ".index")
"""Endings of files beside recordings: unfinished downloads of gsutil, checksums, descriptions and indices."""

_OTHER_PARTS = frozenset({"tf_example", "tf_examples", "lidar", "lidar_and_camera", "occupancy_flow_challenge"})
"""Folders of the dataset with other formats: the same scenarios as tf.Example, and sensor data."""

_UNUSED_FIELDS = {12: "lidar (compressed_frame_laser_data)", 13: "camera tokens (frame_camera_tokens)"}
"""Fields of a Scenario message that are not read."""


def shard_name(item: str) -> str:
    """Return ``item`` if it is a valid file name, else a cleaned name with a hash.

    Example:
        >>> shard_name("training.tfrecord-00000-of-01000"), shard_name("a b/c.tfrecord")
        ('training.tfrecord-00000-of-01000', 'a_b_c.tfrecord-8663cf28')
    """
    clean = re.sub(r"[^A-Za-z0-9._-]", "_", item)
    if clean == item:
        return item
    return f"{clean}-{hashlib.blake2b(item.encode(), digest_size=4).hexdigest()}"


def unused_fields(path: Path) -> Iterator[PassedOver]:
    """Sensor data in the first record of a file; reading all records would take as long as the conversion."""
    try:
        record = next(iter(read_records(path)))
        numbers = Messages.of(record.payload).fields().number
    except (CorruptSource, DamagedMessage, OSError):  # reported by the conversion
        return
    for number, what in _UNUSED_FIELDS.items():
        count = int(np.count_nonzero(numbers == number))
        if count:
            yield PassedOver(f"{what} in the first scenario of {path.name}", count, "sensor data is not stored")


def scenario_files(raw: str, split: str) -> list[Path]:
    """Find the files of scenarios, also below a folder with other parts of the dataset.

    Raises:
        SourceNotFound: None.
    """
    root, what = Path(raw), f"files like {EXAMPLE} (the dataset's `scenario` format)"
    found = find_files(raw, "*.tfrecord*", what, split, _SIDECARS)
    chosen = [path for path in found if path == root or not _is_other_part(path.relative_to(root))]
    if not chosen:
        raise SourceNotFound(f"{raw}: {found[0]} belongs to another part of the dataset; give the folder with {what}")
    return chosen


def _is_other_part(path: Path) -> bool:
    """Whether a file below RAW is of the dataset's other formats, by the names that the owner gives them."""
    return not _OTHER_PARTS.isdisjoint(path.parts[:-1]) or "tfexample" in path.name
