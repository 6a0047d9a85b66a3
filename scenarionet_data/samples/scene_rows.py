"""Rows of several scenarios as joined lists."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from scenarionet_data import codec
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.codec.stored_part import ScenarioColumns
from scenarionet_data.samples.scene_kernels import MapLists, Times, TrackLists
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.read.map_cache import MapCache
from scenarionet_data.storage.read.metadata_rows import MetadataRows
from scenarionet_data.storage.read.scenario_reader import ScenarioReader, with_tracks
from scenarionet_data.storage.snapshots.snapshot import Snapshot

_LISTS = ("x", "y", "heading", "vx", "vy", "length", "width", "height", "valid", "is_interpolated")
TRACK_COLUMNS = frozenset(["track_id", "object_type", "start", *_LISTS])
"""Columns of the table tracks that :meth:`JoinedScenes.track_lists` needs."""
MAP_COLUMNS = frozenset(["feature_type", "x", "y", "polygon_x", "polygon_y"])
"""Columns of the table maps that :meth:`JoinedScenes.map_lists` needs."""


@dataclass(frozen=True, eq=False)
class JoinedScenes:
    """Rows of S scenarios.

    Attributes:
        metadata: Metadata row of each scenario.
        tracks: Rows of the table tracks.
        maps: Rows of the table maps; None without any.
        shared_maps: Crop of each scenario's shared map, in its frame; None for scenarios with their own map.
    """

    metadata: Sequence[Mapping[str, Any]]
    tracks: ScenarioColumns
    maps: ScenarioColumns | None
    shared_maps: Sequence[MapFeatures | None]

    def track_lists(self) -> TrackLists:
        """The objects as lists.

        Raises:
            LakeError: Lists do not match: a file is damaged.
        """
        codec.check_lists(self.tracks, [row["num_timesteps"] for row in self.metadata], _LISTS)
        columns = self.tracks.columns
        lists = {name: columns.lists(name)[1:] for name in _LISTS}
        x = columns.lists("x")
        states = (lists[name][1] for name in ("x", "y", "heading", "vx", "vy"))
        others = (part for name in ("length", "width", "height", "valid", "is_interpolated") for part in lists[name])
        return TrackLists(
            np.array(self.tracks.bounds, np.int64),
            codec.codes(columns, "object_type", ObjectType),
            columns.values("start"),
            x.lengths,
            x.offsets,
            *states,
            *others,
        )

    def map_lists(self) -> MapLists:
        """The map features as lists, of scenarios with their own and with a shared map.

        Raises:
            LakeError: Lists do not match: a file is damaged.
        """
        shared = [features or _EMPTY_MAP for features in self.shared_maps]
        own = _own_map(self.maps, len(self.metadata))
        return own if all(features is None for features in self.shared_maps) else _joined(own, shared)

    def times(self) -> Times:
        """The recorded times."""
        rows = [(row["timestamps"], row["num_timesteps"], row["dt"]) for row in self.metadata]
        listed = [np.arange(count) * dt if times is None else np.array(times) for times, count, dt in rows]
        return Times(np.cumsum([0, *map(len, listed)], dtype=np.int64), np.concatenate(listed))

    def track_ids(self) -> list[list[str]]:
        """Ids of each scenario's objects."""
        ids = self.tracks.columns.strings("track_id").tolist()
        return [ids[first:end] for first, end in pairwise(self.tracks.bounds)]


class SceneReader:
    """Reads the columns of scenarios that a layout needs; for one thread.

    Args:
        files: The lake's files.
        snapshot: The snapshot.
        rows: Rows of all scenarios of the metadata table.
        columns: Columns of the tables tracks and maps; all that a scenario is decoded from by default.
        with_map: Whether to read maps.

    Attributes:
        memory: Memory for the arrays of samples, and for others while they are made.
    """

    def __init__(
        self,
        files: LakeFiles,
        snapshot: Snapshot,
        rows: MetadataRows,
        columns: Mapping[str, frozenset[str]] | None,
        *,
        with_map: bool,
    ) -> None:
        self._rows = rows
        self._reader = ScenarioReader(files, snapshot, columns=columns)
        self._tables = ("tracks", "maps") if with_map else ("tracks",)
        self._maps = MapCache(files, snapshot)
        self.memory = self._reader.memory

    def prefetch(self, scenarios: Array) -> None:
        """Request the row groups of scenarios that will be read next."""
        self._reader.prefetch(self.metadata(scenarios), self._tables)

    def metadata(self, scenarios: Array) -> list[dict[str, Any]]:
        """Metadata rows of scenarios."""
        return [self._rows[number] for number in scenarios.tolist()]

    def read(self, scenarios: Array) -> JoinedScenes:
        """Read scenarios.

        Raises:
            LakeError: A file is missing or damaged; the message names it.
        """
        metadata = self.metadata(scenarios)
        rows = self._reader.read(metadata, self._tables)
        with_map = "maps" in self._tables
        crops = [self._maps.crop(row) if with_map and row["map_crop"] is not None else None for row in metadata]
        return JoinedScenes(metadata, with_tracks(metadata, rows), rows.get("maps"), crops)


def _own_map(rows: ScenarioColumns | None, count: int) -> MapLists:
    """Features of maps of the scenarios' own."""
    if rows is None:
        none = np.zeros(0, np.float32)
        start = np.zeros(1, np.int32)
        return MapLists(np.zeros(count + 1, np.int64), np.zeros(0, np.uint8), start, none, none, start, none, none)
    columns = rows.columns
    codec.check_points(columns, ("x", "y", "polygon_x", "polygon_y"))
    line, outline = columns.lists("x"), columns.lists("polygon_x")
    x, y, outline_x, outline_y = (columns.values(name) for name in ("x", "y", "polygon_x", "polygon_y"))
    kinds = codec.codes(columns, "feature_type", MapFeatureType)
    bounds = np.array(rows.bounds, np.int64)
    return MapLists(bounds, kinds, line.offsets, x, y, outline.offsets, outline_x, outline_y)


_EMPTY_MAP = MapFeatures.empty()


def _joined(own: MapLists, shared: Sequence[MapFeatures]) -> MapLists:
    """Features of both kinds of maps; a scenario has one of them."""
    parts = []
    for scene, features in enumerate(shared):
        first, end = own.bounds[scene], own.bounds[scene + 1]
        lines = slice(own.offsets[first], own.offsets[end])
        outlines = slice(own.outline_offsets[first], own.outline_offsets[end])
        line, outline = features.polyline.values, features.polygon.values
        parts.append(
            (
                np.concatenate([own.kind[first:end], features.feature_type]),
                np.concatenate([np.diff(own.offsets[first : end + 1]), features.polyline.lengths]),
                np.concatenate([own.x[lines], line[:, 0]]),
                np.concatenate([own.y[lines], line[:, 1]]),
                np.concatenate([np.diff(own.outline_offsets[first : end + 1]), features.polygon.lengths]),
                np.concatenate([own.outline_x[outlines], outline[:, 0]]),
                np.concatenate([own.outline_y[outlines], outline[:, 1]]),
            )
        )
    kind, lengths, x, y, outline_lengths, outline_x, outline_y = (np.concatenate(p) for p in zip(*parts, strict=True))
    bounds = np.cumsum([0, *(len(part[0]) for part in parts)], dtype=np.int64)
    starts, outline_starts = (np.cumsum([0, *n], dtype=np.int32) for n in (lengths, outline_lengths))
    return MapLists(bounds, kind, starts, x, y, outline_starts, outline_x, outline_y)
