"""Read the CAN bus expansion of nuScenes, ``can_bus/<scene>_<message>.json``.

Each file is a list of messages sorted by ``utime`` [us]. Names and units are those of nuscenes-devkit
(``python-sdk/nuscenes/can_bus/README.md``); values are resampled to the timesteps of the scenario. Kinds of messages
that repeat others are skipped. About twenty scenes have no messages.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.shard import fingerprint

FOLDER = "can_bus"
MEASURED = {
    "pose": ("vel", "accel", "rotation_rate"),
    "steeranglefeedback": ("value",),
    "vehicle_monitor": ("vehicle_speed", "throttle", "brake", "steering", "yaw_rate"),
}
"""Numbers and vectors, interpolated."""
SWITCHED = {"vehicle_monitor": ("gear_position", "brake_switch", "left_signal", "right_signal")}
"""Positions of switches, taken from the last message."""

_GAP = 1.5e6
"""Longest gap between messages that is bridged [us]; the rarest are sent every 0.5 s."""
_DIGITS = 4


@dataclass(frozen=True, eq=False)
class CanBusMessages:
    """Messages of one kind of a scene.

    Attributes:
        times: (M,) [us], strictly increasing.
        fields: (M, c) each.
    """

    times: Float64
    fields: Mapping[str, Float64]


def can_bus_mark(root: Path, scene: str) -> str:
    """Fingerprint of the messages of a scene; empty if it has none."""
    files = _files(root, scene)
    return fingerprint(files) if files else ""


def _files(root: Path, scene: str) -> list[Path]:
    return [path for name in can_bus_files(scene) if (path := root / name).is_file()]


def can_bus_files(scene: str) -> list[str]:
    """Names of the files with a scene's messages, relative to the dataroot."""
    return [f"{FOLDER}/{scene}_{kind}.json" for kind in MEASURED]


def read_can_bus(root: Path, scene: str) -> Mapping[str, CanBusMessages]:
    """Read a scene's messages by kind; empty if it has none. Cached for the scene's windows.

    Raises:
        CorruptSource: A file is damaged.
    """
    found = {}
    for path in _files(root, scene):
        kind, state = path.stem.removeprefix(f"{scene}_"), path.stat()
        found[kind] = _read(path, kind, state.st_size, state.st_mtime_ns)
    return found


def signals_at(messages: Mapping[str, CanBusMessages], times: Float64) -> dict[str, list[Any]]:
    """Sample messages at ``times`` (T,) [us]: T numbers, vectors or None, by ``<kind>.<field>``."""
    found = {}
    for kind, kind_messages in messages.items():
        after = np.searchsorted(kind_messages.times, times).clip(1, len(kind_messages.times) - 1)
        is_known = (times >= kind_messages.times[0]) & (times <= kind_messages.times[-1])
        is_known &= kind_messages.times[after] - kind_messages.times[after - 1] <= _GAP
        last = np.searchsorted(kind_messages.times, times, side="right").clip(1) - 1
        for name, values in kind_messages.fields.items():
            if name in SWITCHED.get(kind, ()):
                at = values[last]
            else:
                at = np.column_stack([np.interp(times, kind_messages.times, column) for column in values.T])
            found[f"{kind}.{name}"] = _listed(at, is_known)
    return found


def _listed(values: Float64, is_known: Bool) -> list[Any]:
    rows = np.round(values, _DIGITS).tolist()
    told = [row[0] if len(row) == 1 else row for row in rows]
    return [value if known else None for value, known in zip(told, is_known.tolist(), strict=True)]


@lru_cache(maxsize=len(MEASURED))
def _read(path: Path, kind: str, _size: int, _changed: int) -> CanBusMessages:
    try:
        messages = json.loads(path.read_bytes())
        times, first = np.unique(np.array([message["utime"] for message in messages], np.float64), return_index=True)
        fields = {
            name: np.array([message[name] for message in messages], np.float64).reshape(len(messages), -1)[first]
            for name in (*MEASURED[kind], *SWITCHED.get(kind, ()))
        }
        is_whole = len(times) > 1 and all(np.isfinite(values).all() for values in (times, *fields.values()))
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise CorruptSource(f"{path} cannot be read ({error!r}); download the CAN bus expansion again") from error
    if not is_whole:
        raise CorruptSource(f"{path}: expected two messages or more, of finite numbers; download the expansion again")
    return CanBusMessages(times, fields)
