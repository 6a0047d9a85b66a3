"""nuScenes (https://www.nuscenes.org), without nuscenes-devkit: scenes, and windows of the prediction challenge.

RAW is the dataroot, or one release's folder in it:

    v1.0-trainval/ (or v1.0-mini/, v1.0-test/)   the 13 tables, *.json
    maps/expansion/<location>.json               map expansion v1.3, one file per location
    maps/prediction/prediction_scenes.json       the challenge's predictions; part of the map expansion
    can_bus/<scene>_<message>.json               the CAN bus expansion, optional

Lyft's perception dataset has the same tables (``train_data/`` or ``v1.02-train/``) and is read as well, without a map,
as its location has no map expansion; give it a ``version`` of its own. Scenes of nuScenes' four locations require their
map unless ``has_map`` is False.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, ClassVar, get_args

from scenarionet_data.building import MapBuilder
from scenarionet_data.converters.base import Budgets, Converter, counted, unused_files
from scenarionet_data.converters.cities import CityMap
from scenarionet_data.converters.nuscenes.can_bus import can_bus_files, can_bus_mark, read_can_bus
from scenarionet_data.converters.nuscenes.files import (
    CHALLENGE,
    EXPANSION,
    SENSORS,
    dataroot,
    find_release,
    map_file,
    map_id,
)
from scenarionet_data.converters.nuscenes.keyframes import nominal_period
from scenarionet_data.converters.nuscenes.map_features import read_map
from scenarionet_data.converters.nuscenes.recording import NuScenesRecording, read_recording
from scenarionet_data.converters.nuscenes.scenario import describe
from scenarionet_data.converters.nuscenes.tables import TABLES, log_name, read_release, read_scenes, table_files
from scenarionet_data.converters.nuscenes.types import PLACES, is_in_split
from scenarionet_data.converters.nuscenes.windows import (
    NuScenesWindow,
    challenge_windows,
    moving_windows,
    read_challenge,
    whole,
)
from scenarionet_data.errors import BadParameter, InvalidScenario, SourceNotFound
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.listing import cached_by_file
from scenarionet_data.ingest.options import Frames, Options, option
from scenarionet_data.ingest.passed_over import PassedOver
from scenarionet_data.ingest.shard import RawItem, Shard, bucket, fingerprint
from scenarionet_data.scenario.description import ScenarioDescription, make_scenario_id

_GET_MAPS = "download nuScenes' map expansion v1.3, or set the option has_map to false"
_SCENES_PER_SHARD = {"scene": 64, "window": 8}
_RATE = 10
"""Resampled timesteps per second, as in ScenarioNet."""
_SUFFIX = {"scene": "", "window": "@window"}
"""Suffix of items, so that one lake can contain both scenes and windows of a split."""


@dataclass(frozen=True)
class NuScenesOptions(Options):
    """Scenes or windows, their timesteps, and the extent of their map."""

    by: str = option("scene", "scene: 20 s each; window: for the prediction challenge, see past and future.")
    past: float = option(2.0, "Time before the current timestep of a window or scene [s].")
    future: float = option(6.0, "Time after the current timestep of a window [s].")
    frames: Frames = option(
        "resampled", "resampled: 10 timesteps per second, interpolated; recorded: the annotated keyframes, 2 or 5."
    )
    radius: float = option(200.0, "Margin of the map around the ego's path [m]; features are not cut.")
    has_map: bool = option(True, "Whether scenarios get a map.")
    has_can_bus: bool = option(
        True, "Whether the ego's extras contain speed, steering, ... from can_bus/, if available."
    )

    removed: ClassVar[Mapping[str, str]] = MappingProxyType(
        {"rate": "set frames to 'recorded' for the keyframes, or resample when loading"}
    )

    def __post_init__(self) -> None:
        if self.frames not in get_args(Frames):
            raise BadParameter(f"frames: expected recorded or resampled, found {self.frames!r}")
        if self.by not in ("scene", "window"):
            raise BadParameter(f"by: expected scene or window, found {self.by!r}")
        if not (0 <= self.past < 1000 and 0 <= self.future < 1000):
            raise BadParameter(f"past, future: expected seconds, found {self.past} and {self.future}")
        if not 0 <= self.radius < 1e5:
            raise BadParameter(f"radius: expected metres, found {self.radius}")


class NuScenes(Converter[NuScenesWindow | InvalidScenario]):
    """Scenes in shards of one location; the maps of locations are shared."""

    name = "nuscenes"
    version = "2"
    release = "v1.0"
    licence = "CC BY-NC-SA 4.0"
    raw = "the dataroot: v1.0-*/*.json and maps/expansion/*.json"
    Options = NuScenesOptions
    properties = ("location", "log", "date")
    listed = ("scene.json", "log.json")
    ignored = SENSORS
    budgets = Budgets(velocity_median=0.1, velocity_p99=3.0, heading_p99=1.0)

    def maps(self, raw: str, version: str, options: NuScenesOptions) -> Iterator[Shard]:
        """List the maps of the locations."""
        root = dataroot(Path(raw))
        for path in sorted((root / EXPANSION).glob("*.json")) if options.has_map else ():
            item = RawItem(path.relative_to(root).as_posix(), fingerprint([path]))
            # Independent of the options: scenes and windows in one lake share the map.
            yield Shard(self.name, version, "", map_id(path.stem), str(root), (item,), Options())

    def map_features(self, shard: Shard) -> MapBuilder:
        """Read the map of one location."""
        return read_map(shard.paths[0], shard.items[0].name)

    def shards(self, raw: str, split: str, version: str, options: NuScenesOptions) -> Iterator[Shard]:
        """List the split's scenes in buckets of one location."""
        root, folder = dataroot(Path(raw)), find_release(Path(raw), split)
        scenes = _scenes_by_place(folder, split, options)
        maps = {place: map_file(root, place) for place in scenes if options.has_map}
        if set(PLACES) & set(maps) and not any(path.is_file() for path in maps.values()):
            raise SourceNotFound(f"{root / EXPANSION}: no maps; {_GET_MAPS}")
        files = [*table_files(folder), *([root / CHALLENGE] if options.by == "window" else [])]
        for place, names in scenes.items():
            read = [*files, *([maps[place]] if options.has_map else [])]
            mark = fingerprint(path for path in read if path.is_file())
            items = []
            for name, log in names.items():
                can_bus_digest = can_bus_mark(root, name) if options.has_can_bus else ""
                told = {"log": log_name(log), "date": log["date_captured"]} if "token" in log else {}
                items.append(
                    RawItem(
                        f"{folder.name}/{name}{_SUFFIX[options.by]}",
                        mark + can_bus_digest,
                        {key: value for key, value in told.items() if value},
                    )
                )
            for number, members in bucket(items, _SCENES_PER_SHARD[options.by]).items():
                shard = f"{folder.name}-{map_id(place)}-{options.by}-{number}"
                yield Shard(self.name, version, split, shard, str(root), members, options, {"location": place})

    def dataset_folder(self, raw: Path) -> Path:
        """The dataroot."""
        return dataroot(raw)

    def passed_over(
        self, raw: str, split: str, options: NuScenesOptions, shards: Sequence[Shard]
    ) -> Iterator[PassedOver]:
        """List the scenes that are not converted, maps without scenes, and the files that are not read."""
        root, folder = dataroot(Path(raw)), find_release(Path(raw), split)
        scenes, _, num_unnamed = read_scenes(folder)
        names = {_scene_of(item, options) for shard in shards for item in shard.items}
        yield from counted("scenes", len(scenes) - len(names), f"of another split than {split}")
        yield from counted(f"entries of {folder.name}/scene.json", num_unnamed, "without a token and name of their own")
        places = {str(shard.properties["location"]) for shard in shards}
        maps = {path for path in (root / EXPANSION).glob("*.json") if path.stem not in places}
        reason = "no scene of the split was recorded there" if options.has_map else "the option has_map is false"
        yield from counted(f"maps in {EXPANSION.as_posix()}", len(maps), reason)
        used = {*(folder / f"{table}.json" for table in TABLES), *maps}
        used |= {map_file(root, place) for place in places} if options.has_map else set()
        used |= {root / file for name in names for file in can_bus_files(name)} if options.has_can_bus else set()
        used |= {root / CHALLENGE} if options.by == "window" else set()
        yield from unused_files(root, used.__contains__, split, self.ignored)

    def files(self, shard: Shard) -> Iterator[list[str]]:
        """The tables, the location's map and the CAN bus messages."""
        options, release = shard.options_as(NuScenesOptions), shard.items[0].name.split("/")[0]
        names = [f"{release}/{table}.json" for table in TABLES]
        if options.by == "window":
            names.append(CHALLENGE.as_posix())
        if options.has_map:
            names.append(map_file(Path(), str(shard.properties["location"])).as_posix())
        if options.has_can_bus:
            names += [name for item in shard.items for name in can_bus_files(_scene_of(item, options))]
        yield names

    def records(self, shard: Shard) -> Iterator[NuScenesWindow | InvalidScenario]:
        """Yield the windows of each scene, or the reason why it has none."""
        options, root = shard.options_as(NuScenesOptions), Path(shard.root)
        folder = root / shard.items[0].name.split("/")[0]
        release = read_release(folder)
        tokens = {scene["name"]: token for token, scene in release.scenes.items()}
        has_challenge = options.by == "window" and (root / CHALLENGE).is_file()
        challenge = read_challenge(root / CHALLENGE) if has_challenge else None
        for item in shard.items:
            name = _scene_of(item, options)
            scenario_id = make_scenario_id(shard.dataset, shard.version, name)
            try:
                recording = read_recording(release, tokens[name], scenario_id, folder.name)
                entries = None if challenge is None else challenge.get(name, ())
                yield from _windows(recording, options, entries, scenario_id)
            except InvalidScenario as error:  # continue with the other scenes of the shard
                yield error

    def scenario(self, shard: Shard, record: NuScenesWindow | InvalidScenario) -> ScenarioDescription:
        """Convert one window."""
        if isinstance(record, InvalidScenario):
            raise record
        options = shard.options_as(NuScenesOptions)
        city = self._city(shard, record) if options.has_map else None
        defects = Defects()
        messages = read_can_bus(Path(shard.root), record.recording.name, defects) if options.has_can_bus else {}
        return describe(
            shard,
            record,
            city,
            messages,
            rate=_RATE if options.frames == "resampled" else None,
            radius=options.radius,
            licence=self.licence,
            defects=defects.found(),
        )

    def _city(self, shard: Shard, window: NuScenesWindow) -> CityMap | None:
        """The map of a window's location; None for a location outside nuScenes without a map."""
        place = window.recording.log["location"]
        if place is None:
            return None
        path = map_file(Path(shard.root), place)
        if path.is_file():
            return _read_city(path)
        if place in PLACES:
            scenario_id = make_scenario_id(shard.dataset, shard.version, window.recording.name)
            raise InvalidScenario(
                scenario_id, "map", f"expected {path.name} in maps/expansion, found none; {_GET_MAPS}"
            )
        return None


def _scene_of(item: RawItem, options: NuScenesOptions) -> str:
    """Name of an item's scene."""
    return item.name.split("/")[1].removesuffix(_SUFFIX[options.by])


@cached_by_file(2)
def _read_city(path: Path) -> CityMap:
    """Read a location's map; the last two are cached, as a worker's scenes are sorted by location."""
    return CityMap(read_map(path, (EXPANSION / path.name).as_posix()))


def _windows(
    recording: NuScenesRecording, options: NuScenesOptions, entries: Any, scenario_id: str
) -> Iterator[NuScenesWindow | InvalidScenario]:
    period = nominal_period(recording.times)
    past, future = round(options.past / period), round(options.future / period)
    if options.by == "scene":
        yield whole(recording, past)
    elif entries is None:
        yield from _reported_once(moving_windows(recording, past, future))
    elif isinstance(entries, (list, tuple)):
        yield from _reported_once(challenge_windows(recording, past, future, entries, scenario_id))
    else:
        yield InvalidScenario(scenario_id, "prediction_scenes", "expected a list of <instance>_<sample>, found another")


def _reported_once(
    windows: Iterable[NuScenesWindow | InvalidScenario],
) -> Iterator[NuScenesWindow | InvalidScenario]:
    """Yield windows of a scene, the first with the scene's defects, so that each is counted once."""
    has_first = False
    for window in windows:
        if has_first and isinstance(window, NuScenesWindow):
            yield replace(window, recording=replace(window.recording, defects=()))
        else:
            has_first = has_first or isinstance(window, NuScenesWindow)
            yield window


def _scenes_by_place(folder: Path, split: str, options: NuScenesOptions) -> dict[str, dict[str, dict[str, Any]]]:
    """Names of the scenes of each location, with the records of their logs."""
    scenes, logs, _ = read_scenes(folder)
    found: dict[str, dict[str, dict[str, Any]]] = defaultdict(dict)
    for scene in scenes.values():
        if is_in_split(scene["name"], split, is_challenge=options.by == "window"):
            log = logs.get(scene["log_token"], {})
            found[log.get("location") or "unknown"][scene["name"]] = log
    if not found:
        raise SourceNotFound(f"{folder}: none of its scenes belongs to split {split!r}; give another split")
    return {place: found[place] for place in sorted(found)}
