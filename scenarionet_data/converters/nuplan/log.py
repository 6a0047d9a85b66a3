"""Read a nuPlan log, an SQLite file: its sweeps with the ego's pose, its scenes and its tags.

Tables and columns as in nuplan-devkit, ``nuplan/database/nuplan_db_orm``. Tokens are blobs of 8 bytes in the file and
16 hex digits here. ``content`` reads the large tables: boxes and light states.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64, Int64
from scenarionet_data.arrays.geometry import rotate, yaw_from_quaternion
from scenarionet_data.converters.nuplan.types import REAR_AXLE_TO_CENTER
from scenarionet_data.errors import CorruptSource

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
        epsg: Code of the UTM zone, or None.
        scenes: Scenes of the sweeps, sorted by time.
        tags: Sorted by time.
    """

    name: str
    place: LogLocation
    tokens: list[str]
    times: Int64
    scene: Int64
    ego: Float64
    epsg: int | None
    scenes: list[NuPlanScene]
    tags: list[Tag]


def uri(path: Path) -> str:
    """Open mode of SQLite for an immutable file: without locks and without a writable folder for them."""
    return f"{path.absolute().as_uri()}?mode=ro&immutable=1"


def unreadable(path: Path, error: Exception) -> CorruptSource:
    """Error for a log that SQLite cannot read."""
    return CorruptSource(f"{path} cannot be read as a nuPlan log ({error}); download it again")


@contextmanager
def opened(path: Path) -> Iterator[sqlite3.Connection]:
    """Open a log for reading.

    Raises:
        CorruptSource: Missing, damaged, or without a required table or column.
    """
    try:
        with closing(sqlite3.connect(uri(path), uri=True)) as database:
            yield database
    except sqlite3.Error as error:
        raise unreadable(path, error) from error


def read_place(database: sqlite3.Connection, path: Path) -> LogLocation:
    """Read the place and date of a log.

    Raises:
        CorruptSource: Its table ``log`` is empty.
    """
    row = database.execute("SELECT location, map_version, date FROM log").fetchone()
    if row is None:
        raise CorruptSource(f"{path}: table log has no row; download it again")
    city, map_version, date = row
    return LogLocation(city or "", (map_version or city or "").removesuffix(".gpkg"), date)


def read_tag_types(database: sqlite3.Connection) -> tuple[str, ...]:
    """Types of the scenario tags, sorted."""
    return tuple(row[0] for row in database.execute(_TAG_TYPES))


def read_log(database: sqlite3.Connection, path: Path) -> NuPlanLog:
    """Read everything except boxes and light states.

    Raises:
        CorruptSource: No sweeps, or one without timestamp.
    """
    rows = database.execute(_SWEEPS).fetchall()
    if not rows:
        raise CorruptSource(f"{path}: table lidar_pc has no rows; download it again")
    tokens, times, scene_tokens, epsg = list(zip(*rows, strict=True))[:4]
    timeless = [token for token, time in zip(tokens, times, strict=True) if not isinstance(time, int)]
    if timeless:
        raise CorruptSource(f"{path}: lidar_pc {timeless[0]} has no timestamp; download it again")
    known = {scene.token: scene for scene in _read_scenes(database)}
    used = {token: row for row, token in enumerate(dict.fromkeys(filter(None, scene_tokens)))}
    return NuPlanLog(
        name=path.stem,
        place=read_place(database, path),
        tokens=list(tokens),
        times=np.array(times, np.int64),
        scene=np.array([used.get(token, -1) for token in scene_tokens], np.int64),
        ego=_ego(_floats([row[4:] for row in rows])),
        epsg=next((code for code in epsg if code), None),
        scenes=[known.get(token, NuPlanScene(token)) for token in used],
        tags=[Tag(*row) for row in database.execute(_TAGS)],
    )


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


def _ego(poses: Float64) -> Float64:
    """(S, 5) box and velocity of the ego from its recorded poses (S, 9).

    The log contains the pose of the rear axle, its velocity in the vehicle frame (x forward, y left) and the yaw rate
    w. The centre is d ahead of the axle on the rigid body, so its velocity is (vx, vy + w d).
    """
    box = _box_of(poses[:, :6])
    forward, left, yaw_rate = poses[:, 6:].T
    velocity = np.stack([forward, left + yaw_rate * REAR_AXLE_TO_CENTER], axis=-1)
    return np.concatenate([box, rotate(velocity, box[:, 2])], axis=1)


def _box_of(poses: Float64) -> Float64:
    """(S, 3) x, y, heading of the ego's box from the rear axle's x, y, qw, qx, qy, qz (S, 6)."""
    heading = yaw_from_quaternion(*poses[:, 2:].T)
    is_turn = np.abs(np.linalg.norm(poses[:, 2:], axis=1) - 1.0) < 1e-2
    heading = np.where(is_turn, heading, np.nan)
    ahead = REAR_AXLE_TO_CENTER * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    return np.column_stack([poses[:, :2] + ahead, heading])
