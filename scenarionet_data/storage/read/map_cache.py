"""Cache of shared maps: each is read once per process and cropped for every scenario."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from scenarionet_data import codec
from scenarionet_data.arrays.columns import from_arrow, offsets_of
from scenarionet_data.arrays.dtypes import Float64, Int64
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import meets
from scenarionet_data.errors import ScenarioNotFound
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.read.crop_kernels import move_points
from scenarionet_data.storage.snapshots import manifests
from scenarionet_data.storage.snapshots import snapshot as snapshots
from scenarionet_data.storage.snapshots.snapshot import Snapshot

_MAX_MAPS, _MAX_CROPS = 4, 4
_NUMBERS = ("feature_type", "speed_limit", "is_intersection")
"""Fields of map features with one number each."""


@dataclass(frozen=True)
class SharedMap:
    """A shared map in memory.

    Attributes:
        features: In the order of the source; coordinates relative to the feature's origin.
        origins: (M, 3) float64 [m] origin of each feature's tile.
        bounds: (M, 4) float64 [m] min_x, min_y, max_x, max_y in the source frame; NaN without geometry.
    """

    features: MapFeatures
    origins: Float64
    bounds: Float64
    _crops: dict[tuple[bytes, bytes], MapFeatures] = field(default_factory=dict, init=False, repr=False)

    def crop(self, window: tuple[float, float, float, float], origin: Float64) -> MapFeatures:
        """Features that intersect a window, uncut, in the frame of a scenario.

        Args:
            window: min_x, min_y, max_x, max_y [m] in the scenario's frame.
            origin: (3,) float64 [m] of the scenario in the source frame.
        """
        corner = np.array([origin[0], origin[1], origin[0], origin[1]])
        min_x, min_y, max_x, max_y = np.asarray(window) + corner
        rows = np.flatnonzero(meets(self.bounds, (min_x, min_y, max_x, max_y)))
        key = rows.tobytes(), origin.tobytes()
        known = self._crops.get(key)
        if known is not None:
            return known
        shift = self.origins[rows] - origin
        values: dict[str, Any] = {name: getattr(self.features, name)[rows] for name in _NUMBERS}
        values["width"] = self.features.width.take(rows)
        for name in ("polyline", "polygon"):
            points: Ragged = getattr(self.features, name)
            offsets = offsets_of(points.lengths[rows])
            moved = np.empty((offsets[-1], 3), np.float32)
            move_points(points.offsets, points.values, rows, shift, offsets, moved)
            values[name] = Ragged(offsets, moved)
        if len(self._crops) == _MAX_CROPS:
            self._crops.clear()
        return self._crops.setdefault(key, MapFeatures.read(values, _Chosen(self.features, rows)))


class _Chosen:
    """Fields of some features, of which only those are taken that are read: most of them are texts.

    Args:
        features: All features.
        rows: (n,) int64 the chosen ones.
    """

    def __init__(self, features: MapFeatures, rows: Int64) -> None:
        self._features, self._rows = features, rows

    def __getitem__(self, field: str) -> Any:
        values = getattr(self._features, field)
        return values.take(self._rows) if isinstance(values, Ragged) else values[self._rows]


class MapCache:
    """The most recently used shared maps of a lake.

    Args:
        files: The lake's files.
        snapshot: The snapshot of the maps.
    """

    def __init__(self, files: LakeFiles, snapshot: Snapshot) -> None:
        self._files = files
        self._snapshot = snapshot
        self._maps: OrderedDict[tuple[str, str, str], SharedMap] = OrderedDict()
        self._lock = threading.Lock()

    def __getstate__(self) -> dict[str, Any]:
        return {"files": self._files, "snapshot": self._snapshot}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state)  # type: ignore[misc]  # cached maps are not pickled

    @cached_property
    def _names(self) -> dict[tuple[str, str, str], str]:
        return manifests.shared_maps(self._files, self._snapshot)

    def crop(self, row: Mapping[str, Any]) -> MapFeatures:
        """The crop of a shared map that a scenario has, by its metadata row.

        Raises:
            ScenarioNotFound: The lake has no such map.
        """
        with snapshots.reading_from(self._files, self._snapshot):
            shared = self.get(row["dataset"], row["version"], row["map_id"])
        return shared.crop(tuple(row["map_crop"]), np.array([row["origin_x"], row["origin_y"], row["origin_z"]]))

    def get(self, dataset: str, version: str, map_id: str) -> SharedMap:
        """Read a map, or return it from the cache.

        Raises:
            ScenarioNotFound: The lake has no such map.
        """
        key = (dataset, version, map_id)
        if key not in self._names:
            raise ScenarioNotFound(f"no map {map_id!r} of {dataset} {version} in the lake; convert it with its maps")
        with self._lock:
            if key not in self._maps:
                self._maps[key] = _read(self._files, self._names[key])
                if len(self._maps) > _MAX_MAPS:
                    self._maps.popitem(last=False)
            self._maps.move_to_end(key)
            return self._maps[key]


def _read(files: LakeFiles, name: str) -> SharedMap:
    """Read a shared map from its file."""
    found = files.read(name)
    tables.load("maps").check_version(found.schema.metadata, files.url(name))
    whole = tables.load("maps").conform(found)
    (rows,) = whole.sort_by("feature_index").combine_chunks().to_batches()
    origins = np.column_stack([rows.column(f"origin_{axis}").to_numpy() for axis in "xyz"])
    boxes = [rows.column(name).to_numpy(zero_copy_only=False) for name in ("min_x", "min_y", "max_x", "max_y")]
    bounds = np.column_stack(boxes).astype(np.float64) + origins[:, [0, 1, 0, 1]]
    columns = from_arrow(rows, codec.LAYOUTS["maps"])
    features = codec.decode_map(codec.ScenarioColumns(columns, [0, rows.num_rows], Memory(0)))
    return SharedMap(features, origins, bounds)
