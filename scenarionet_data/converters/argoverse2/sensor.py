"""Argoverse 2 sensor logs: annotated boxes in the ego frame of each sweep, the ego's poses, and the log's map.

10 Hz, about 16 s per log. The timesteps are the annotated sweeps. Boxes are transformed to the city frame with the
ego's pose at the timestamp of the sweep: a recorded one (always, in real logs), or interpolated between the adjacent
two. Velocities are not recorded, but estimated from positions.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int64
from scenarionet_data.arrays.geometry import estimate_velocity
from scenarionet_data.building import make_origin, make_tracks
from scenarionet_data.converters.argoverse2.map_features import Argoverse2Map, read_map
from scenarionet_data.converters.argoverse2.poses import (
    QUATERNION,
    TRANSLATION,
    forward,
    heading,
    quaternions,
    read_poses,
    rotated,
)
from scenarionet_data.converters.argoverse2.table import TrackGrid, numbers, read_feather, text
from scenarionet_data.converters.argoverse2.types import EGO, EGO_CENTER, EGO_SIZE, SENSOR_CATEGORIES
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import (
    Lights,
    ScenarioDescription,
    Source,
    Tracks,
    make_scenario_id,
)
from scenarionet_data.scenario.vocabulary import ObjectType

_POSES = "city_SE3_egovehicle.feather"
_MAP = "map/log_map_archive_*.json"
_SIZE = ("length_m", "width_m", "height_m")

DT = 0.1
"""Nominal time between sweeps [s]."""
HISTORY = 10
"""``current_timestep``: after 1 s, as in the Waymo Open Motion Dataset; the sensor dataset does not define it."""


@dataclass(frozen=True, eq=False)
class Argoverse2Log:
    """One sensor log in the city frame: S sweeps, R annotated boxes.

    Attributes:
        name: The log's id.
        sweeps: (S,) int64 [ns], strictly increasing.
        num_interpolated: Number of sweeps without a recorded pose.
        ego: (S, 4) x, y, z of the ego's box centre [m], heading [rad].
        sweep: (R,) sweep of each box.
        tracks, categories: (R,) values of the source.
        boxes: (R, 7) x, y, z [m], heading [rad], length, width, height [m].
        roads: The log's map.
        city: The code in the map's file name, for example PIT.
    """

    name: str
    sweeps: Int64
    num_interpolated: int
    ego: Float64
    sweep: Int64
    tracks: Any
    categories: Any
    boxes: Float64
    roads: Argoverse2Map
    city: str | None


@dataclass(frozen=True, eq=False)
class Argoverse2Window:
    """Sweeps ``first`` to ``last - 1`` of a log: one scenario."""

    log: Argoverse2Log
    first: int
    last: int


def log_files(annotations: Path) -> list[Path]:
    """Existing files read for a log, given its ``annotations.feather``."""
    _, poses, _ = log_patterns(annotations)
    return [path for path in (annotations, poses, *_maps(annotations.parent)) if path.is_file()]


def log_patterns(annotations: Path) -> list[Path]:
    """Patterns of the files read for a log, given its ``annotations.feather``: poses, then map."""
    folder = annotations.parent
    return [annotations, folder / _POSES, folder / _MAP]


def _maps(folder: Path) -> list[Path]:
    return sorted(folder.glob(_MAP))


def city_of(annotations: Path) -> str | None:
    """City of a log, from the name of its map file, for example PIT; None if unknown."""
    return next(map(_city, _maps(annotations.parent)), None)


def read_log(annotations: Path) -> Argoverse2Log:
    """Read one log's boxes, poses and map.

    Raises:
        CorruptSource: A file is missing or damaged, or a sweep is outside the recorded poses.
    """
    folder = annotations.parent
    names = ("timestamp_ns", "track_uuid", "category", *_SIZE, *QUATERNION, *TRANSLATION)
    rows = read_feather(annotations, names)
    sweeps, sweep = np.unique(numbers(rows, annotations, "timestamp_ns"), return_inverse=True)
    if not len(sweeps):
        raise CorruptSource(f"{annotations}: expected annotations, found none; download the log again")
    poses = read_poses(folder / _POSES, sweeps)
    position = poses.to_city(numbers(rows, annotations, *TRANSLATION), sweep)
    facing = rotated(poses.turn[sweep], forward(quaternions(rows, annotations)))
    center = poses.to_city(np.broadcast_to(EGO_CENTER, (len(sweeps), 3)), np.arange(len(sweeps)))
    maps = _maps(folder)
    if not maps:
        raise CorruptSource(f"{folder / 'map'}: no log_map_archive_*.json; download the log's map folder too")
    return Argoverse2Log(
        name=folder.resolve().name,
        sweeps=sweeps,
        num_interpolated=poses.num_interpolated,
        ego=np.column_stack([center, heading(forward(poses.turn))]),
        sweep=sweep,
        tracks=text(rows, annotations, "track_uuid"),
        categories=text(rows, annotations, "category"),
        boxes=np.column_stack([position, heading(facing), numbers(rows, annotations, *_SIZE)]),
        roads=read_map(maps[0]),
        city=_city(maps[0]),
    )


def _city(path: Path) -> str | None:
    """The code in ``log_map_archive_<log>____PIT_city_57819.json``."""
    found = re.search(r"____([A-Z]+)_city_", path.name)
    return found.group(1) if found else None


def windows(log: Argoverse2Log, window: float, stride: float) -> Iterator[Argoverse2Window]:
    """Cut a log every ``stride`` seconds into ``window`` seconds; a sweep counts as 0.1 s.

    The last window ends with the log and may be shorter; it is dropped if it would end within its history.
    """
    size, step, count = round(window / DT), round(stride / DT), len(log.sweeps)
    for first in range(0, count, step):
        last = min(first + size, count)
        if first == 0 or last - first > HISTORY + 1:
            yield Argoverse2Window(log, first, last)
        if last == count:
            return


def describe(shard: Shard, window: Argoverse2Window, licence: str) -> ScenarioDescription:
    """Convert one window to a scenario."""
    log, part = window.log, slice(window.first, window.last)
    times = log.sweeps[part]
    timestamps = (times - times[0]) * 1e-9
    ego = log.ego[part]
    origin = make_origin(ego[:, :3], np.ones(len(times), np.bool_), has_z=True)
    return ScenarioDescription(
        id=make_scenario_id(shard.dataset, shard.version, log.name, int(times[0])),
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        timestamps=timestamps,
        dt=DT,
        current_timestep=min(HISTORY, len(times) - 1),
        ego_id=EGO,
        origin=origin,
        has_z=True,
        source=Source(
            scenario_id=log.name,
            file=shard.items[0].name,
            licence=licence,
            log=log.name,
            city=log.city,
            crs=f"argoverse2 city frame {log.city}",
        ),
        tracks=_tracks(window, ego, timestamps, origin),
        lights=Lights.empty(len(times)),
        map=log.roads.features(origin),
        extras={
            "kind": "sensor",
            "start_timestamp_ns": int(times[0]),
            "num_interpolated_poses": log.num_interpolated,
            "num_completed_links": log.roads.num_completed_links,
        },
    )


def _tracks(window: Argoverse2Window, ego: Float64, timestamps: Float64, origin: Float64) -> Tracks:
    """Build the annotated objects of the window, followed by the ego."""
    log = window.log
    (rows,) = np.nonzero((log.sweep >= window.first) & (log.sweep < window.last))
    grid = TrackGrid(log.tracks.take(rows), log.sweep[rows] - window.first, len(timestamps), Path(log.name))
    words = log.categories.take(rows[grid.first]).to_pylist()
    boxes = np.concatenate([grid.place(log.boxes[rows]), np.column_stack([ego, _ego_sizes(ego)])[None]])
    valid = np.concatenate([grid.valid, np.ones((1, len(timestamps)), np.bool_)])
    kinds = [SENSOR_CATEGORIES.get(word, ObjectType.OTHER) for word in words]
    return make_tracks(
        [*grid.ids, EGO],
        [*kinds, ObjectType.VEHICLE],
        boxes[..., :3],
        boxes[..., 3],
        estimate_velocity(boxes[..., :2], valid, timestamps),
        boxes[..., 4:7],
        valid,
        origin=origin,
        source_type=[*words, "EGO_VEHICLE"],
        is_size_assumed=[False] * len(words) + [True],
        is_type_assumed=[word not in SENSOR_CATEGORIES for word in words] + [False],
        is_velocity_estimated=True,
    )


def _ego_sizes(ego: Float64) -> Float64:
    return np.broadcast_to(np.array(EGO_SIZE), (len(ego), 3))
