"""Crops of maps that many scenarios share: the map is read once a process, a crop is a gather."""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from scenarionet_data import codec
from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import meets
from scenarionet_data.errors import ScenarioNotFound
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.schema import tables
from scenarionet_data.storage.files.lake_files import LakeFiles

_KEPT_MAPS = 4


@dataclass(frozen=True)
class SharedMap:
    """A shared map in memory.

    Attributes:
        features: In the source's order; coordinates from each feature's origin.
        origins: (M, 3) float64 [m] of each feature's tile.
        bounds: (M, 4) float64 [m] min_x, min_y, max_x, max_y in the source frame; NaN without geometry.
    """

    features: MapFeatures
    origins: Float64
    bounds: Float64

    def crop(self, window: tuple[float, float, float, float], origin: Float64) -> MapFeatures:
        """The features, whole, that meet a window, in the frame of a scenario.

        Args:
            window: min_x, min_y, max_x, max_y [m] in the scenario's frame.
            origin: (3,) of the scenario.
        """
        corner = np.array([origin[0], origin[1], origin[0], origin[1]])
        min_x, min_y, max_x, max_y = np.asarray(window) + corner
        rows = np.flatnonzero(meets(self.bounds, (min_x, min_y, max_x, max_y)))
        chosen, shift = self.features.take(rows), self.origins[rows] - origin
        return replace(chosen, polyline=_moved(chosen.polyline, shift), polygon=_moved(chosen.polygon, shift))


class SharedMaps:
    """The shared maps of a lake, the most recently used kept in memory.

    Args:
        files: The lake's files.
        names: File of each map, by dataset, version and map id.
    """

    def __init__(self, files: LakeFiles, names: dict[tuple[str, str, str], str]) -> None:
        self._files = files
        self._names = names
        self._kept: OrderedDict[tuple[str, str, str], SharedMap] = OrderedDict()
        self._lock = threading.Lock()

    def __getstate__(self) -> dict[str, Any]:
        return {"files": self._files, "names": self._names}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__(**state)  # type: ignore[misc]  # what is kept in memory does not travel

    def get(self, dataset: str, version: str, map_id: str) -> SharedMap:
        """A map.

        Raises:
            ScenarioNotFound: The lake has no such map.
        """
        key = (dataset, version, map_id)
        if key not in self._names:
            raise ScenarioNotFound(f"no map {map_id!r} of {dataset} {version} in the lake; convert it with its maps")
        with self._lock:
            if key not in self._kept:
                self._kept[key] = read(self._files.path(self._names[key]))
                if len(self._kept) > _KEPT_MAPS:
                    self._kept.popitem(last=False)
            self._kept.move_to_end(key)
            return self._kept[key]


def read(path: Path) -> SharedMap:
    """A shared map from its file."""
    file = pq.ParquetFile(path)
    tables.load("maps").check_version(file.metadata.metadata, str(path))
    (rows,) = file.read(use_threads=False).sort_by("feature_index").combine_chunks().to_batches()
    origins = np.column_stack([rows.column(f"origin_{axis}").to_numpy() for axis in "xyz"])
    boxes = [rows.column(name).to_numpy(zero_copy_only=False) for name in ("min_x", "min_y", "max_x", "max_y")]
    bounds = np.column_stack(boxes).astype(np.float64) + origins[:, [0, 1, 0, 1]]
    columns = codec.Columns.from_arrow(rows, tables.load("maps").columns)
    (features,) = codec.decode_maps(codec.Rows(columns, [0, rows.num_rows]))
    return SharedMap(features, origins, bounds)


def _moved(points: Ragged, shift: Float64) -> Ragged:
    moved = points.values + np.repeat(shift, points.lengths, axis=0)
    return Ragged(points.offsets, moved.astype(np.float32))
