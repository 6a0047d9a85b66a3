"""Convert a window of a nuPlan log to a scenario: tracks, lights, and the crop of the city map."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int64
from scenarionet_data.arrays.geometry import estimate_velocity
from scenarionet_data.building import StateGrid, make_origin, make_tracks
from scenarionet_data.building.plausible import MAX_SPEED, find_bad_rows, find_repeated_rows
from scenarionet_data.converters.nuplan.content import NuPlanContent
from scenarionet_data.converters.nuplan.log import SWEEP, NuPlanLog, NuPlanScene, NuPlanWindow
from scenarionet_data.converters.nuplan.map_features import NuPlanCity
from scenarionet_data.converters.nuplan.types import EGO, EGO_SIZE, OBJECTS, STATIC
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.defects import Defects, merge_defects
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import (
    Lights,
    ScenarioDescription,
    Source,
    Tracks,
    make_scenario_id,
    strings,
)
from scenarionet_data.scenario.vocabulary import LightState, ObjectType, Provenance

_COLUMNS = {"position": "x, y", "heading": "yaw", "size": "length, width, height"}
"""Columns of ``lidar_box`` by the field at fault."""
_LIGHT_FIELDS = (
    ("connector", "lane_connector_id", "a lane connector"),
    ("state", "status", "green, yellow, red or unknown"),
)
"""Fields of light states: name, column, expected values."""


@dataclass(frozen=True, eq=False)
class Cut:
    """A record: one window with its log and map.

    Attributes:
        log, content: The content of the log.
        window: The window.
        city: The map.
        map_id: The map's id in the lake.
        radius: Margin of the map around the ego's path [m].
        stride: Number of sweeps per timestep.
    """

    log: NuPlanLog
    content: NuPlanContent
    window: NuPlanWindow
    city: NuPlanCity
    map_id: str
    radius: float
    stride: int


def describe(shard: Shard, cut: Cut, licence: str) -> ScenarioDescription:
    """Convert one window to a scenario.

    Raises:
        InvalidScenario: The window has no sweeps, or no pose of the ego.
    """
    log, window = cut.log, cut.window
    scenario_id = make_scenario_id(shard.dataset, shard.version, log.name, window.token)
    report = _Report(shard.items[0].name, cut)
    ego, scene = _ego_of(scenario_id, cut, report), _scene_of(cut, report)
    timestamps = (log.times[window.sweeps] - log.times[window.sweeps[0]]) * 1e-6
    is_there = np.asarray(np.isfinite(ego).all(axis=1))
    origin = make_origin(np.column_stack([ego[:, :2], np.zeros(len(ego))]), is_there, has_z=False)
    roads, crop = cut.city.around(ego[is_there], cut.radius, origin)
    tracks = _tracks(cut, report, ego, timestamps, origin)
    known = set(tracks.ids)
    if not len(roads):
        report.defects.assume_empty_map(shard.items[0].name)
    written = re.match(r"\d{4}-\d{2}-\d{2}", log.place.date or "")
    return ScenarioDescription(
        id=scenario_id,
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        timestamps=timestamps,
        dt=cut.stride * SWEEP / 1e6,
        current_timestep=window.current,
        ego_id=EGO,
        origin=origin,
        has_z=False,
        source=Source(
            scenario_id=window.token,
            file=shard.items[0].name,
            licence=licence,
            log=log.name,
            city=log.place.city,
            date=written[0] if written else str(log.times[0].astype("datetime64[us]").astype("datetime64[D]")),
            crs=cut.city.projection.upper(),
        ),
        tracks=tracks,
        lights=_lights(cut, report, origin),
        map=roads,
        map_id=cut.map_id,
        map_crop=crop,
        objects_of_interest=tuple(track for track in window.tracks if track in known),
        extras=_extras(cut, scene, origin),
        defects=merge_defects([*report.defects.found(), *cut.content.lost_rows(shard.items[0].name, window.sweeps)]),
    )


class _Report:
    """Collects the defects of a window; rows are named by their track and sweep."""

    def __init__(self, file: str, cut: Cut) -> None:
        self.defects = Defects()
        self._file = file
        self._cut = cut

    def drop_rows(self, table: str, rows: Array, field: str, reason: str) -> None:
        """Count rows of boxes or light states that are left out."""
        self.defects.drop(table, self._file, [self._name(row) for row in rows], field, reason)

    def assume(self, table: str, places: Sequence[object], field: str, reason: str) -> None:
        """Count rows that are kept with an assumed value."""
        self.defects.assume(table, self._file, places, field, reason)

    def drop(self, places: Sequence[object], field: str, reason: str) -> None:
        """Count poses that are left out."""
        self.defects.drop("tracks", self._file, places, field, reason)

    def _name(self, row: Any) -> str:
        sweep = self._cut.log.tokens[row["sweep"]]
        if "track" not in row.dtype.names:
            return f"connector {row['connector']} at {sweep}"
        track = self._cut.content.tracks[row["track"]] if row["track"] >= 0 else "a box"
        return f"{track} at {sweep}"


def _ego_of(scenario_id: str, cut: Cut, report: _Report) -> Float64:
    """(T, 5) poses of the ego; NaN where unknown.

    Raises:
        InvalidScenario: No sweeps or no poses.
    """
    log, sweeps = cut.log, cut.window.sweeps
    if not len(sweeps):
        wanted = f"expected a row of lidar_pc with a time for {cut.window.token}, found none"
        raise InvalidScenario(scenario_id, "lidar_pc", wanted)
    ego, bad = log.ego[sweeps], sweeps[log.bad_poses[sweeps]]
    if not np.isfinite(ego).all(axis=1).any():
        wanted = f"expected numbers in a row of ego_pose for the sweeps from {log.tokens[sweeps[0]]}, found none"
        raise InvalidScenario(scenario_id, "ego_pose", wanted)
    reason = "expected a pose on the ego's path for each sweep, found none"
    report.drop([log.tokens[row] for row in bad], "ego_pose", reason)
    filled = [log.tokens[row] for row in bad if np.isfinite(log.ego[row]).all()]
    report.assume("tracks", filled, "ego_pose", f"{reason}; interpolated between its neighbours")
    return ego


def _scene_of(cut: Cut, report: _Report) -> NuPlanScene | None:
    """The scene of the current timestep, if it has one."""
    row = int(cut.log.scene[cut.window.sweeps[cut.window.current]])
    scene = cut.log.scenes[row] if row >= 0 else None
    for token, reason in cut.log.lost_sweeps.get(scene.token if scene else "", ()):
        report.drop([token], "lidar_pc.timestamp", reason)
    if scene is not None and scene.name is None:
        report.assume("tracks", [scene.token], "scene", "expected a row of scene, found none; it has no name and route")
    return scene


def _extras(cut: Cut, scene: NuPlanScene | None, origin: Float64) -> Mapping[str, Any]:
    log, window = cut.log, cut.window
    extras: dict[str, Any] = {
        "lidar_pc_token": log.tokens[window.sweeps[window.current]],
        "start_timestamp_us": int(log.times[window.sweeps[0]]),
        "tags": list(window.tags),
    }
    if scene is not None:
        extras |= {"scene": scene.name, "scene_token": scene.token, "roadblock_ids": list(scene.roadblock_ids)}
        if scene.goal is not None:
            x, y, heading = scene.goal
            extras["goal"] = {"x": float(x - origin[0]), "y": float(y - origin[1]), "heading": heading}
    return extras


# --- tracks ---------------------------------------------------------------------------------------------


def _tracks(cut: Cut, report: _Report, ego: Float64, timestamps: Float64, origin: Float64) -> Tracks:
    """Build the tracks of the window, followed by the ego."""
    content = cut.content
    known = np.flatnonzero(np.isfinite(ego).all(axis=1))
    boxes, step = _usable_boxes(cut, report, np.median(ego[known, :2], axis=0))
    used, row = np.unique(boxes["track"], return_inverse=True)
    categories = [content.categories[track] for track in used]
    unnamed = [content.tracks[track] for track, word in zip(used, categories, strict=True) if word is None]
    reason = "expected a row of category, found none; the type is OTHER"
    report.assume("tracks", unnamed, "track.category_token", reason)
    words = [word or "" for word in categories]
    is_static = np.array([word in STATIC for word in words], np.bool_)
    velocity, is_estimated = _velocity(boxes, row, step, timestamps, is_static)
    own = np.column_stack([ego[known, 2], np.broadcast_to(EGO_SIZE, (len(known), 3))])
    state = np.concatenate([boxes["state"][:, :4], own])
    is_between = cut.log.bad_poses[cut.window.sweeps][known]
    rows = np.concatenate([row, np.full(len(known), len(used))])
    grid = StateGrid(rows, np.concatenate([step, known]), (len(used) + 1, len(timestamps)))
    return make_tracks(
        [*(content.tracks[track] for track in used), EGO],
        [*(OBJECTS.get(word, ObjectType.OTHER) for word in words), ObjectType.VEHICLE],
        grid.place(np.pad(np.concatenate([boxes["position"], ego[known, :2]]), ((0, 0), (0, 1)))),
        grid.place(state[:, 0]),
        grid.place(np.concatenate([velocity, ego[known, 3:]])),
        grid.place(state[:, 1:]),
        grid.valid,
        origin=origin,
        source_type=[*categories, EGO],
        is_size_assumed=[False] * len(words) + [True],
        is_type_assumed=[word not in OBJECTS for word in words] + [False],
        is_velocity_estimated=[*is_estimated.tolist(), False],
        is_interpolated=grid.place(np.concatenate([np.zeros(len(step), np.bool_), is_between])),
    )


def _usable_boxes(cut: Cut, report: _Report, centre: Float64) -> tuple[Array, Int64]:
    """Boxes of the window and their timesteps, without rows that cannot be; an implausible velocity becomes NaN."""
    boxes, step = cut.content.boxes.of(cut.window.sweeps)
    good = np.ones(len(boxes), np.bool_)

    def drop(mask: Bool, field: str, reason: str) -> None:
        report.drop_rows("tracks", boxes[mask & good], field, reason)
        good[mask] = False

    drop(boxes["track"] < 0, "lidar_box.track_token", "expected a known track, found none")
    state = boxes["state"]
    for fault in find_bad_rows(boxes["position"], state[:, 0], None, state[:, 1:4], centre):
        drop(fault.mask, f"lidar_box.{_COLUMNS[fault.field]}", fault.reason)
    if len(np.unique(boxes["track"][good].astype(np.int64) * len(cut.window.sweeps) + step[good])) < good.sum():
        repeated = find_repeated_rows(boxes["track"], step, good)
        mask = repeated.mask if repeated else ~good
        drop(mask, "lidar_box.track_token", "expected one box for a track and sweep, found another")
    if not good.all():
        boxes, step, state = boxes[good], step[good], state[good]
    is_fast = (np.abs(state[:, 4:]) > MAX_SPEED).any(axis=1)
    if is_fast.any():
        boxes = boxes.copy()
        boxes["state"][is_fast, 4:] = np.nan
        tracks = [cut.content.tracks[track] for track in boxes["track"][is_fast]]
        reason = f"expected velocities of up to {MAX_SPEED:.0f} m/s, found another; estimated from positions"
        report.assume("tracks", tracks, "lidar_box.vx, vy", reason)
    return boxes, step


def _velocity(boxes: Array, row: Int64, step: Int64, timestamps: Float64, is_static: Bool) -> tuple[Float32, Bool]:
    """Velocity of each box (R, 2), and whether it was completed for a track (N,).

    Missing velocities are 0 for static objects, and estimated from positions for others.

    Args:
        boxes, row, step: (R,) the boxes, and their tracks and timesteps.
        timestamps: (T,) [s].
        is_static: (N,) whether a track is static.
    """
    velocity = np.array(boxes["state"][:, 4:])
    is_missing = np.isnan(velocity).any(axis=1)
    velocity[is_missing] = 0.0
    is_estimated = np.bincount(row, is_missing, len(is_static)) > 0
    moving = is_estimated & ~is_static
    if moving.any():
        grid = np.zeros((len(is_static), len(timestamps), 2))
        valid = np.zeros(grid.shape[:2], np.bool_)
        grid[row, step], valid[row, step] = boxes["position"], True
        wanted = is_missing & moving[row]
        estimate = np.zeros_like(grid)
        estimate[moving] = estimate_velocity(grid[moving], valid[moving], timestamps)
        velocity[wanted] = estimate[row[wanted], step[wanted]]
    return velocity, is_estimated


# --- lights ---------------------------------------------------------------------------------------------


def _lights(cut: Cut, report: _Report, origin: Float64) -> Lights:
    """Build one light per lane connector, with the stop point at its start."""
    rows, step = cut.content.lights.of(cut.window.sweeps)
    for field, column, wanted in _LIGHT_FIELDS:
        bad = rows[field] < 0
        report.drop_rows("lights", rows[bad], f"traffic_light_status.{column}", f"expected {wanted}, found another")
        rows, step = rows[~bad], step[~bad]
    connectors, light = np.unique(rows["connector"], return_inverse=True)
    state = np.full((len(connectors), len(cut.window.sweeps)), LightState.ABSENT, np.uint8)
    state[light, step] = rows["state"]
    is_contradicted = state[light, step] != rows["state"]  # a later row of the same connector and sweep wins
    state[light[is_contradicted], step[is_contradicted]] = LightState.TRAFFIC_LIGHT_UNKNOWN
    ids = strings(connectors)
    starts = cut.city.starts
    stop_point = np.full((len(ids), 3), np.nan, np.float32)
    for row, lane in enumerate(ids):
        if lane in starts:
            stop_point[row] = *(starts[lane] - origin[:2]), 0.0
    return Lights(
        ids=ids,
        lane_ids=ids,
        stop_point=stop_point,
        state=state,
        is_lane_in_map=np.array([lane in starts for lane in ids], np.bool_),
        provenance=np.full(len(ids), Provenance.OBSERVED, np.uint8),
    )
