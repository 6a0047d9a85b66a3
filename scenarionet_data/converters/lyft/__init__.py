"""Lyft Level 5's prediction dataset, in the zarr format of l5kit, without l5kit.

RAW is the dataset's folder, or one of the zarr folders in it:

    scenes/<name>.zarr               scenes of about 25 s at 10 Hz, format version 1 or 2
    semantic_map/semantic_map.pb     the map, there or anywhere in the dataset's folder
    meta.json                        where the recordings' frame lies on the earth, likewise

The older perception dataset, which comes in nuScenes format, is another converter's matter.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from scenarionet_data.building import MapBuilder, make_origin
from scenarionet_data.converters.base import Budgets, Converter, Options, RawItem, Shard, fingerprint
from scenarionet_data.converters.lyft.files import (
    DESCRIPTIONS,
    damaged_item,
    dataset_folder,
    description_files,
    find_map,
    find_recordings,
    scene_items,
    scene_of,
)
from scenarionet_data.converters.lyft.lights import lights
from scenarionet_data.converters.lyft.map_features import City, read_city
from scenarionet_data.converters.lyft.recording import Content, Recording, Scene
from scenarionet_data.converters.lyft.tracks import EGO, tracks
from scenarionet_data.errors import BadParameter, CorruptSource, InvalidScenario
from scenarionet_data.scenario import Float64, ScenarioDescription, Source, make_scenario_id

Box = tuple[float, float, float, float]
"""min_x, min_y, max_x, max_y [m]."""

DT = 0.1
"""Nominal time between frames [s]."""
HISTORY = 10
"""``current_timestep``: after 1 s, as in the Waymo Open Motion Dataset; Lyft names no such step."""
MAP_ID = "semantic-map"
CITY = "Palo Alto"
_BLOCK = 32
"""Scenes of a shard: successive ones, which share chunks; about 700,000 rows of agents."""


@dataclass(frozen=True)
class LyftOptions(Options):
    """How scenes are cut into scenarios, and what of them is kept."""

    window: float = field(default=20.0, metadata={"doc": "Seconds of a scenario; scenes last about 25."})
    stride: float = field(default=0.0, metadata={"doc": "Seconds from one window to the next; 0: as the window."})
    radius: float = field(default=100.0, metadata={"doc": "Metres of map around the box that holds the ego's path."})
    has_map: bool = field(
        default=True, metadata={"doc": "Whether scenarios get a map, from semantic_map.pb and meta.json."}
    )
    maps: str = field(
        default="", metadata={"doc": "Folder of semantic_map.pb and meta.json; empty: below RAW.", "is_place": True}
    )
    keep_unknown: bool = field(
        default=True, metadata={"doc": "Keep objects whose label is unknown, two thirds of all; they are OTHER."}
    )

    def __post_init__(self) -> None:
        if not (self.window >= DT and (self.stride == 0 or self.stride >= DT)):
            found = f"found {self.window} and {self.stride}"
            raise BadParameter(f"window, stride: wanted {DT} s or more (or a stride of 0), {found}")
        if not 0.0 <= self.radius < 1e6:
            raise BadParameter(f"radius: wanted metres of 0 or more, found {self.radius}")


@dataclass(frozen=True, eq=False)
class Window:
    """Frames ``first`` ... ``last - 1`` of the recording, all of one scene: one scenario; with the map, if wanted."""

    recording: Recording
    scene: Scene
    first: int
    last: int
    city: City | None
    options: LyftOptions


class Lyft(Converter[Window]):
    """A shard is a block of scenes of one recording; the semantic map is shared by all."""

    name = "lyft"
    version = "1"
    release = "v1.0"
    licence = "CC BY-NC-SA 4.0"
    raw = "folder with scenes/*.zarr, semantic_map/semantic_map.pb and meta.json, or one of the zarr folders"
    Options = LyftOptions
    facts = ("location", "log", "date", "host")
    listed = (*DESCRIPTIONS, "*.zarr/scenes/*")
    # The recorded scene's two windows: 0.5 and 0.7, 12 and 12 m/s, 1.6 and 2.0 rad, jumps of 79 and 84 m/s.
    budgets = Budgets(velocity_median=1.0, velocity_p99=15.0, heading_p99=2.2, step_speed=100.0)

    def shards(self, raw: str, split: str, version: str, options: LyftOptions) -> Iterator[Shard]:
        """Blocks of scenes, recording by recording, see :meth:`Converter.shards`."""
        root, recordings = dataset_folder(Path(raw)), find_recordings(Path(raw), split)
        maps = find_map(options.maps or str(root)) if options.has_map else []
        map_mark = fingerprint(maps) if maps else ""
        resolved = replace(options, maps=os.pathsep.join(map(str, maps)))  # workers need not search
        for path in recordings:
            name = path.relative_to(root).as_posix()
            stem = re.sub(r"[^A-Za-z0-9._-]", "-", name.removesuffix(".zarr"))
            try:
                items = scene_items(Recording(path), name, map_mark)
            except CorruptSource:  # said again when the shard is read: it fails alone
                items = [damaged_item(path, name)]
            for first in range(0, len(items), _BLOCK):
                block = tuple(items[first : first + _BLOCK])
                shard = f"{stem}-{first // _BLOCK:05d}"
                yield Shard(self.name, version, split, shard, str(root), block, resolved, {"location": CITY})

    def dataset_folder(self, raw: Path) -> Path:
        """The folder above a recording, see :meth:`Converter.dataset_folder`."""
        return dataset_folder(raw)

    def files(self, shard: Shard) -> Iterator[list[str]]:
        """The map, the recordings' scenes, then the chunks of those of the shard, see :meth:`Converter.files`."""
        root, maps = Path(shard.root), filter(None, _options(shard).maps.split(os.pathsep))
        names = {scene_of(item)[0] for item in shard.items}
        described = [Path(path) for path in maps] + [root / file for name in names for file in description_files(name)]
        yield _below(root, described)
        with suppress(CorruptSource):  # said again when the shard is read
            scenes = list(_scenes(shard))
            yield _below(root, [file for recording, scene in scenes for file in recording.frame_files(scene)])
            yield _below(
                root, [file for recording, scene in scenes for file in _content_files(shard, recording, scene)]
            )

    def records(self, shard: Shard) -> Iterator[Window]:
        """The windows of the shard's scenes, see :meth:`Converter.records`."""
        options = _options(shard)
        city = _read_city(find_map(options.maps or shard.root)) if options.has_map else None
        for recording, scene in _scenes(shard):
            yield from _windows(recording, scene, options, city)

    def scenario(self, shard: Shard, record: Window) -> ScenarioDescription:
        """Describe a window, see :meth:`Converter.scenario`."""
        return _describe(shard, record, self.licence)

    def maps(self, raw: str, version: str, options: LyftOptions) -> Iterator[Shard]:
        """The semantic map, see :meth:`Converter.maps`."""
        if options.has_map:
            find_recordings(Path(raw), split="")  # in a folder of something else the map is not what is missing
            root = dataset_folder(Path(raw))
            files = find_map(options.maps or str(root))
            folder = Path(os.path.commonpath(files)) if options.maps else root
            items = (RawItem(path.relative_to(folder).as_posix(), fingerprint([path])) for path in files)
            yield Shard(self.name, version, "", MAP_ID, str(folder), tuple(items), Options())

    def map_features(self, shard: Shard) -> MapBuilder:
        """Read the semantic map, see :meth:`Converter.map_features`."""
        return _read_city(shard.paths).features


def _options(shard: Shard) -> LyftOptions:
    if not isinstance(shard.options, LyftOptions):
        raise BadParameter(f"wanted LyftOptions, found {type(shard.options).__name__}")
    return shard.options


def _scenes(shard: Shard) -> Iterator[tuple[Recording, Scene]]:
    """A shard's scenes, with their recordings."""
    recording = None
    for name, row in map(scene_of, shard.items):
        if recording is None or recording.path != Path(shard.root, name):
            recording = Recording(Path(shard.root, name))
        for scene in recording.scenes if row is None else [recording.scenes[row]]:
            yield recording, scene


def _content_files(shard: Shard, recording: Recording, scene: Scene) -> Iterator[Path]:
    """Files with what surrounds the ego in the windows of a scene; none for one that is going to be refused."""
    for window in _windows(recording, scene, _options(shard), None):
        with suppress(InvalidScenario, CorruptSource):
            yield from recording.content_files(window.first, window.last, scene.name)


def _below(root: Path, paths: list[Path]) -> list[str]:
    """Names of those that lie below a folder."""
    return [path.relative_to(root).as_posix() for path in paths if path.is_relative_to(root)]


def _read_city(files: list[Path]) -> City:
    map_file, meta_file = files
    return read_city(map_file, meta_file, fingerprint(files))


# --- scenarios ------------------------------------------------------------------------------------------


def _windows(recording: Recording, scene: Scene, options: LyftOptions, city: City | None) -> Iterator[Window]:
    """Cut a scene every ``stride`` seconds into ``window`` seconds; a frame counts as 0.1 s.

    The last window ends with the scene and may be shorter; it is left out when nothing would follow its history.
    A scene whose range of frames makes no sense is one window, which is refused when it is described.
    """
    size, step = round(options.window / DT), round((options.stride or options.window) / DT)
    if not 0 <= scene.first < scene.last <= recording.num_frames:
        yield Window(recording, scene, scene.first, scene.last, city, options)
        return
    for first in range(scene.first, scene.last, step):
        last = min(first + size, scene.last)
        if first == scene.first or last - first > HISTORY + 1:
            yield Window(recording, scene, first, last, city, options)
        if last == scene.last:
            return


def _describe(shard: Shard, window: Window, licence: str) -> ScenarioDescription:
    """The scenario of one window.

    It lies in the plane: agents are recorded without heights, and nobody says above what the map's heights are.
    """
    scene, recording, options = window.scene, window.recording, window.options
    where = make_scenario_id(shard.dataset, shard.version, scene.name, f"frame{window.first}")
    content = recording.read(window.first, window.last, where)
    origin = make_origin(content.ego, np.ones(len(content.times), np.bool_), has_z=False)
    objects, num_repaired = tracks(content, recording.labels, origin, where, options.keep_unknown)
    box, city = _map_window(content, options.radius), window.city
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
            file=recording.path.relative_to(shard.root).as_posix(),
            licence=licence,
            log=scene.name,
            city=CITY,
            date=str(content.times[:1].astype("datetime64[ns]").astype("datetime64[s]")[0]),
            crs="lyft world frame",
        ),
        tracks=objects,
        lights=lights(content, city, origin),
        map=city.features.crop(box, city.bounds).build(origin, has_z=False) if city else None,
        map_id=MAP_ID if city else None,
        map_crop=_moved(box, -origin) if city else None,
        extras={
            "host": scene.host,
            "scene_index": scene.index,
            "start_timestamp_ns": int(content.times[0]),
            "num_repaired_velocities": num_repaired,
        },
    )


def _map_window(content: Content, radius: float) -> Box:
    """The box in the world that holds the ego's path, and ``radius`` [m] more on every side."""
    (min_x, min_y), (max_x, max_y) = content.ego[:, :2].min(axis=0), content.ego[:, :2].max(axis=0)
    return float(min_x - radius), float(min_y - radius), float(max_x + radius), float(max_y + radius)


def _moved(box: Box, shift: Float64) -> Box:
    x, y, _ = shift.tolist()
    return box[0] + x, box[1] + y, box[2] + x, box[3] + y
