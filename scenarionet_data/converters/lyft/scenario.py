"""Cut Lyft's scenes into windows and convert them to scenarios."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool
from scenarionet_data.building import bridge_gaps, make_origin
from scenarionet_data.building.plausible import find_bad_rows
from scenarionet_data.converters.lyft.lights import lights
from scenarionet_data.converters.lyft.map_features import LyftCity
from scenarionet_data.converters.lyft.recording import LyftContent, LyftRecording, LyftScene
from scenarionet_data.converters.lyft.tracks import EGO, drop_bad_rows, tracks
from scenarionet_data.errors import BadParameter, InvalidScenario
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.options import Options, option
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.scenario.description import ScenarioDescription, Source, make_scenario_id

DT = 0.1
"""Nominal time between frames [s]."""


@dataclass(frozen=True)
class LyftOptions(Options):
    """Windows, map and objects of scenarios."""

    window: float = option(20.0, "Length of a scenario [s]; scenes last about 25 s.")
    stride: float = option(0.0, "Time between the starts of two windows [s]; 0: the window.")
    radius: float = option(100.0, "Margin of the map around the bounding box of the ego's path [m].")
    has_map: bool = option(True, "Whether scenarios get a map, from semantic_map.pb and meta.json.")
    maps: str = option("", "Folder of semantic_map.pb and meta.json; empty: below RAW.", is_path=True)
    keep_unknown: bool = option(True, "Keep objects whose label is unknown, two thirds of all; they are OTHER.")

    def __post_init__(self) -> None:
        if not (self.window >= DT and (self.stride == 0 or self.stride >= DT)):
            found = f"found {self.window} and {self.stride}"
            raise BadParameter(f"window, stride: expected {DT} s or more (or a stride of 0), {found}")
        if not 0.0 <= self.radius < 1e6:
            raise BadParameter(f"radius: expected 0 m or more, found {self.radius}")


HISTORY = 10
"""``current_timestep``: after 1 s, as in the Waymo Open Motion Dataset; Lyft does not define it."""
MAP_ID = "semantic-map"
CITY = "Palo Alto"


@dataclass(frozen=True, eq=False)
class LyftWindow:
    """Frames ``first`` to ``last - 1`` of one scene of a recording, with the map or None: one scenario."""

    recording: LyftRecording
    scene: LyftScene
    first: int
    last: int
    city: LyftCity | None
    options: LyftOptions


def windows(
    recording: LyftRecording, scene: LyftScene, options: LyftOptions, city: LyftCity | None
) -> Iterator[LyftWindow]:
    """Cut a scene every ``stride`` seconds into ``window`` seconds; a frame counts as 0.1 s.

    The last window ends with the scene and may be shorter; it is dropped if it would end within its history. A scene
    with an invalid range of frames gives one window, which is refused when it is converted.
    """
    size, step = round(options.window / DT), round((options.stride or options.window) / DT)
    if not 0 <= scene.first < scene.last <= recording.num_frames:
        yield LyftWindow(recording, scene, scene.first, scene.last, city, options)
        return
    for first in range(scene.first, scene.last, step):
        last = min(first + size, scene.last)
        if first == scene.first or last - first > HISTORY + 1:
            yield LyftWindow(recording, scene, first, last, city, options)
        if last == scene.last:
            return


def describe(shard: Shard, window: LyftWindow, licence: str) -> ScenarioDescription:
    """Convert one window to a scenario.

    It has no heights: agents are recorded without, and the datum of the map's heights is unknown.
    """
    scene, recording, options = window.scene, window.recording, window.options
    where = make_scenario_id(shard.dataset, shard.version, scene.name, f"frame{window.first}")
    content = recording.read(window.first, window.last, where)
    file, defects = recording.path.relative_to(shard.root).as_posix(), Defects()
    is_known, is_filled = _known_egos(content, where, file, defects)
    has_ego = is_known | is_filled
    content = drop_bad_rows(content, file, defects)
    origin = make_origin(content.ego, has_ego, has_z=False)
    objects, num_repaired = tracks(content, has_ego, is_filled, recording.labels, origin, options.keep_unknown)
    city = window.city
    roads, crop = city.around(content.ego, options.radius, origin) if city else (None, None)
    if roads is not None and not len(roads):
        defects.assume_empty_map(file)
    return ScenarioDescription(
        id=make_scenario_id(shard.dataset, shard.version, scene.name, int(content.times[0])),
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        timestamps=(content.times - content.times[0]) * 1e-9,
        dt=DT,
        current_timestep=min(HISTORY, len(content.times) - 1),
        ego_id=EGO,
        origin=origin,
        has_z=False,
        source=Source(
            scenario_id=scene.name,
            file=file,
            licence=licence,
            log=scene.name,
            city=CITY,
            date=str(content.times[:1].astype("datetime64[ns]").astype("datetime64[s]")[0]),
            crs="lyft world frame",
        ),
        tracks=objects,
        lights=lights(content, city, origin),
        map=roads,
        map_id=MAP_ID if city else None,
        map_crop=crop,
        extras={
            "host": scene.host,
            "scene_index": scene.index,
            "start_timestamp_ns": int(content.times[0]),
            "num_repaired_velocities": num_repaired,
        },
        defects=defects.found(),
    )


def _known_egos(content: LyftContent, where: str, file: str, defects: Defects) -> tuple[Bool, Bool]:
    """(T,) whether the ego's pose is known, and is interpolated; others are a reference for agents only.

    Raises:
        InvalidScenario: No pose can be used.
    """
    finite: Bool = np.logical_and.reduce(np.isfinite(content.ego), axis=1)
    if not finite.any():
        raise InvalidScenario(where, "frames.ego_translation", "expected poses of the ego, found none that is finite")
    position = np.pad(content.ego[:, :2], ((0, 0), (0, 1)))
    middle = np.median(content.ego[finite, :2], axis=0)
    known = np.ones(len(finite), np.bool_)
    for bad in find_bad_rows(position, content.ego[:, 2], None, None, middle):
        rows = content.first + np.flatnonzero(bad.mask)
        defects.drop("tracks", f"{file}/frames", rows.tolist(), f"ego_{bad.field}", bad.reason)
        known &= ~bad.mask
    bridged, filled = bridge_gaps((content.times - content.times[0]) * 1e-9, known, content.ego, angle=2)
    reason = "expected usable poses of the ego, found others, which are interpolated"
    lost = (content.first + np.flatnonzero(filled)).tolist()
    defects.assume("tracks", f"{file}/frames", lost, "ego_translation", reason)
    for column in content.ego.T:
        column[~known] = np.interp(np.flatnonzero(~known), np.flatnonzero(known), column[known])
    content.ego[filled] = bridged[filled]
    return known, filled
