"""Read a nuPlan log, an SQLite file: its sweeps with the ego's pose, its scenes and its tags.

Tables and columns as in nuplan-devkit, ``nuplan/database/nuplan_db_orm``. Tokens are blobs of 8 bytes in the file and
16 hex digits here. ``content`` reads the large tables: boxes and light states.
"""

from __future__ import annotations

import re
import sqlite3
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.arrays.geometry import rotate, yaw_from_quaternion
from scenarionet_data.building import bridge_gaps
from scenarionet_data.building.plausible import find_bad_rows, find_jumps
from scenarionet_data.converters.nuplan.types import REAR_AXLE_TO_CENTER
from scenarionet_data.errors import CorruptSource

SWEEP = 50_000
"""Nominal time between sweeps [us]."""
_SLACK = 1_000_000
"""Time beyond its length within which the sweeps of a scene are [us]."""
_SWEEPS = """
    SELECT lower(hex(p.token)), p.timestamp, lower(hex(p.scene_token)), e.epsg,
        e.x, e.y, e.qw, e.qx, e.qy, e.qz, e.vx, e.vy, e.angular_rate_z
    FROM lidar_pc p LEFT JOIN ego_pose e ON e.token = p.ego_pose_token ORDER BY p.timestamp, p.token
"""
_SCENES = """
    SELECT lower(hex(s.token)), CAST(s.name AS TEXT), CAST(s.roadblock_ids AS TEXT), g.x, g.y, g.qw, g.qx, g.qy, g.qz
    FROM scene s LEFT JOIN ego_pose g ON g.token = s.goal_ego_pose_token
"""
_TAGS = """
    SELECT CAST(ifnull(t.type, '') AS TEXT), lower(hex(t.lidar_pc_token)), lower(hex(t.agent_track_token))
    FROM scenario_tag t LEFT JOIN lidar_pc p ON p.token = t.lidar_pc_token ORDER BY p.timestamp, t.type, t.token
"""
_PLACE = "SELECT CAST(location AS TEXT), CAST(map_version AS TEXT), CAST(date AS TEXT) FROM log"
_TAG_TYPES = "SELECT DISTINCT CAST(type AS TEXT) AS word FROM scenario_tag WHERE type IS NOT NULL ORDER BY word"


@dataclass(frozen=True)
class LogLocation:
    """Place and date of a log.

    Attributes:
        city: The log's location, as named by the source.
        map_name: The log's map; the location if missing.
        date: Date of the recording, as written by the source.
    """

    city: str
    map_name: str
    date: str | None


@dataclass(frozen=True)
class NuPlanScene:
    """A scene of a log.

    Attributes:
        token: 16 hex digits.
        name: For example ``scene-001``; None if the log does not contain the scene.
        roadblock_ids: Route of the ego.
        goal: x, y [m], heading [rad] of the ego's box at the goal of the scene's mission, or None.
    """

    token: str
    name: str | None = None
    roadblock_ids: tuple[str, ...] = ()
    goal: tuple[float, float, float] | None = None


@dataclass(frozen=True)
class Tag:
    """A scenario tag: type, token of the sweep, and token of the track concerned, or an empty string."""

    type: str
    sweep: str
    track: str


@dataclass(frozen=True, eq=False)
class NuPlanLog:
    """One log: S sweeps sorted by time, in the city's UTM zone.

    Attributes:
        name: The file's name without its suffix.
        place: Place and date.
        tokens: S tokens.
        times: (S,) int64 [us].
        scene: (S,) row in ``scenes``; -1 for a sweep without scene.
        ego: (S, 5) x, y [m] and heading [rad] of the ego's box, vx, vy [m/s] of its centre; NaN without
            pose.
        bad_poses: (S,) whether the recorded pose cannot be used, so that ``ego`` is interpolated or NaN.
        epsg: Code of the UTM zone, or None.
        scenes: Scenes of the sweeps, sorted by time.
        tags: Sorted by time.
        lost_sweeps: Sweeps without a usable time, by the token of their scene: their tokens and reasons.
    """

    name: str
    place: LogLocation
    tokens: list[str]
    times: Int64
    scene: Int64
    ego: Float64
    bad_poses: Bool
    epsg: int | None
    scenes: list[NuPlanScene]
    tags: list[Tag]
    lost_sweeps: Mapping[str, list[tuple[str, str]]]


def uri(path: Path) -> str:
    """Open mode of SQLite for an immutable file: without locks and without a writable folder for them."""
    return f"{path.absolute().as_uri()}?mode=ro&immutable=1"


def unreadable(path: Path, error: Exception) -> CorruptSource:
    """Error for a log that SQLite cannot read."""
    return CorruptSource(f"{path}: expected a nuPlan log, found {finding(error)}; download it again")


def finding(error: Exception) -> str:
    """What is wrong with a database that SQLite cannot read; its own messages may contain bytes of the file."""
    lacking = re.search(r"no such (table|column): ([\w.]+)", str(error))
    if lacking:
        return f"no {lacking[1]} {lacking[2]}"
    return "another format" if "not a database" in str(error) else "a damaged file"


def as_text(data: bytes) -> str:
    """Text of a database, with U+FFFD for bytes that are not UTF-8."""
    return data.decode("utf-8", "replace")


@contextmanager
def opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a log for reading.

    Raises:
        CorruptSource: Missing, damaged, or without a required table or column.
    """
    try:
        with closing(sqlite3.connect(uri(path), uri=True)) as database:
            database.text_factory = as_text
            yield database
    except sqlite3.Error as error:
        raise unreadable(path, error) from error


def read_place(database: sqlite3.Connection, path: Path) -> LogLocation:
    """Read the place and date of a log.

    Raises:
        CorruptSource: Its table ``log`` is empty.
    """
    row = database.execute(_PLACE).fetchone()
    if row is None:
        raise CorruptSource(f"{path}: expected a row of table log, found none; download it again")
    city, map_version, date = row
    return LogLocation(city or "", (map_version or city or "").removesuffix(".gpkg"), date)


def read_tag_types(database: sqlite3.Connection) -> tuple[str, ...]:
    """Types of the scenario tags, sorted."""
    return tuple(row[0] for row in database.execute(_TAG_TYPES))


def read_log(database: sqlite3.Connection, path: Path) -> NuPlanLog:
    """Read everything except boxes and light states.

    Raises:
        CorruptSource: No sweeps with a time.
    """
    lost: defaultdict[str, list[tuple[str, str]]] = defaultdict(list)
    rows = _usable_sweeps(database.execute(_SWEEPS).fetchall(), lost)
    if not rows:
        raise CorruptSource(f"{path}: expected rows of table lidar_pc with a timestamp, found none; download it again")
    tokens, times, scene_tokens, epsg = list(zip(*rows, strict=True))[:4]
    known = {scene.token: scene for scene in _read_scenes(database)}
    used = {token: row for row, token in enumerate(dict.fromkeys(filter(None, (*scene_tokens, *lost))))}
    poses = _floats([row[4:] for row in rows])
    box = _box_of(poses[:, :6])
    # The centre is d ahead of the rear axle on the rigid body, so its velocity is (vx, vy + yaw rate x d).
    forward, left, yaw_rate = poses[:, 6:].T
    velocity = np.stack([forward, left + yaw_rate * REAR_AXLE_TO_CENTER], axis=-1)
    ego, bad_poses = _repaired(np.concatenate([box, rotate(velocity, box[:, 2])], axis=1), np.array(times, np.int64))
    return NuPlanLog(
        name=path.stem,
        place=read_place(database, path),
        tokens=list(tokens),
        times=np.array(times, np.int64),
        scene=np.array([used.get(token, -1) for token in scene_tokens], np.int64),
        ego=ego,
        bad_poses=bad_poses,
        epsg=next((code for code, _ in Counter(code for code in epsg if type(code) is int).most_common(1)), None),
        scenes=[known.get(token, NuPlanScene(token)) for token in used],
        tags=[Tag(*row) for row in database.execute(_TAGS)],
        lost_sweeps=lost,
    )


def _usable_sweeps(rows: list[Any], lost: dict[str, list[tuple[str, str]]]) -> list[Any]:
    """Rows of sweeps with a time of their own that fits those of their scene; the others are added to ``lost``."""

    def drop(bad: set[int], reason: str) -> None:
        nonlocal rows
        for number in sorted(bad):
            lost[rows[number][2]].append((rows[number][0], reason))
        rows = [row for number, row in enumerate(rows) if number not in bad]

    drop({k for k, row in enumerate(rows) if type(row[1]) is not int}, "expected microseconds, found no integer")
    members: dict[str, list[int]] = {}
    for number, row in enumerate(rows):
        members.setdefault(row[2], []).append(number)
    far: set[int] = set()
    for scene, numbers in members.items():
        middle, reach = rows[numbers[len(numbers) // 2]][1], SWEEP * len(numbers) + _SLACK
        far |= {number for number in numbers if scene and abs(rows[number][1] - middle) > reach}
    drop(far, "expected a time during the scene, found another")
    repeats = {k for k, (before, after) in enumerate(pairwise(rows), start=1) if before[1] == after[1]}
    drop(repeats, "expected one sweep at a time, found another")
    return rows


def _repaired(ego: Float64, times: Int64) -> tuple[Float64, Bool]:
    """Interpolate the ego (S, 5) where its pose is missing or implausible, over short gaps; and where that is."""
    good = np.asarray(np.isfinite(ego).all(axis=1))
    if good.any():
        for fault in find_bad_rows(ego[:, :2], ego[:, 2], ego[:, 3:], None, np.median(ego[good, :2], axis=0)):
            good &= ~fault.mask
        rows = np.flatnonzero(good)
        jumps = find_jumps(ego[None, rows, :2], np.ones((1, len(rows)), np.bool_), times[rows] * 1e-6)[0]
        good[rows[jumps]] = False
    seconds = (times - times[0]) * 1e-6
    return bridge_gaps(seconds, good, ego, angle=2)[0], ~good


def _read_scenes(database: sqlite3.Connection) -> Iterator[NuPlanScene]:
    for token, name, roadblock_ids, *goal in database.execute(_SCENES).fetchall():
        (place,) = _box_of(_floats([goal])).tolist()
        is_known = bool(np.isfinite(place).all())
        yield NuPlanScene(token, name or "", tuple((roadblock_ids or "").split()), tuple(place) if is_known else None)


def _floats(rows: Sequence[Sequence[Any]]) -> Float64:
    """Convert rows of numbers to an array; NaN for NULL, text and blobs."""
    try:
        return np.array(rows, np.float64)
    except (TypeError, ValueError):
        return np.array([[v if isinstance(v, (int, float)) else np.nan for v in row] for row in rows], np.float64)


def _box_of(poses: Float64) -> Float64:
    """(S, 3) x, y, heading of the ego's box from the rear axle's x, y, qw, qx, qy, qz (S, 6)."""
    heading = yaw_from_quaternion(*poses[:, 2:].T)
    is_turn = np.abs(np.linalg.norm(poses[:, 2:], axis=1) - 1.0) < 1e-2
    heading = np.where(is_turn, heading, np.nan)
    ahead = REAR_AXLE_TO_CENTER * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return np.column_stack([poses[:, :2] + ahead, heading])


@dataclass(frozen=True, eq=False)
class NuPlanWindow:
    """The sweeps of one scenario.

    Attributes:
        sweeps: (T,) int64 rows of the log's sweeps, increasing; empty for a tag of a missing sweep, or a scene without
            usable sweeps.
        current: Index of the last sweep of the history.
        token: Token of the scene, or of the tag's sweep.
        tags: Types of the tags of that sweep, or of all sweeps of the scene.
        tracks: Tracks concerned by the tags of a tag's sweep.
    """

    sweeps: Int64
    current: int
    token: str
    tags: tuple[str, ...]
    tracks: tuple[str, ...] = ()


def scenes(log: NuPlanLog, stride: int, past: float) -> Iterator[NuPlanWindow]:
    """Yield the scenes sorted by time, with every ``stride``-th sweep and ``past`` seconds of history."""
    sweep_of = {token: row for row, token in enumerate(log.tokens)}
    tagged = [(sweep_of[tag.sweep], tag.type) for tag in log.tags if tag.sweep in sweep_of]
    types: dict[int, set[str]] = {}
    for sweep, kind in tagged:
        types.setdefault(int(log.scene[sweep]), set()).add(kind)
    for row, scene in enumerate(log.scenes):
        sweeps = np.flatnonzero(log.scene == row)[::stride]
        current = _last_before(log, sweeps, past) if len(sweeps) else 0
        yield NuPlanWindow(sweeps, current, scene.token, tuple(sorted(types.get(row, ()))))


def _last_before(log: NuPlanLog, sweeps: Int64, past: float) -> int:
    """Position of the last sweep not later than ``past`` seconds after the first."""
    times = log.times[sweeps]
    return int(np.searchsorted(times, times[0] + past * 1e6 + SWEEP / 2, side="right")) - 1


def tag_windows(
    log: NuPlanLog, stride: int, past: float, future: float, wanted: Collection[str]
) -> Iterator[NuPlanWindow]:
    """Yield a window around every tagged sweep, sorted by time, from ``past`` to ``future`` seconds.

    The tags of one sweep share a window. Windows are shorter at the ends of the log.

    Args:
        log: The log.
        stride: Take every ``stride``-th sweep, counted from the tagged one.
        past, future: Seconds.
        wanted: Types of tags; all if empty.
    """
    sweep_of = {token: row for row, token in enumerate(log.tokens)}
    by_sweep: dict[str, list[tuple[str, str]]] = {}
    for tag in log.tags:
        if not wanted or tag.type in wanted:
            by_sweep.setdefault(tag.sweep, []).append((tag.type, tag.track))
    for token, tags in by_sweep.items():
        types = tuple(dict.fromkeys(kind for kind, _ in tags))
        tracks = tuple(dict.fromkeys(track for _, track in tags if track))
        here = sweep_of.get(token)
        if here is None:
            yield NuPlanWindow(np.zeros(0, np.int64), 0, token, types, tracks)
            continue
        bounds = [log.times[here] - past * 1e6 - SWEEP / 2, log.times[here] + future * 1e6 + SWEEP / 2]
        first, last = np.searchsorted(log.times, bounds)
        before = np.arange(here, first - 1, -stride)[::-1]
        sweeps = np.concatenate([before, np.arange(here + stride, last, stride)])
        yield NuPlanWindow(sweeps, len(before) - 1, token, types, tracks)
