"""ScenarioNet's and MetaDrive's pickles of every version, one scenario per file.

RAW is a database (a folder with ``dataset_mapping.pkl``, which may refer to other folders), a folder of pickles with or
without summary, or a folder of such folders. Format: ``metadrive/scenario/scenario_description.py`` of
MetaDrive 0.4.3 and the converters of ScenarioNet (2025-03), whose output deviates from it:

* nuScenes: sizes (T, 1), ``valid`` float, the ego's length and width exchanged, headings as the third coordinate
  of lanes, 100 km/h on connectors without a limit in the source, velocities by finite differences;
* Waymo: links as int while ids are str, values at invalid states, headings that are not wrapped;
* Argoverse 2: one assumed size per type, 85 mph everywhere, widths of 0;
* MetaDrive's own: cones without size, extra states (steering, ...), 1000 km/h for no limit;
* nuPlan: coordinates relative to the ego's first position, which is lost; 2D stop points.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.converters.base import Converter, find_files
from scenarionet_data.converters.scenarionet.frame import Frame, find_frame
from scenarionet_data.converters.scenarionet.lights import make_lights
from scenarionet_data.converters.scenarionet.map_features import make_map
from scenarionet_data.converters.scenarionet.summary import SUMMARISED, properties_of
from scenarionet_data.converters.scenarionet.tracks import (
    States,
    count_unstored_states,
    make_pickled_tracks,
    read_states,
    restore_ego_size,
)
from scenarionet_data.converters.scenarionet.unpickling import load
from scenarionet_data.errors import CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.ingest.options import Options
from scenarionet_data.ingest.shard import ABSENT, RawItem, Shard, bucket, fingerprint
from scenarionet_data.scenario.description import ScenarioDescription, Source, make_scenario_id

_DT = 0.1
_MAPPING = "dataset_mapping.pkl"
_LICENCES = {
    "waymo": "Waymo Dataset License Agreement for Non-Commercial Use",
    "nuscenes": "CC BY-NC-SA 4.0",
    "nuplan": "CC BY-NC-SA 4.0",
    "av2": "CC BY-NC-SA 4.0",
    "lyft": "CC BY-NC-SA 4.0",
    "metadrive": "Apache-2.0",
}
# Stored in the scenario's arrays or its source already.
_STORED = {
    "id", "dataset", "scenario_id", "sdc_id", "sdc_track_index", "ts", "sample_rate", "track_length",
    "current_time_index", "objects_of_interest", "tracks_to_predict", "origin", "has_z", "split", "scenario_uid",
    "old_origin_in_current_coordinate", "object_summary", "number_summary", "extras", "licence", "log_name", "map",
    "date", "crs", "omitted_map_features", "omitted_polygons",
}  # fmt: skip


class ScenarioNetPickles(Converter[RawItem]):
    """Converter of databases written by ScenarioNet, MetaDrive, or this project's export."""

    name = "scenarionet"
    version = "2"
    release = "v1"
    licence = "licence of the original dataset"
    raw = "folder of ScenarioNet pickles (sd_*.pkl), or of such folders"
    listed = (_MAPPING,)
    properties = tuple(SUMMARISED)

    def shards(self, raw: str, split: str, version: str, options: Options) -> Iterator[Shard]:
        """List buckets of pickles, by a hash of their names."""
        root = Path(raw) if Path(raw).is_dir() else Path(raw).parent
        items = []
        for name in _list_pickles(raw):
            path = root / name
            items.append(RawItem(name, _fingerprint(path), properties_of(path)))
        for name, members in bucket(items).items():
            yield Shard(self.name, version, split, name, str(root), members, options)

    def records(self, shard: Shard) -> Iterator[RawItem]:
        """Yield the shard's files, which ``scenario`` reads, so that a damaged file affects one scenario only."""
        yield from shard.items

    def scenario(self, shard: Shard, record: RawItem) -> ScenarioDescription:
        """Read one pickle."""
        path = Path(shard.root) / record.name
        if not path.is_file():
            advice = f"is missing, although {_MAPPING} lists it; restore it and run the same command again"
            raise InvalidScenario(record.name, "pickle", advice)
        description = load(path, record.name)
        for key in ("version", "length", "tracks", "dynamic_map_states", "map_features", "metadata"):
            if key not in description:
                raise InvalidScenario(record.name, key, "is missing")
        try:
            return _make_scenario(shard, record.name, description)
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            # A field is missing or of the wrong type, anywhere in third-party data.
            raise InvalidScenario(record.name, "pickle", f"expected ScenarioNet's form, found {error!r}") from error


def _make_scenario(shard: Shard, where: str, description: dict[str, Any]) -> ScenarioDescription:
    metadata, tracks = description["metadata"], description["tracks"]
    states = read_states(tracks, description["length"], where)
    ego_id = str(metadata["sdc_id"])
    ego = [str(track_id) for track_id in tracks].index(ego_id)
    frame = find_frame(description, states.position[ego], states.valid[ego], _has_heights(states, description))
    if frame.dataset == "nuscenes" or description["version"].startswith("nuscenesv1.0"):
        restore_ego_size(states, ego)
    map_features, unknown_features = make_map(description["map_features"], frame)
    times = np.asarray(metadata["ts"], dtype=np.float64)
    name = str(description.get("id", metadata.get("scenario_id")))
    return ScenarioDescription(
        id=make_scenario_id(shard.dataset, shard.version, f"{frame.dataset}_{name}"),
        dataset=shard.dataset,
        version=shard.version,
        split=shard.split,
        timestamps=times - times[0],
        dt=_time_step(metadata, times),
        current_timestep=int(metadata.get("current_time_index", np.argmax(states.valid[ego]))),
        ego_id=ego_id,
        origin=frame.origin,
        has_z=frame.has_z,
        source=_make_source(metadata, where, frame.dataset, name),
        tracks=make_pickled_tracks(tracks, states, frame.local_origin, frame.dataset, ego),
        lights=make_lights(description, frame, where),
        map=map_features,
        objects_of_interest=tuple(str(track_id) for track_id in metadata.get("objects_of_interest", ())),
        tracks_to_predict=_tracks_to_predict(metadata.get("tracks_to_predict", {})),
        extras=_make_extras(description, frame, name, unknown_features),
    )


def _has_heights(states: States, description: Mapping[str, Any]) -> bool:
    if states.position[..., 2][states.valid].any():
        return True
    lines = (feature.get("polyline", ()) for feature in description["map_features"].values())
    return any(len(line) and len(line[0]) == 3 and np.asarray(line)[:, 2].any() for line in lines)


def _time_step(metadata: Mapping[str, Any], times: Float64) -> float:
    """Return the nominal timestep [s]: of the pickle, else the median rounded to a millisecond."""
    if metadata.get("sample_rate"):
        return float(metadata["sample_rate"])
    return round(float(np.median(np.diff(times))), 3) if len(times) > 1 else _DT


def _tracks_to_predict(predicted: Any) -> tuple[tuple[str, int], ...]:
    """Return pairs of track and difficulty, from Waymo's records by track id or from a list of ids."""
    if isinstance(predicted, Mapping):
        return tuple((str(i), int(record.get("difficulty") or 0)) for i, record in predicted.items())
    return tuple((str(track_id), 0) for track_id in predicted)


def _make_source(metadata: Mapping[str, Any], where: str, dataset: str, name: str) -> Source:
    def told(key: str) -> str | None:
        return str(metadata[key]) if metadata.get(key) is not None else None

    return Source(
        scenario_id=told("source_scenario_id") or name,
        file=where,
        licence=told("licence") or _LICENCES.get(dataset, ScenarioNetPickles.licence),
        log=told("log_name"),
        city=told("map"),
        date=told("date"),
        crs=told("crs"),
    )


def _make_extras(
    description: Mapping[str, Any], frame: Frame, name: str, unknown_features: dict[str, int]
) -> dict[str, Any]:
    """Return extras: the pickle's name, metadata without a field in the schema, and dropped values."""
    metadata = description["metadata"]
    rest = {str(key): value for key, value in metadata.items() if key not in _STORED and _is_simple(value)}
    unstored = {
        "states": count_unstored_states(description["tracks"]),
        "map_features": unknown_features,
        "metadata": sorted(str(k) for k, value in metadata.items() if k not in _STORED and not _is_simple(value)),
    }
    return {
        **(metadata.get("extras", {}) if frame.is_ours else {}),
        "dataset": frame.dataset,
        "version": str(description["version"]),
        "id": name,
        **({"metadata": rest} if rest and not frame.is_ours else {}),
        **({"unstored": found} if (found := {key: value for key, value in unstored.items() if value}) else {}),
    }


def _is_simple(value: Any) -> bool:
    return value is None or type(value) in (str, int, float, bool)


def _list_pickles(raw: str) -> list[str]:
    """List the scenarios' files relative to the raw folder: the files in its mapping, or all files without one.

    Raises:
        SourceNotFound: No scenarios, or none of those in the mapping is present.
        CorruptSource: The mapping cannot be read.
    """
    mapping = Path(raw) / _MAPPING
    if not mapping.is_file():
        root = Path(raw)
        files = find_files(raw, "*.pkl", "ScenarioNet pickles (sd_*.pkl)")
        names = [
            path.relative_to(root).as_posix() if path != root else path.name for path in files if _is_scenario(path)
        ]
        if not names:
            raise SourceNotFound(f"{raw}: no pickle named sd_*.pkl or 0.pkl, 1.pkl, ... in it")
        return names
    try:
        folders = load(mapping, str(mapping))
        names = [(Path(str(folder)) / str(file)).as_posix() for file, folder in folders.items()]
    except InvalidScenario as error:
        raise CorruptSource(f"{mapping}: {error.reason}; copy it again, or remove it to take every pickle") from error
    if names and not any((Path(raw) / name).is_file() for name in names):
        raise SourceNotFound(f"{raw}: all {len(names)} files that its mapping lists are missing, such as {names[0]}")
    return names


def _fingerprint(path: Path) -> str:
    try:
        return fingerprint([path])
    except CorruptSource:  # missing, or unreadable: one scenario in quarantine
        return ABSENT


def _is_scenario(path: Path) -> bool:
    return path.stem.startswith("sd_") or path.stem.isdigit()
