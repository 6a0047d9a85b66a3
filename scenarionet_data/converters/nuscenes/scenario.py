"""Convert a window of a nuScenes scene to a scenario: interpolated tracks, the ego, the crop of the map.

Heights are relative to the plane of the ego poses, which have z = 0 like the map. Velocities are not recorded, but
estimated from positions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.arrays.geometry import estimate_velocity
from scenarionet_data.building import make_origin, make_tracks
from scenarionet_data.converters.cities import CityMap
from scenarionet_data.converters.nuscenes.can_bus import CanBusMessages, signals_at
from scenarionet_data.converters.nuscenes.files import CHALLENGE, map_id
from scenarionet_data.converters.nuscenes.keyframes import Steps, boxes_at, make_steps, nominal_period, poses_at
from scenarionet_data.converters.nuscenes.tables import log_name
from scenarionet_data.converters.nuscenes.types import (
    CATEGORIES,
    EGO,
    EGO_CATEGORY,
    FORD_FUSION,
    PLACES,
    RENAULT_ZOE,
)
from scenarionet_data.converters.nuscenes.windows import NuScenesWindow
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.defects import Defect, Defects, merge_defects
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import (
    Lights,
    MapFeatures,
    ScenarioDescription,
    Source,
    Tracks,
)
from scenarionet_data.scenario.vocabulary import ObjectType


def describe(
    shard: Shard,
    window: NuScenesWindow,
    city: CityMap | None,
    can_bus: Mapping[str, CanBusMessages],
    *,
    rate: int | None,
    radius: float,
    licence: str,
    defects: Iterable[Defect] = (),
) -> ScenarioDescription:
    """Convert one window to a scenario.

    Args:
        shard: Its shard.
        window: Keyframes of a scene.
        city: The location's map, or None.
        can_bus: CAN bus messages of the ego.
        rate: Timesteps per second; None: the keyframes.
        radius: Margin of the map around the ego's path [m].
        licence: Licence of the recordings.
        defects: What was dropped or assumed beside the window's.
    """
    recording, part = window.recording, slice(window.first, window.last + 1)
    name, place = recording.name, recording.log["location"]
    start = float(recording.times[window.first])
    steps = make_steps(recording.times[part] - start, nominal_period(recording.times), rate)
    ego, has_pose, is_between = _ego(window, steps, place)
    if not has_pose.any():
        raise InvalidScenario(window.id(shard), "ego_pose", "expected ego poses during the window, found none")
    origin = make_origin(ego[:, :3], has_pose, has_z=True)
    current = int(steps.at_keyframes[window.current - window.first])
    known = [token for token in window.targets if token in recording.objects.tokens]
    roads, crop = city.around(ego, radius, origin, has_z=True) if city else (None, None)
    return ScenarioDescription(
        id=window.id(shard),
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        timestamps=steps.times * 1e-6,
        dt=steps.dt,
        current_timestep=current,
        ego_id=EGO,
        origin=origin,
        has_z=True,
        source=Source(
            scenario_id=name,
            file=shard.items[0].name.split("/")[0] + "/scene.json",
            licence=licence,
            log=log_name(recording.log),
            city=place,
            date=recording.log["date_captured"],
            crs=f"nuscenes {place or 'unknown'}",
        ),
        tracks=_tracks(window, steps, (ego, has_pose, is_between), origin, signals_at(can_bus, start + steps.times)),
        lights=Lights.empty(len(steps.times)),
        map=roads,
        map_id=map_id(place) if city and place else None,
        map_crop=crop,
        tracks_to_predict=tuple((token, 0) for token in known),
        extras={
            "kind": "scene" if window.is_whole else "window",
            "scene_token": recording.scene["token"],
            "description": recording.scene["description"],
            "sample_tokens": recording.samples[part].tolist(),
            "keyframe_timesteps": steps.at_keyframes.tolist(),
            "start_timestamp_us": round(start),
        },
        defects=merge_defects([*recording.defects, *defects, *_findings(window, shard.items[0].name, roads)]),
        num_recorded_rows=recording.num_rows,
    )


def _ego(window: NuScenesWindow, steps: Steps, place: str | None) -> tuple[Float64, Bool, Bool]:
    """The ego's box (T, 7), whether its pose is known (T,), and whether it is between recorded ones (T,)."""
    vehicle = RENAULT_ZOE if place is None or place in PLACES else FORD_FUSION
    recording = window.recording
    pose_times = recording.pose_times - recording.times[window.first]
    pose, has_pose, is_between = poses_at(steps.times, pose_times, recording.poses)
    ahead = vehicle.ahead * np.stack([np.cos(pose[:, 3]), np.sin(pose[:, 3])], axis=-1)
    size = np.broadcast_to(np.array(vehicle.size), (len(pose), 3))
    center = np.column_stack([pose[:, :2] + ahead, pose[:, 2] + vehicle.size[2] / 2.0])
    return np.column_stack([center, pose[:, 3], size]), has_pose, is_between


def _tracks(
    window: NuScenesWindow,
    steps: Steps,
    path: tuple[Float64, Bool, Bool],
    origin: Float64,
    signals: Mapping[str, list[Any]],
) -> Tracks:
    """Build the objects annotated in the window, followed by the ego with its ``path`` as of :func:`_ego`."""
    ego, has_pose, is_between = path
    part, objects = slice(window.first, window.last + 1), window.recording.objects
    rows = np.flatnonzero(objects.seen[:, part].any(axis=1))
    boxes, valid = boxes_at(steps, objects.boxes[rows, part], objects.seen[rows, part])
    boxes, valid = np.concatenate([boxes, ego[None]]), np.concatenate([valid, has_pose[None]])
    words: list[str | None] = [*objects.categories[rows], EGO_CATEGORY]
    kinds = [*(CATEGORIES.get(word or "", ObjectType.OTHER) for word in words[:-1]), ObjectType.VEHICLE]
    attributes = [objects.attributes[row] for row in rows]
    return make_tracks(
        [*objects.tokens[rows], EGO],
        kinds,
        boxes[..., :3],
        boxes[..., 3],
        estimate_velocity(boxes[..., :2], valid, steps.times * 1e-6),
        boxes[..., 4:],
        valid,
        origin=origin,
        source_type=words,
        is_size_assumed=[*[False] * len(rows), True],
        is_type_assumed=[*(word not in CATEGORIES for word in words[:-1]), False],
        is_velocity_estimated=True,
        is_interpolated=np.concatenate(
            [np.broadcast_to(steps.share > 0, (len(rows), len(steps.share))), is_between[None]]
        ),
        extras=[
            *({"attributes": counts} if counts else None for counts in attributes),
            {"can_bus": signals} if signals else None,
        ],
    )


def _findings(window: NuScenesWindow, file: str, roads: MapFeatures | None) -> tuple[Defect, ...]:
    """Report an empty map, and the objects to predict that are not annotated in the scene."""
    defects = Defects()
    if roads is not None and not len(roads):
        defects.assume_empty_map(file)
    unknown = [token for token in window.targets if token not in window.recording.objects.tokens]
    reason = "expected objects of the scene, found another; it is not among the tracks to predict"
    defects.assume("tracks", CHALLENGE.as_posix(), unknown, window.recording.name, reason)
    return defects.found()
