"""Convert an Argoverse 1 recording to a scenario: motion is estimated, sizes and types are assumed, and flagged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.building import make_origin, make_tracks
from scenarionet_data.building.motion import DT, Motion, estimate_motion, step_of
from scenarionet_data.converters.argoverse1.map_features import Argoverse1City
from scenarionet_data.converters.argoverse1.recording import Argoverse1Recording
from scenarionet_data.converters.argoverse1.table import EGO, FOCAL, NUM_OBSERVED
from scenarionet_data.errors import BadParameter
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.options import Frames, Options, option
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import Lights, MapFeatures, ScenarioDescription, Source, Tracks
from scenarionet_data.scenario.vocabulary import ObjectType


@dataclass(frozen=True)
class Argoverse1Options(Options):
    """Timesteps, location of the maps, and the extent of a scenario's map."""

    frames: Frames = option(
        "recorded", "recorded: the 50 or 20 recorded times; resampled: every 0.1 s, interpolated.", is_added=True
    )

    maps: str = option("", "Folder of the *_vector_map.xml; empty: below RAW.", is_path=True)
    has_map: bool = option(True, "Whether scenarios get a map.")
    radius: float = option(100.0, "Margin of the map around the bounding box of the ego's path [m].")

    def __post_init__(self) -> None:
        if not 0.0 <= self.radius < 1e5:
            raise BadParameter(f"radius: expected 0 m or more, found {self.radius}")


_EGO_SIZE = (4.877, 2.0, 1.473)
"""Length, width, height [m] of the recording vehicle, a Ford Fusion; from Argoverse 2."""
_CAR_SIZE = (4.0, 2.0, 1.6)
_NEAR_LANE = 8.0
"""Maximum distance from a centreline for a static object to be aligned with the lane [m]: one parking lane more."""


def describe(
    shard: Shard,
    scenario_id: str,
    file: str,
    recording: Argoverse1Recording,
    city: Argoverse1City | None,
    options: Argoverse1Options,
    licence: str,
    defects: Defects,
) -> ScenarioDescription:
    """Convert a recording to a scenario.

    Args:
        shard: Its shard.
        scenario_id: Its id.
        file: Its raw file, relative to the raw folder.
        recording: The content of the file.
        city: The map; None for no map.
        options: Timesteps, and the margin of the map.
        licence: Licence of the dataset.
        defects: What was dropped or assumed.
    """
    times, frames = recording.times, options.frames
    motion = estimate_motion(
        recording.track, recording.frame, recording.position, times, frames, recording.is_interpolated
    )
    ego, targets = recording.ego, [recording.ids[row] for row in recording.targets]
    position = np.concatenate([motion.position, np.zeros((*motion.valid.shape, 1))], axis=-1)
    origin = make_origin(position[ego], motion.valid[ego], has_z=False)
    crop = roads = None
    if city is not None:  # the box around the ego's path with a margin, in the scenario's frame
        path = motion.position[ego, motion.valid[ego]] - origin[:2]
        min_x, min_y = (path.min(axis=0) - options.radius).tolist()
        max_x, max_y = (path.max(axis=0) + options.radius).tolist()
        crop, (x, y) = (min_x, min_y, max_x, max_y), origin[:2]
        roads = city.crop((min_x + x, min_y + y, max_x + x, max_y + y), origin)
        if not len(roads):
            defects.assume_empty_map(file)
    return ScenarioDescription(
        id=scenario_id,
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        timestamps=motion.timestamps,
        dt=DT,
        current_timestep=NUM_OBSERVED - 1 if frames == "recorded" else step_of(times[NUM_OBSERVED - 1]),
        ego_id=recording.ids[ego],
        origin=origin,
        has_z=False,
        source=Source(
            scenario_id=file.rpartition("/")[2].removesuffix(".csv"),
            file=file,
            licence=licence,
            city=recording.city,
            crs=f"argoverse1 city frame {recording.city}",
        ),
        tracks=_tracks(recording, motion, position, origin, roads),
        lights=Lights.empty(len(motion.timestamps)),
        map=roads,
        map_id=None if city is None else city.map_id,
        map_crop=crop,
        objects_of_interest=tuple(targets),
        tracks_to_predict=tuple((target, 0) for target in targets),
        extras={
            "start_timestamp": recording.start,
            "num_recorded_times": len(times),
            "longest_step": float(np.diff(times).max()),
        },
        defects=defects.found(),
    )


def _tracks(
    recording: Argoverse1Recording, motion: Motion, position: Float64, origin: Float64, roads: MapFeatures | None
) -> Tracks:
    is_ego = np.array([word == EGO for word in recording.types])
    lane_heading, is_near = _lane_headings(motion, origin, roads)
    from_lane = is_near & ~motion.has_course
    heading = np.where(from_lane[:, None], lane_heading[:, None], motion.course)
    sources = np.where(motion.has_course, "", np.where(from_lane, "lane", "nothing"))
    return make_tracks(
        recording.ids,
        np.full(len(is_ego), ObjectType.VEHICLE),
        position,
        heading,
        motion.velocity,
        np.where(is_ego[:, None], _EGO_SIZE, _CAR_SIZE),
        motion.valid,
        origin=origin,
        source_type=recording.types,
        is_size_assumed=True,
        is_type_assumed=[word not in (EGO, FOCAL) for word in recording.types],
        is_velocity_estimated=True,
        is_interpolated=motion.is_interpolated,
        extras=[{"heading_from": word} if word else None for word in sources.tolist()],
    )


def _lane_headings(motion: Motion, origin: Float64, roads: MapFeatures | None) -> tuple[Float64, Bool]:
    """Direction of the nearest lane for tracks that never move, and whether one is within reach: both (N,)."""
    heading, is_near = np.zeros(len(motion.valid)), np.zeros(len(motion.valid), np.bool_)
    standing = np.flatnonzero(~motion.has_course)
    if roads is None or not len(roads) or not len(standing):
        return heading, is_near
    valid = motion.valid[standing, :, None]
    mean = (motion.position[standing] * valid).sum(axis=1) / valid.sum(axis=1)
    places = mean - origin[:2]
    inner = np.ones(len(roads.polyline.values) - 1, np.bool_)
    inner[roads.polyline.offsets[1:-1] - 1] = False
    # One coordinate after the other: sums over a last axis of length 2 are slow.
    x, y = roads.polyline.values[:, :2].T.copy()
    step_x, step_y = np.diff(x)[inner], np.diff(y)[inner]
    away_x, away_y = places.T[..., None].astype(np.float32) - np.stack([x[:-1][inner], y[:-1][inner]])[:, None]
    squared = np.maximum(step_x * step_x + step_y * step_y, 1e-9)
    share = np.clip((away_x * step_x + away_y * step_y) / squared, 0.0, 1.0)
    distance = np.hypot(away_x - share * step_x, away_y - share * step_y)
    nearest = distance.argmin(axis=1)
    heading[standing] = np.arctan2(step_y[nearest], step_x[nearest])
    is_near[standing] = distance.min(axis=1).astype(np.float64) < _NEAR_LANE
    return heading, is_near
