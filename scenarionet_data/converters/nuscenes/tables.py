"""Read nuScenes' relational tables of one release: keyframes, objects, annotated boxes, ego poses.

Of the 13 tables ``map`` and ``visibility`` are not needed. Tokens are replaced by row numbers on reading, so that a
release with 1.2 million boxes takes 0.2 GB. A dangling token becomes -1; ``recording`` reports the scenes concerned.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.converters.formats.json_blocks import read_list, read_rows
from scenarionet_data.converters.nuscenes.columns import (
    NUMBER,
    NUMBERS,
    POSE,
    TEXT,
    TEXTS,
    UNKNOWN_BIT,
    TableRows,
    bits,
    by_scene,
    gather,
    index,
    poses,
    vectors,
)
from scenarionet_data.errors import CorruptSource

TableRecords = dict[str, dict[str, Any]]

TABLES = (
    "attribute",
    "calibrated_sensor",
    "category",
    "ego_pose",
    "instance",
    "log",
    "sample",
    "sample_annotation",
    "sample_data",
    "scene",
    "sensor",
)
"""Tables that are read."""

LIDAR = "LIDAR_TOP"
"""The annotated sensor; ego poses at its sweeps, 20 per second, are the ego's path."""

_BOX = pa.schema({"sample_token": TEXT, "instance_token": TEXT, "attribute_tokens": TEXTS, "size": NUMBERS} | POSE)
_INSTANCE = pa.schema({"token": TEXT, "category_token": TEXT, "nbr_annotations": pa.int64()})
_POSE = pa.schema({"token": TEXT, "timestamp": NUMBER} | POSE)
_SAMPLE = pa.schema({"token": TEXT, "timestamp": NUMBER, "scene_token": TEXT})
_SWEEP = pa.schema({"sample_token": TEXT, "ego_pose_token": TEXT})


@dataclass(frozen=True, eq=False)
class NuScenesRelease:
    """The tables of one release; missing or invalid numbers are NaN.

    Attributes:
        scenes, logs: Records by token.
        samples: Keyframes: ``token``, ``time`` [us].
        instances: Objects: ``token``, ``category`` (None if unknown), ``count`` of annotations.
        boxes: ``sample`` and ``instance`` (their rows; -1 if unknown), ``attributes`` (bits), ``box``:
            x, y, z [m], heading [rad], length, width, height [m].
        poses: ``time`` [us], ``pose``: x, y, z [m], heading [rad].
        attributes: Attribute of each bit.
    """

    scenes: TableRecords
    logs: TableRecords
    samples: TableRows
    instances: dict[str, Array]
    boxes: TableRows
    poses: TableRows
    attributes: list[str]


def read_scenes(folder: Path) -> tuple[TableRecords, TableRecords]:
    """Read the records of ``scene`` and ``log`` by token, which suffice to list the scenes.

    Raises:
        CorruptSource: A table is missing or damaged.
    """
    scenes = _records(folder, "scene", "name", "log_token", "nbr_samples", "description")
    return scenes, _records(folder, "log", "logfile", "location", "date_captured")


def log_name(log: dict[str, Any]) -> str:
    """Name of a log: its file, or its token if missing, as in Lyft's dataset."""
    return str(log["logfile"] or log["token"])


def read_release(folder: Path) -> NuScenesRelease:
    """Read all tables; the last release is cached, so that a worker reads it once.

    Raises:
        CorruptSource: A table is missing or damaged.
    """
    files = table_files(folder)
    return _read_release(folder, tuple((path.stat().st_size, path.stat().st_mtime_ns) for path in files))


def table_files(folder: Path) -> list[Path]:
    """Paths of the files to read.

    Raises:
        CorruptSource: A file is missing.
    """
    files = [folder / f"{table}.json" for table in TABLES]
    missing = [path for path in files if not path.is_file()]
    if missing:
        raise CorruptSource(f"{missing[0]}: no such table; download the release's metadata again")
    return files


@lru_cache(maxsize=1)
def _read_release(folder: Path, _signature: tuple[tuple[int, int], ...]) -> NuScenesRelease:
    scenes, logs = read_scenes(folder)
    attributes = _records(folder, "attribute", "name")
    if len(attributes) > UNKNOWN_BIT:
        raise CorruptSource(f"{folder / 'attribute.json'}: expected {UNKNOWN_BIT} at most, found {len(attributes)}")
    samples = _read_samples(folder, list(scenes))
    instances = _read_instances(folder)
    boxes = _read_boxes(folder, samples, instances["token"], list(attributes))
    words = [record["name"] for record in attributes.values()]
    return NuScenesRelease(scenes, logs, samples, instances, boxes, _read_poses(folder, samples), words)


def _records(folder: Path, table: str, *fields: str) -> TableRecords:
    path = folder / f"{table}.json"
    records = read_list(path)
    for name in ("token", *fields):
        if not all(name in record for record in records):
            raise CorruptSource(f"{path}: expected {name!r} in every record; is this a nuScenes table?")
    return {record["token"]: record for record in records}


def _read_samples(folder: Path, scenes: list[str]) -> TableRows:
    def columns(rows: pa.Table) -> dict[str, Array]:
        token, time = rows["token"].to_numpy(), rows["timestamp"].to_numpy()
        return {"scene": index(rows["scene_token"], scenes), "token": token, "time": time}

    return by_scene(gather(read_rows(folder / "sample.json", _SAMPLE), columns, _SAMPLE), len(scenes))


def _read_instances(folder: Path) -> dict[str, Array]:
    categories = _records(folder, "category", "name")
    names = np.array([*(record["name"] for record in categories.values()), None], dtype=object)

    def columns(rows: pa.Table) -> dict[str, Array]:
        category = names[index(rows["category_token"], list(categories))]
        count = rows["nbr_annotations"].fill_null(-1).to_numpy()
        return {"token": rows["token"].to_numpy(), "category": category, "count": count}

    return gather(read_rows(folder / "instance.json", _INSTANCE), columns, _INSTANCE)


def _read_boxes(folder: Path, samples: TableRows, instances: Array, attributes: list[str]) -> TableRows:
    scene_of = np.append(samples.scene, -1)

    def columns(rows: pa.Table) -> dict[str, Array]:
        sample = index(rows["sample_token"], samples.columns["token"])
        length_width_height = vectors(rows["size"], 3)[:, [1, 0, 2]]  # the table has width before length
        return {
            "scene": scene_of[sample],
            "sample": sample,
            "instance": index(rows["instance_token"], instances),
            "attributes": bits(rows["attribute_tokens"], attributes),
            "box": np.column_stack([poses(rows), length_width_height]),
        }

    found = gather(read_rows(folder / "sample_annotation.json", _BOX), columns, _BOX)
    return by_scene(found, len(samples.start) - 1)


def _read_poses(folder: Path, samples: TableRows) -> TableRows:
    """Ego poses at the lidar sweeps; NaN if missing."""
    sample, tokens = _read_sweeps(folder, samples)

    def columns(rows: pa.Table) -> dict[str, Array]:
        return {"token": rows["token"].to_numpy(), "time": rows["timestamp"].to_numpy(), "pose": poses(rows)}

    wanted = {token.encode() for token in tokens if token is not None}
    found = gather(read_rows(folder / "ego_pose.json", _POSE, "token", wanted), columns, _POSE)
    row = index(pa.array(tokens, TEXT), found["token"])
    placed = {
        "scene": np.append(samples.scene, -1)[sample],
        "time": np.append(found["time"], np.nan)[row],
        "pose": np.vstack([found["pose"], np.full(4, np.nan)])[row],
    }
    return by_scene(placed, len(samples.start) - 1)


def _read_sweeps(folder: Path, samples: TableRows) -> tuple[Array, Array]:
    """Keyframe (-1 if unknown) and pose token of each lidar sweep."""
    sensors = [token for token, r in _records(folder, "sensor", "channel").items() if r["channel"] == LIDAR]
    mounted = _records(folder, "calibrated_sensor", "sensor_token").items()
    lidars = {token.encode() for token, record in mounted if record["sensor_token"] in sensors}
    if not lidars:
        raise CorruptSource(f"{folder / 'calibrated_sensor.json'}: expected a sensor {LIDAR}, found none")

    def columns(rows: pa.Table) -> dict[str, Array]:
        sample = index(rows["sample_token"], samples.columns["token"])
        return {"sample": sample, "pose": rows["ego_pose_token"].to_numpy()}

    blocks = read_rows(folder / "sample_data.json", _SWEEP, "calibrated_sensor_token", lidars)
    found = gather(blocks, columns, _SWEEP)
    return found["sample"], found["pose"]
