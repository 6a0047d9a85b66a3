"""Lyft Level 5 prediction dataset (the zarr format of l5kit), without l5kit. RAW is the dataset's folder:

    scenes/<name>.zarr                  scenes of about 25 s at 10 Hz, format version 1 or 2
    semantic_map/semantic_map.pb        the map, beside the scenes or anywhere in RAW
    meta.json                           where the recordings' frame lies on the earth

or one of the zarr folders in it. The older perception dataset in nuScenes format is the converter ``nuscenes``' matter.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from scenarionet_data.building import MapBuilder, make_origin
from scenarionet_data.converters.base import Budgets, Converter, Options, RawItem, Shard, fingerprint
from scenarionet_data.converters.lyft_lights import lights
from scenarionet_data.converters.lyft_map import City, read_city
from scenarionet_data.converters.lyft_recording import Content, Recording, Scene
from scenarionet_data.converters.lyft_tracks import EGO, tracks
from scenarionet_data.errors import BadParameter, CorruptSource, SourceNotFound
from scenarionet_data.scenario import Float64, ScenarioDescription, Source, make_scenario_id

DT = 0.1
"""Nominal time between frames [s]."""
HISTORY = 10
"""``current_timestep``: after 1 s, as in the Waymo Open Motion Dataset; Lyft names no such step."""
MAP_ID = "semantic-map"
_BLOCK = 32
"""Scenes of a shard: successive ones, which share chunks; about 700,000 rows of agents."""
_FINGERPRINT_SAMPLE = 4096
_SPLITS = {"train": "train", "train_full": "train", "validate": "val", "validate_full": "val", "test": "test"}
"""The owner's names of recordings that belong to one split."""


@dataclass(frozen=True)
class LyftOptions(Options):
    """How scenes are cut into scenarios, and what of them is kept."""

    window: float = field(default=20.0, metadata={"doc": "Seconds of a scenario; scenes last about 25."})
    stride: float = field(default=0.0, metadata={"doc": "Seconds from one window to the next; 0: as the window."})
    radius: float = field(default=100.0, metadata={"doc": "Metres of map around the box that holds the ego's path."})
    map: str = field(
        default="semantic", metadata={"doc": "semantic, from semantic_map.pb and meta.json; or none: without a map."}
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
        if self.map not in ("semantic", "none"):
            raise BadParameter(f"map: wanted semantic or none, found {self.map!r}")


@dataclass(frozen=True, eq=False)
class Window:
    """Frames ``first`` ... ``last - 1`` of the recording, all of one scene: one scenario."""

    recording: Recording
    scene: Scene
    first: int
    last: int
    city: City | None


class Lyft(Converter[Window]):
    """A shard is a block of scenes of one recording; the semantic map is shared by all."""

    name = "lyft"
    version = "1"
    release = "v1.0"
    licence = "CC BY-NC-SA 4.0"
    raw = "folder with scenes/*.zarr, semantic_map/semantic_map.pb and meta.json, or one of the zarr folders"
    Options = LyftOptions
    budgets = Budgets(velocity_median=0.5, velocity_p99=8.0, heading_p99=1.0)

    def shards(self, raw: str, split: str, version: str, options: LyftOptions) -> Iterator[Shard]:
        """Blocks of scenes, recording by recording, see :meth:`Converter.shards`."""
        root = _root(Path(raw))
        map_mark = "" if options.map == "none" else fingerprint(_map_files(root))
        for path in _recordings(Path(raw), split):
            name = path.relative_to(root).as_posix()
            stem = re.sub(r"[^A-Za-z0-9._-]", "-", name.removesuffix(".zarr"))
            try:
                items = _items(Recording(path), name, map_mark)
            except CorruptSource:  # said again when the shard is read: it fails alone
                damaged = RawItem(name, fingerprint(path.glob("**/.z*")))
                yield Shard(self.name, version, split, stem, str(root), (damaged,), options)
                continue
            for first in range(0, len(items), _BLOCK):
                block = tuple(items[first : first + _BLOCK])
                yield Shard(self.name, version, split, f"{stem}-{first // _BLOCK:05d}", str(root), block, options)

    def records(self, shard: Shard) -> Iterator[Window]:
        """The windows of the shard's scenes, see :meth:`Converter.records`."""
        options = shard.options
        if not isinstance(options, LyftOptions):
            raise BadParameter(f"wanted LyftOptions, found {type(options).__name__}")
        root = Path(shard.root)
        city = None if options.map == "none" else _city(root)
        opened: dict[str, Recording] = {}
        for item in shard.items:
            name, _, number = item.name.partition(".zarr:")
            path = root / (f"{name}.zarr" if number else item.name)
            if name not in opened:
                opened[name] = Recording(path)
            recording = opened[name]
            for scene in [recording.scenes[int(number)]] if number else recording.scenes:
                yield from _windows(recording, scene, options, city)

    def scenario(self, shard: Shard, record: Window) -> ScenarioDescription:
        """Describe a window, see :meth:`Converter.scenario`."""
        return _describe(shard, record, self.licence)

    def maps(self, raw: str, version: str, options: LyftOptions) -> Iterator[Shard]:
        """The semantic map, see :meth:`Converter.maps`."""
        if options.map == "none":
            return
        root = _root(Path(raw))
        items = (RawItem(path.relative_to(root).as_posix(), fingerprint([path])) for path in _map_files(root))
        yield Shard(self.name, version, "", MAP_ID, str(root), tuple(items), Options())

    def map_features(self, shard: Shard) -> MapBuilder:
        """Read the semantic map, see :meth:`Converter.map_features`."""
        map_file, meta_file = shard.paths
        return read_city(map_file, meta_file, fingerprint(shard.paths)).features


# --- what lies in RAW -----------------------------------------------------------------------------------


def _root(raw: Path) -> Path:
    """The dataset's folder: RAW, or the one in which the zarr folder RAW lies."""
    if raw.suffix != ".zarr":
        return raw
    return raw.parent.parent if raw.parent.name == "scenes" else raw.parent


def _recordings(raw: Path, split: str) -> list[Path]:
    """The zarr folders of RAW, without those whose name is that of another split.

    Raises:
        SourceNotFound: There are none.
    """
    found = [raw] if raw.suffix == ".zarr" and raw.is_dir() else _find(raw, ".zarr")
    others = set(_SPLITS.values()) - {split} if split in _SPLITS.values() else set()
    wanted = [path for path in found if path == raw or _SPLITS.get(path.stem) not in others]
    if not wanted:
        hint = f"; of another split are {', '.join(path.name for path in found)}" if found else ""
        raise SourceNotFound(f"{raw}: no recordings (*.zarr) of split {split} in it{hint}")
    return wanted


def _find(folder: Path, ending: str) -> list[Path]:
    """Folders and files below whose name ends so, sorted; what is inside recordings is not looked at."""
    found = []
    for place, folders, files in os.walk(folder):
        found += [Path(place, name) for name in (*folders, *files) if name.endswith(ending)]
        folders[:] = sorted(name for name in folders if not name.endswith(".zarr"))
    return sorted(found)


def _map_files(root: Path) -> list[Path]:
    """``semantic_map.pb`` and ``meta.json``.

    Raises:
        SourceNotFound: One of them is not there, or there are several.
    """
    chosen = []
    for name in ("semantic_map.pb", "meta.json"):
        found = [path for path in _find(root, name) if path.name == name]
        if len(found) != 1:
            count = f"found {len(found)}: {', '.join(map(str, found))}" if found else "found none"
            hint = "download the dataset's semantic map, or go without it: -O map=none"
            raise SourceNotFound(f"{root}: wanted one {name} in it, {count}; {hint}")
        chosen += found
    return chosen


def _city(root: Path) -> City:
    map_file, meta_file = _map_files(root)
    return read_city(map_file, meta_file, fingerprint([map_file, meta_file]))


def _items(recording: Recording, name: str, map_mark: str) -> list[RawItem]:
    """The scenes of a recording, told apart by their row and the files with their frames, and by the map."""
    marks: dict[Path, str] = {}
    items = []
    for scene in recording.scenes:
        parts = [repr(scene), map_mark]
        for file in recording.frame_files(scene):
            if file not in marks:
                marks[file] = fingerprint([file], _FINGERPRINT_SAMPLE) if file.is_file() else ""
            parts.append(marks[file])
        mark = hashlib.blake2b("\n".join(parts).encode(), digest_size=8).hexdigest()
        items.append(RawItem(f"{name}:{scene.index}", mark))
    return items


# --- scenarios ------------------------------------------------------------------------------------------


def _windows(recording: Recording, scene: Scene, options: LyftOptions, city: City | None) -> Iterator[Window]:
    """Cut a scene every ``stride`` seconds into ``window`` seconds; a frame counts as 0.1 s.

    The last window ends with the scene and may be shorter; it is left out when nothing would follow its history.
    A scene whose range of frames makes no sense is one window, which is refused when it is described.
    """
    size, step = round(options.window / DT), round((options.stride or options.window) / DT)
    if not 0 <= scene.first < scene.last <= recording.num_frames:
        yield Window(recording, scene, scene.first, scene.last, city)
        return
    for first in range(scene.first, scene.last, step):
        last = min(first + size, scene.last)
        if first == scene.first or last - first > HISTORY + 1:
            yield Window(recording, scene, first, last, city)
        if last == scene.last:
            return


def _describe(shard: Shard, window: Window, licence: str) -> ScenarioDescription:
    """The scenario of one window.

    It lies in the plane: agents are recorded without heights, and nobody says above what the map's heights are.
    """
    scene, recording, options = window.scene, window.recording, shard.options
    where = make_scenario_id(shard.dataset, shard.version, scene.name, f"frame{window.first}")
    content = recording.read(window.first, window.last, where)
    origin = make_origin(content.ego, content.ego[:, 0] == content.ego[:, 0], has_z=False)
    objects, num_repaired = tracks(content, recording.labels, origin, where, options.keep_unknown)
    crop = _crop(content, window.city, options.radius, origin)
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
            city="Palo Alto",
            crs="lyft world frame",
        ),
        tracks=objects,
        lights=lights(content, window.city, origin),
        extras={
            "host": scene.host,
            "scene_index": scene.index,
            "start_timestamp_ns": int(content.times[0]),
            "num_repaired_velocities": num_repaired,
        },
        **crop,
    )


def _crop(content: Content, city: City | None, radius: float, origin: Float64) -> dict[str, object]:
    """The map and its window, as the fields of a scenario."""
    if city is None:
        return {"map": None}
    low, high = content.ego[:, :2].min(axis=0) - radius, content.ego[:, :2].max(axis=0) + radius
    window = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    x, y = origin[:2].tolist()
    return {
        "map": city.features.crop(window, city.bounds).build(origin, has_z=False),
        "map_id": MAP_ID,
        "map_crop": (window[0] - x, window[1] - y, window[2] - x, window[3] - y),
    }
