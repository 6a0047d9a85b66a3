"""Read the CAN bus expansion of nuScenes, ``can_bus/<scene>_<message>.json``.

Each file is a list of messages sorted by ``utime`` [us]. Names and units are those of nuscenes-devkit
(``python-sdk/nuscenes/can_bus/README.md``); values are resampled to the timesteps of the scenario. Kinds of messages
that repeat others are skipped. About twenty scenes have no messages. A damaged message is left out, and so is a file
without two usable ones.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.listing import cached_by_file
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

_WIDTHS = {"pose": 3}
"""Length of vectors by kind; the others are numbers."""

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


def read_can_bus(root: Path, scene: str, defects: Defects) -> Mapping[str, CanBusMessages]:
    """Read a scene's messages by kind; empty if it has none. Cached for the scene's windows.

    What cannot be used is added to ``defects``.
    """
    found = {}
    for path in _files(root, scene):
        kind = path.stem.removeprefix(f"{scene}_")
        messages, bad = _read(path, kind)
        file = f"{FOLDER}/{path.name}"
        if messages is None:
            reason = "expected two messages or more with finite numbers, found fewer; the signal is left out"
            defects.assume("tracks", file, [kind], kind, reason)
        else:
            found[kind] = messages
            reason = "expected finite numbers, found others; interpolated from the other messages"
            defects.assume("tracks", file, bad, kind, reason)
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
            rows = np.round(at, _DIGITS).tolist()
            told = [row[0] if len(row) == 1 else row for row in rows]
            found[f"{kind}.{name}"] = [
                value if known else None for value, known in zip(told, is_known.tolist(), strict=True)
            ]
    return found


@cached_by_file(len(MEASURED))
def _read(path: Path, kind: str) -> tuple[CanBusMessages | None, list[int]]:
    """Messages of a file (None if there are not two), and the positions of those that are damaged."""
    try:
        entries = json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None, []
    if not isinstance(entries, list):
        return None, []
    widths = {"utime": 1} | {name: _WIDTHS.get(kind, 1) for name in (*MEASURED[kind], *SWITCHED.get(kind, ()))}
    columns, bad = _columns(entries, widths), []
    if columns is None:
        is_good = [_columns([entry], widths) is not None for entry in entries]
        bad = [number for number, good in enumerate(is_good) if not good]
        columns = _columns([entry for entry, good in zip(entries, is_good, strict=True) if good], widths)
    times, first = np.unique([] if columns is None else columns.pop("utime"), return_index=True)
    if columns is None or len(times) < 2:
        return None, bad
    return CanBusMessages(times, {name: values[first] for name, values in columns.items()}), bad


def _columns(entries: list[Any], widths: Mapping[str, int]) -> dict[str, Float64] | None:
    """Fields of messages as columns (M, width); None unless all values are finite numbers."""
    try:
        columns = {name: np.array([entry[name] for entry in entries]) for name in widths}
        shaped = {name: values.reshape(len(entries), widths[name]) for name, values in columns.items()}
    except (ValueError, TypeError, KeyError):  # one message without the field, or with a list of another length
        return None
    is_finite = all(values.dtype.kind in "if" and np.isfinite(values).all() for values in shaped.values())
    return {name: values.astype(np.float64) for name, values in shaped.items()} if is_finite else None
