"""Convert a window of a nuPlan log to a scenario: tracks, lights, and the crop of the city map."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int64
from scenarionet_data.arrays.geometry import estimate_velocity
from scenarionet_data.building import make_origin, make_tracks_of_rows
from scenarionet_data.converters.nuplan.content import NuPlanContent
from scenarionet_data.converters.nuplan.log import NuPlanLog, NuPlanScene
from scenarionet_data.converters.nuplan.map_features import NuPlanCity
from scenarionet_data.converters.nuplan.types import EGO, EGO_SIZE, OBJECTS, STATIC
from scenarionet_data.converters.nuplan.windows import SWEEP, NuPlanWindow
from scenarionet_data.errors import InvalidScenario
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
        InvalidScenario: The window has a row that is damaged or refers to a missing one.
    """
    log, window = cut.log, cut.window
    scenario_id = make_scenario_id(shard.dataset, shard.version, log.name, window.token)
    ego, scene = _checked(scenario_id, cut)
    timestamps = (log.times[window.sweeps] - log.times[window.sweeps[0]]) * 1e-6
    is_there = np.ones(len(ego), np.bool_)
    origin = make_origin(np.column_stack([ego[:, :2], np.zeros(len(ego))]), is_there, has_z=False)
    low, high = ego[:, :2].min(axis=0) - cut.radius, ego[:, :2].max(axis=0) + cut.radius
    crop = cut.city.features.crop((low[0], low[1], high[0], high[1]), cut.city.bounds)
    tracks = _tracks(scenario_id, cut, ego, timestamps, origin)
    known = set(tracks.ids)
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
            date=_date(log),
            crs=cut.city.projection.upper(),
        ),
        tracks=tracks,
        lights=_lights(scenario_id, cut, origin),
        map=crop.build(origin, has_z=False),
        map_id=cut.map_id,
        map_crop=(
            float(low[0] - origin[0]),
            float(low[1] - origin[1]),
            float(high[0] - origin[0]),
            float(high[1] - origin[1]),
        ),
        objects_of_interest=tuple(track for track in window.tracks if track in known),
        extras=_extras(cut, scene, origin),
    )


def _checked(scenario_id: str, cut: Cut) -> tuple[Float64, NuPlanScene | None]:
    """(T, 5) poses of the ego, and the scene of the current timestep; InvalidScenario if missing."""
    log, sweeps = cut.log, cut.window.sweeps
    if not len(sweeps):
        wanted = f"expected a row of lidar_pc for the tagged sweep {cut.window.token}, found none"
        raise InvalidScenario(scenario_id, "scenario_tag", wanted)
    ego = log.ego[sweeps]
    lost = sweeps[~np.isfinite(ego).all(axis=1)]
    if len(lost):
        wanted = f"expected numbers in a row of ego_pose for sweep {log.tokens[lost[0]]}, found none"
        raise InvalidScenario(scenario_id, "ego_pose", wanted)
    row = int(log.scene[sweeps[cut.window.current]])
    scene = log.scenes[row] if row >= 0 else None
    if scene is not None and scene.name is None:
        raise InvalidScenario(scenario_id, "scene", f"expected a row of scene for token {scene.token}, found none")
    return ego, scene


def _date(log: NuPlanLog) -> str:
    """Date of the recording: of the log if in ISO 8601, else of the first sweep in UTC."""
    written = re.match(r"\d{4}-\d{2}-\d{2}", log.place.date or "")
    return written[0] if written else str(log.times[0].astype("datetime64[us]").astype("datetime64[D]"))


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
    num_lost = cut.content.boxes.num_lost + cut.content.lights.num_lost
    return extras | ({"num_lost_rows": num_lost} if num_lost else {})


# --- tracks ---------------------------------------------------------------------------------------------


def _tracks(scenario_id: str, cut: Cut, ego: Float64, timestamps: Float64, origin: Float64) -> Tracks:
    """Build the tracks of the window, followed by the ego."""
    content, steps = cut.content, len(timestamps)
    boxes, step = content.boxes.of(cut.window.sweeps)
    used, row = np.unique(boxes["track"], return_inverse=True)
    words = _categories(scenario_id, content, used)
    _check_boxes(scenario_id, boxes, row * steps + step)
    is_static = np.array([word in STATIC for word in words], np.bool_)
    velocity, is_estimated = _velocity(boxes, row, step, timestamps, is_static)
    own = np.column_stack([ego[:, 2], np.broadcast_to(EGO_SIZE, (steps, 3))])
    state = np.concatenate([boxes["state"][:, :4], own])
    return make_tracks_of_rows(
        [*(content.tracks[track] for track in used), EGO],
        [*(OBJECTS.get(word, ObjectType.OTHER) for word in words), ObjectType.VEHICLE],
        np.pad(np.concatenate([boxes["position"], ego[:, :2]]), ((0, 0), (0, 1))),
        state[:, 0],
        np.concatenate([velocity, ego[:, 3:]]),
        state[:, 1:],
        np.concatenate([row, np.full(steps, len(used))]),
        np.concatenate([step, np.arange(steps)]),
        steps,
        origin=origin,
        source_type=[*words, EGO],
        is_size_assumed=[False] * len(words) + [True],
        is_type_assumed=[word not in OBJECTS for word in words] + [False],
        is_velocity_estimated=[*is_estimated.tolist(), False],
    )


def _categories(scenario_id: str, content: NuPlanContent, used: Int64) -> list[str]:
    """Category of each track; InvalidScenario if a box or its track refers to a missing row."""
    if len(used) and used[0] < 0:
        raise InvalidScenario(scenario_id, "lidar_box", "expected a row of track for every box, found none for one")
    words = []
    for track in used:
        word = content.categories[track]
        if word is None:
            wanted = f"expected a row of category for track {content.tracks[track]}, found none"
            raise InvalidScenario(scenario_id, "track", wanted)
        words.append(word)
    return words


def _check_boxes(scenario_id: str, boxes: Array, cell: Int64) -> None:
    is_whole = np.isfinite(boxes["position"]).all(axis=1) & np.isfinite(boxes["state"][:, :4]).all(axis=1)
    if not is_whole.all():
        wanted = "expected numbers for the position, heading and size of every box"
        raise InvalidScenario(scenario_id, "lidar_box", f"{wanted}, found {(~is_whole).sum()} without")
    taken = np.zeros(cell.max(initial=-1) + 1, np.bool_)
    taken[cell] = True
    if np.count_nonzero(taken) < len(cell):
        raise InvalidScenario(scenario_id, "lidar_box", "expected one box per track and sweep, found two")


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


def _lights(scenario_id: str, cut: Cut, origin: Float64) -> Lights:
    """Build one light per lane connector, with the stop point at its start."""
    rows, step = cut.content.lights.of(cut.window.sweeps)
    if (rows["connector"] < 0).any() or (rows["state"] < 0).any():
        wanted = "expected a lane connector and green, yellow, red or unknown in every row, found something else"
        raise InvalidScenario(scenario_id, "traffic_light_status", wanted)
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
