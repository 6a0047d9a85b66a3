"""Argoverse 2 sensor logs: annotated boxes in the ego frame of each sweep, the ego's poses, and the log's map.

10 Hz, about 16 s per log. The timesteps are the annotated sweeps. Boxes are transformed to the city frame with the
ego's pose at the timestamp of the sweep: a recorded one (always, in real logs), or interpolated between the adjacent
two. Velocities are not recorded, but estimated from positions.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.arrays.geometry import estimate_velocity
from scenarionet_data.building import make_origin, make_tracks
from scenarionet_data.building.plausible import find_bad_rows, find_repeated_rows
from scenarionet_data.converters.argoverse2.map_features import Argoverse2Map, read_map
from scenarionet_data.converters.argoverse2.poses import (
    QUATERNION,
    TRANSLATION,
    RecordedPoses,
    forward,
    heading,
    quaternions,
    read_poses,
    rotated,
)
from scenarionet_data.converters.argoverse2.table import TrackGrid, integers, numbers, read_feather, text
from scenarionet_data.converters.argoverse2.types import EGO, EGO_CENTER, EGO_SIZE, SENSOR_CATEGORIES
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defect, Defects
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import (
    Lights,
    ScenarioDescription,
    Source,
    Tracks,
    make_scenario_id,
)
from scenarionet_data.scenario.vocabulary import ObjectType

ANNOTATIONS = ("annotations.feather", "annotations_with_ego.feather")
"""Files with boxes: of the sensor dataset, and of the scenario mining dataset, which has those of the ego as well."""
_EGO_CATEGORY = "EGO_VEHICLE"
_POSES = "city_SE3_egovehicle.feather"
_MAP = "map/log_map_archive_*.json"
_SIZE = ("length_m", "width_m", "height_m")
_FIELDS = {"position": "tx_m", "size": "length_m"}

DT = 0.1
"""Nominal time between sweeps [s]."""
HISTORY = 10
"""``current_timestep``: after 1 s, as in the Waymo Open Motion Dataset; the sensor dataset does not define it."""


@dataclass(frozen=True, eq=False)
class Argoverse2Log:
    """One sensor log in the city frame: S sweeps, R annotated boxes without unusable ones.

    Attributes:
        name: The log's id.
        file: Its annotations, relative to the raw folder.
        sweeps: (S,) int64 [ns], strictly increasing.
        is_interpolated: (S,) sweeps without a recorded pose.
        ego: (S, 4) x, y, z of the ego's box centre [m], heading [rad].
        sweep: (R,) sweep of each box.
        tracks, categories: (R,) values of the source.
        boxes: (R, 7) x, y, z [m], heading [rad], length, width, height [m].
        roads: The log's map.
        city: The code in the map's file name, for example PIT.
        bad: Unusable rows of the annotations.
        bad_poses: Unusable rows of the poses.
    """

    name: str
    file: str
    sweeps: Int64
    is_interpolated: Bool
    ego: Float64
    sweep: Int64
    tracks: Any
    categories: Any
    boxes: Float64
    roads: Argoverse2Map
    city: str | None
    bad: tuple[BadBoxes, ...]
    bad_poses: Int64


class BadBoxes(NamedTuple):
    """Rows of the annotations with one fault: their numbers, sweeps (-1 if unknown), the field, and the reason.

    ``is_dropped`` is False if the rows are kept with an assumed value.
    """

    rows: Int64
    sweep: Int64
    field: str
    reason: str
    is_dropped: bool = True


@dataclass(frozen=True, eq=False)
class Argoverse2Window:
    """Sweeps ``first`` to ``last - 1`` of a log: one scenario."""

    log: Argoverse2Log
    first: int
    last: int


def annotations_in(files: Collection[str]) -> str | None:
    """The annotations that are read of a log, among the names of the files in its folder."""
    return next((name for name in ANNOTATIONS if name in files), None)


def log_files(annotations: Path) -> list[Path]:
    """Existing files read for a log, given its annotations."""
    _, poses, _ = log_patterns(annotations)
    return [path for path in (annotations, poses, *_maps(annotations.parent)) if path.is_file()]


def log_patterns(annotations: Path) -> list[Path]:
    """Patterns of the files read for a log, given its annotations: poses, then map."""
    folder = annotations.parent
    return [annotations, folder / _POSES, folder / _MAP]


def _maps(folder: Path) -> list[Path]:
    return sorted(folder.glob(_MAP))


def city_of(annotations: Path) -> str | None:
    """City of a log, from the name of its map file, for example PIT; None if unknown."""
    return next(map(_city, _maps(annotations.parent)), None)


def read_log(annotations: Path, file: str) -> Argoverse2Log:
    """Read a log; boxes that cannot be used are left out and listed.

    Args:
        annotations: Its annotations.
        file: Their name relative to the raw folder.

    Raises:
        CorruptSource: A file is missing or damaged, or has no boxes that can be used.
    """
    folder = annotations.parent
    table = read_feather(annotations, ("timestamp_ns", "track_uuid", "category", *_SIZE, *QUATERNION, *TRANSLATION))
    recorded = read_poses(folder / _POSES)
    boxes = _Boxes(table, annotations, recorded)
    if not len(boxes.sweeps):
        wanted = f"expected annotations in the time of {_POSES}"
        raise CorruptSource(f"{annotations}: {wanted}, found none; download the log again")
    poses = recorded.at(boxes.sweeps)
    position = poses.to_city(boxes.place, boxes.sweep)
    facing = rotated(poses.turn[boxes.sweep], forward(boxes.turn))
    center = poses.to_city(np.broadcast_to(EGO_CENTER, (len(boxes.sweeps), 3)), np.arange(len(boxes.sweeps)))
    maps = _maps(folder)
    if not maps:
        raise CorruptSource(f"{folder / 'map'}: no log_map_archive_*.json; download the log's map folder too")
    map_file = (PurePosixPath(file).parent / "map" / maps[0].name).as_posix()
    return Argoverse2Log(
        name=folder.resolve().name,
        file=file,
        sweeps=boxes.sweeps,
        is_interpolated=poses.is_interpolated,
        ego=np.column_stack([center, heading(forward(poses.turn))]),
        sweep=boxes.sweep,
        tracks=boxes.tracks,
        categories=boxes.categories,
        boxes=np.column_stack([position, heading(facing), boxes.size]),
        roads=read_map(maps[0], map_file),
        city=_city(maps[0]),
        bad=tuple(boxes.bad),
        bad_poses=recorded.bad_rows,
    )


class _Boxes:
    """The boxes of a log in the ego frame of their sweeps: R usable rows of the annotations, without the ego's.

    Attributes:
        sweeps: (S,) int64 [ns] times with boxes.
        sweep: (R,) sweep of each box.
        tracks, categories: (R,) values of the source.
        place, size: (R, 3) centre, and length, width, height [m].
        turn: (R, 4) unit quaternions.
        bad: The other rows.
    """

    def __init__(self, table: pa.Table, path: Path, poses: RecordedPoses) -> None:
        times, has_time = integers(table, path, "timestamp_ns")
        tracks, has_track = text(table, path, "track_uuid")
        categories, has_category = text(table, path, "category")
        place, size = numbers(table, path, *TRANSLATION), numbers(table, path, *_SIZE)
        turn, is_turn = quaternions(table, path)
        is_box = ~np.asarray(pc.equal(categories, _EGO_CATEGORY).to_numpy(zero_copy_only=False), np.bool_)
        has_time &= poses.covers(times)
        self.sweeps, sweep = np.unique(times[has_time], return_inverse=True)
        sweeps = np.full(len(times), -1)
        sweeps[has_time] = sweep
        self.bad: list[BadBoxes] = []
        kept = is_box.copy()

        def drop(mask: Bool, field: str, reason: str) -> None:
            nonlocal kept
            rows = np.flatnonzero(mask & kept)
            kept &= ~mask
            if len(rows):
                self.bad.append(BadBoxes(rows, sweeps[rows], field, reason))

        drop(~has_time, "timestamp_ns", "expected a time with a pose of the ego, found another")
        drop(~has_track, "track_uuid", "expected the id of a track, found null")
        drop(~is_turn, "qw", "expected a quaternion of length 1, found another")
        for bad in find_bad_rows(place, np.zeros(len(place)), None, size, np.zeros(2)):
            drop(bad.mask, _FIELDS[bad.field], bad.reason)
        repeated = find_repeated_rows(tracks.indices.to_numpy(), sweeps, kept)
        if repeated:
            drop(repeated.mask, "track_uuid", repeated.reason)
        (rows,) = np.nonzero(kept)
        known = np.isin(categories.to_numpy(zero_copy_only=False), list(SENSOR_CATEGORIES)) & has_category
        unknown = rows[~known[rows]]
        if len(unknown):
            found = categories[int(unknown[0])].as_py() or "null"
            reason = f"expected a category of the sensor dataset, found {found!r}"
            self.bad.append(BadBoxes(unknown, sweeps[unknown], "category", reason, is_dropped=False))
        self.sweep, self.tracks, self.categories = sweeps[rows], tracks.take(rows), categories.take(rows)
        self.place, self.size, self.turn = place[rows], size[rows], turn[rows]


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
            "num_interpolated_poses": int(log.is_interpolated.sum()),
            "num_completed_links": log.roads.num_completed_links,
        },
        defects=_defects(window),
    )


def _defects(window: Argoverse2Window) -> tuple[Defect, ...]:
    """Defects in the sweeps of a window; the first window has those of unknown time and of the log's other files."""
    log, defects = window.log, Defects()
    for bad in log.bad:
        inside = (bad.sweep >= window.first) & (bad.sweep < window.last) | (bad.sweep < 0) & (window.first == 0)
        act = defects.drop if bad.is_dropped else defects.assume
        act("tracks", log.file, bad.rows[inside].tolist(), bad.field, bad.reason)
    if window.first == 0:
        poses = (PurePosixPath(log.file).parent / _POSES).as_posix()
        wanted = "expected a pose near the others, found another"
        defects.drop("tracks", poses, log.bad_poses.tolist(), "tx_m", wanted)
    part = slice(window.first, window.last)
    sweeps = [f"sweep {time}" for time in log.sweeps[part][log.is_interpolated[part]]]
    poses = (PurePosixPath(log.file).parent / _POSES).as_posix()
    wanted = "expected a pose at each annotated sweep, found none; interpolated between the adjacent ones"
    defects.assume("tracks", poses, sweeps, "timestamp_ns", wanted)
    return (*defects.found(), *log.roads.defects)


def _tracks(window: Argoverse2Window, ego: Float64, timestamps: Float64, origin: Float64) -> Tracks:
    """Build the annotated objects of the window, followed by the ego."""
    log = window.log
    (rows,) = np.nonzero((log.sweep >= window.first) & (log.sweep < window.last))
    grid = TrackGrid(log.tracks.take(rows), log.sweep[rows] - window.first, len(timestamps))
    words = log.categories.take(rows[grid.first]).to_pylist()
    boxes = np.concatenate(
        [grid.place(log.boxes[rows]), np.column_stack([ego, np.tile(EGO_SIZE, (len(ego), 1))])[None]]
    )
    valid = np.concatenate([grid.valid, np.ones((1, len(timestamps)), np.bool_)])
    kinds = [SENSOR_CATEGORIES.get(word, ObjectType.OTHER) for word in words]
    is_interpolated = np.zeros(valid.shape, np.bool_)
    is_interpolated[-1] = log.is_interpolated[window.first : window.last]
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
        is_interpolated=is_interpolated,
    )
