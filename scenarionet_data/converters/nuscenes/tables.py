"""Read nuScenes' relational tables of one release: keyframes, objects, annotated boxes, ego poses.

Of the 13 tables ``map`` and ``visibility`` are not needed. Tokens are replaced by row numbers on reading, so that a
release with 1.2 million boxes takes 0.2 GB. A dangling token becomes -1, a value of another type NaN or None:
``recording`` drops the rows concerned and reports them. A row that names no scene is reported with the scene of its
object, or of the row before it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.dtypes import Array, Int64
from scenarionet_data.converters.formats.json_blocks import is_unicode, read_list, read_rows
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
    filled,
    gather,
    index,
    poses,
    vectors,
)
from scenarionet_data.errors import CorruptSource

TableRecords = dict[str, dict[str, Any]]

TABLES = (
    *("attribute", "calibrated_sensor", "category", "ego_pose", "instance", "log"),
    *("sample", "sample_annotation", "sample_data", "scene", "sensor"),
)
"""Tables that are read."""

LIDAR = "LIDAR_TOP"
"""The annotated sensor; ego poses at its sweeps, 20 per second, are the ego's path."""

_BOX = pa.schema({"sample_token": TEXT, "instance_token": TEXT, "attribute_tokens": TEXTS, "size": NUMBERS} | POSE)
_INSTANCE = pa.schema({"token": TEXT, "category_token": TEXT, "nbr_annotations": pa.int64()})
_POSE = pa.schema({"token": TEXT, "timestamp": NUMBER} | POSE)
_SAMPLE = pa.schema({"token": TEXT, "timestamp": NUMBER, "scene_token": TEXT})
_SWEEP = pa.schema({"sample_token": TEXT, "ego_pose_token": TEXT, "calibrated_sensor_token": TEXT})

_NAME = re.compile(r"[\w .-]{1,128}")
"""Names of scenes and locations, which become names of shards and files."""


@dataclass(frozen=True, eq=False)
class NuScenesRelease:
    """The tables of one release; missing or invalid numbers are NaN.

    Attributes:
        scenes, logs: Records by token.
        samples: Keyframes: ``row`` in the table, ``token``, ``time`` [us], ``has_scene``.
        instances: Objects: ``token``, ``category`` (None if unknown), ``count`` of annotations (-1 if unknown).
        boxes: ``row`` in the table, ``sample`` and ``instance`` (their rows; -1 if unknown), ``attributes`` (bits),
            ``box``: x, y, z [m], heading [rad], length, width, height [m].
        poses: ``token``, ``time`` [us], ``pose``: x, y, z [m], heading [rad]; ``is_lidar``: whether the sensor is
            known.
        attributes: Attribute of each bit.
    """

    scenes: TableRecords
    logs: TableRecords
    samples: TableRows
    instances: dict[str, Array]
    boxes: TableRows
    poses: TableRows
    attributes: list[str]


def read_scenes(folder: Path) -> tuple[TableRecords, TableRecords, int]:
    """Read the records of ``scene`` and ``log`` by token, which suffice to list the scenes.

    Returns:
        Scenes with a usable and unique name, the logs, and the number of the other entries of ``scene``.

    Raises:
        CorruptSource: A table is missing or damaged.
    """
    fields: dict[str, type] = {"name": str, "log_token": str, "nbr_samples": int, "description": str}
    scenes, num_lost = _records(folder, "scene", fields)
    named: TableRecords = {}
    for token, scene in scenes.items():
        if scene["name"] and _NAME.fullmatch(scene["name"]):
            named.setdefault(scene["name"], scene | {"token": token})
    logs, _ = _records(folder, "log", {"logfile": str, "location": str, "date_captured": str})
    for log in logs.values():
        if log["location"] and not _NAME.fullmatch(log["location"]):
            log["location"] = None
    found = {scene["token"]: scene for scene in named.values()}
    return found, logs, num_lost + len(scenes) - len(found)


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
    scenes, logs, _ = read_scenes(folder)
    attributes = _names(folder, "attribute")
    if len(attributes) > UNKNOWN_BIT:
        raise CorruptSource(f"{folder / 'attribute.json'}: expected {UNKNOWN_BIT} at most, found {len(attributes)}")
    samples = _read_samples(folder, list(scenes))
    instances = _read_instances(folder)
    boxes = _read_boxes(folder, samples, instances["token"], list(attributes))
    words = list(attributes.values())
    return NuScenesRelease(scenes, logs, samples, instances, boxes, _read_poses(folder, samples), words)


def _records(folder: Path, table: str, fields: dict[str, type]) -> tuple[TableRecords, int]:
    """Records of a small table by token, and the number of entries without a token of their own.

    Values of another type are None.

    Raises:
        CorruptSource: None of the records has one of the fields.
    """
    path = folder / f"{table}.json"
    entries = read_list(path)
    records = [entry for entry in entries if isinstance(entry, dict)]
    for name in ("token", *fields):
        if entries and not any(name in record for record in records):
            raise CorruptSource(f"{path}: expected {name!r} in its records; is this a nuScenes table?")
    found: TableRecords = {}
    for record in records:
        token = _typed(record.get("token"), str)
        if token:
            found.setdefault(token, {name: _typed(record.get(name), kind) for name, kind in fields.items()})
            found[token]["token"] = token
    return found, len(entries) - len(found)


def _typed(value: Any, kind: type) -> Any:
    """The value if it is of a type, else None."""
    is_fitting = type(value) is kind and (not isinstance(value, str) or is_unicode(value))
    return value if is_fitting else None


def _names(folder: Path, table: str) -> dict[str, str]:
    """The names in a table by token, without unusable ones."""
    records, _ = _records(folder, table, {"name": str})
    return {token: record["name"] for token, record in records.items() if record["name"]}


def _read_samples(folder: Path, scenes: list[str]) -> TableRows:
    def columns(rows: pa.Table) -> dict[str, Array]:
        token, time = rows["token"].to_numpy(), rows["timestamp"].to_numpy()
        return {"scene": index(rows["scene_token"], scenes), "token": token, "time": time}

    found = gather(read_rows(folder / "sample.json", _SAMPLE), columns, _SAMPLE)
    found["has_scene"] = found["scene"] >= 0
    found["scene"] = filled(found["scene"])
    return by_scene(found, len(scenes))


def _read_instances(folder: Path) -> dict[str, Array]:
    categories = _names(folder, "category")
    names = np.array([*categories.values(), None], dtype=object)

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

    path = folder / "sample_annotation.json"
    found = gather(read_rows(path, _BOX), columns, _BOX)
    if len(found["scene"]) and (found["scene"] < 0).all():
        raise CorruptSource(f"{path}: expected sample_tokens of sample.json, found none; download the metadata again")
    found["scene"] = _attributed(found["scene"], found["instance"], len(instances))
    return by_scene(found, len(samples.start) - 1)


def _attributed(scene: Int64, instance: Int64, num_instances: int) -> Int64:
    """(R,) scene of each row: if it names none, that of its object, or of the row before it."""
    if (scene >= 0).all():
        return scene
    scene_of = np.full(num_instances + 1, -1)
    scene_of[instance[scene >= 0]] = scene[scene >= 0]
    scene_of[-1] = -1  # rows without an object
    return filled(np.where(scene >= 0, scene, scene_of[instance]))


def _read_poses(folder: Path, samples: TableRows) -> TableRows:
    """Ego poses at the lidar sweeps; NaN if missing."""
    sample, tokens, is_lidar = _read_sweeps(folder, samples)

    def columns(rows: pa.Table) -> dict[str, Array]:
        return {"token": rows["token"].to_numpy(), "time": rows["timestamp"].to_numpy(), "pose": poses(rows)}

    wanted = {token.encode() for token in tokens if token is not None}
    found = gather(read_rows(folder / "ego_pose.json", _POSE, "token", wanted), columns, _POSE)
    row = index(pa.array(tokens, TEXT), found["token"])
    placed = {
        "scene": filled(np.append(samples.scene, -1)[sample]),
        "time": np.append(found["time"], np.nan)[row],
        "pose": np.vstack([found["pose"], np.full(4, np.nan)])[row],
        "is_lidar": is_lidar,
        "token": tokens,
    }
    return by_scene(placed, len(samples.start) - 1)


def _read_sweeps(folder: Path, samples: TableRows) -> tuple[Int64, Array, Array]:
    """Keyframe (-1 if unknown) and pose token of each sweep of the lidar, and whether the sensor is known.

    A sweep of an unknown sensor may be one of the lidar.
    """
    sensors, _ = _records(folder, "sensor", {"channel": str})
    mounted, _ = _records(folder, "calibrated_sensor", {"sensor_token": str})
    channels = {token: sensors.get(record["sensor_token"], {}).get("channel") for token, record in mounted.items()}
    lidars = [token for token, channel in channels.items() if channel == LIDAR]
    others = {token.encode() for token, channel in channels.items() if channel not in (LIDAR, None)}

    def columns(rows: pa.Table) -> dict[str, Array]:
        return {
            "sample": index(rows["sample_token"], samples.columns["token"]),
            "pose": rows["ego_pose_token"].to_numpy(),
            "is_lidar": index(rows["calibrated_sensor_token"], lidars) >= 0,
        }

    blocks = read_rows(folder / "sample_data.json", _SWEEP, "calibrated_sensor_token", others, is_excluding=True)
    found = gather(blocks, columns, _SWEEP)
    return found["sample"], found["pose"], found["is_lidar"]
