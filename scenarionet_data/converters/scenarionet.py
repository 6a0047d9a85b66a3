"""ScenarioNet's and MetaDrive's pickles of every vintage, one scenario a file.

RAW is a database (a folder with ``dataset_mapping.pkl``, whose scenarios may lie elsewhere), a folder of pickles
with or without summary, or a folder of such folders. Format: ``metadrive/scenario/scenario_description.py`` of
MetaDrive 0.4.3 and the converters of ScenarioNet (2025-03), read for what they really write:

* nuScenes: sizes (T, 1), ``valid`` float, the ego's length and width exchanged, lanes whose third coordinate is a
  heading, 100 km/h on connectors that the source does not state, velocities by difference;
* Waymo: links as int while ids are str, states kept where not valid, headings of several turns;
* Argoverse 2: one assumed size per type, 85 mph everywhere, widths of 0;
* MetaDrive's own: cones without size, extra states (steering, ...), 1000 km/h for no limit;
* nuPlan: coordinates from the ego's first position, which is not kept; stop points in the plane.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.building import make_origin
from scenarionet_data.converters.base import (
    Budgets,
    Converter,
    Options,
    RawItem,
    Shard,
    bucket,
    find_files,
    fingerprint,
)
from scenarionet_data.converters.scenarionet_map import make_lights, make_map
from scenarionet_data.converters.scenarionet_pickle import load
from scenarionet_data.converters.scenarionet_tracks import Arrays, field, make_pickled_tracks, stack_states
from scenarionet_data.errors import CorruptSource, InvalidScenario, SourceNotFound
from scenarionet_data.scenario import Float64, ScenarioDescription, Source, make_scenario_id

_MAPPING = "dataset_mapping.pkl"
_LICENCES = {
    "waymo": "Waymo Open Dataset License (non-commercial)",
    "nuscenes": "CC BY-NC-SA 4.0",
    "nuplan": "CC BY-NC-SA 4.0",
    "av2": "CC BY-NC-SA 4.0",
    "lyft": "CC BY-NC-SA 4.0",
    "metadrive": "Apache-2.0",
}
# What the arrays of a scenario hold already, or what its source says.
_STORED = {
    "id", "dataset", "scenario_id", "sdc_id", "sdc_track_index", "ts", "sample_rate", "track_length",
    "current_time_index", "objects_of_interest", "tracks_to_predict", "origin", "has_z", "split", "scenario_uid",
    "old_origin_in_current_coordinate", "object_summary", "number_summary", "extras", "licence", "log_name", "map",
    "date", "crs", "omitted_map_features", "omitted_polygons",
}  # fmt: skip


class ScenarioNetPickles(Converter[RawItem]):
    """Databases of ScenarioNet, MetaDrive, or of our own export."""

    name = "scenarionet"
    version = "1"
    release = "v1"
    licence = "the licence of the dataset that was pickled"
    raw = "folder of ScenarioNet pickles (sd_*.pkl), or of such folders"
    # nuScenes' velocities are differences of interpolated keyframes: they jump where a keyframe is.
    budgets = Budgets(velocity_median=0.5, velocity_p99=8.0, heading_p99=1.2)

    def shards(self, raw: str, split: str, version: str, options: Options) -> Iterator[Shard]:
        """Buckets of pickles, by a hash of their names."""
        root = Path(raw) if Path(raw).is_dir() else Path(raw).parent
        items = [RawItem(name, fingerprint([root / name])) for name in _list_pickles(raw)]
        for name, members in bucket(items).items():
            yield Shard(self.name, version, split, name, str(root), members, options)

    def records(self, shard: Shard) -> Iterator[RawItem]:
        """The shard's files; each is read when it becomes a scenario, so that one bad file costs one scenario."""
        yield from shard.items

    def scenario(self, shard: Shard, record: RawItem) -> ScenarioDescription:
        """Read one pickle."""
        description = load(Path(shard.root) / record.name, record.name)
        try:
            return _Pickle(description, record.name).scenario(shard)
        except (AttributeError, IndexError, KeyError, TypeError, ValueError) as error:
            # A field of the wrong kind, deep inside a stranger's data.
            raise InvalidScenario(record.name, "pickle", f"wanted ScenarioNet's form, found {error!r}") from error


def _list_pickles(raw: str) -> list[str]:
    """Names of the scenarios' files, relative to the raw folder: those of its mapping, else all below it."""
    mapping = Path(raw) / _MAPPING
    if not mapping.is_file():
        root = Path(raw)
        files = find_files(raw, "*.pkl", "ScenarioNet pickles (sd_*.pkl)")
        names = [path.relative_to(root).as_posix() if path != root else path.name for path in files if _is_scenario(path)]
        if not names:
            raise SourceNotFound(f"{raw}: no pickle named sd_*.pkl or 0.pkl, 1.pkl, ... in it")
        return names
    try:
        folders = load(mapping, str(mapping))
        names = [(Path(str(folder)) / str(file)).as_posix() for file, folder in folders.items()]
    except InvalidScenario as error:
        raise CorruptSource(f"{mapping}: {error.reason}; copy it again, or remove it to take every pickle") from error
    missing = [name for name in names if not (Path(raw) / name).is_file()]
    if missing:
        raise SourceNotFound(f"{raw}: its mapping names {missing[0]}, which is not there ({len(missing)} such files)")
    return names


def _is_scenario(path: Path) -> bool:
    return path.stem.startswith("sd_") or path.stem.isdigit()
