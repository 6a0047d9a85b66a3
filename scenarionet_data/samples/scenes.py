"""Several scenarios as joined columns, and the samples that are wanted of them: the input of layouts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from scenarionet_data import codec
from scenarionet_data.arrays.dtypes import Float64, Int32, UInt64
from scenarionet_data.arrays.memory import Memory
from scenarionet_data.codec.stored_part import ScenarioColumns
from scenarionet_data.samples.choices import Choices
from scenarionet_data.samples.kernels import RecordedFrames, Rules, TrackLists, Wanted, find_frames
from scenarionet_data.samples.polyline_kernels import MapLists
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from scenarionet_data.storage.files.lake_files import LakeFiles
from scenarionet_data.storage.read.map_cache import MapCache
from scenarionet_data.storage.read.scenario_reader import ScenarioReader, with_tracks
from scenarionet_data.storage.snapshots.snapshot import Snapshot

_LISTS = ("x", "y", "heading", "vx", "vy", "length", "width", "height", "valid", "is_interpolated")
TRACK_COLUMNS = frozenset(["track_id", "object_type", "start", *_LISTS])
"""Columns of the table tracks that :attr:`Scenes.tracks` needs."""
MAP_COLUMNS = frozenset(["feature_type", "x", "y", "polygon_x", "polygon_y"])
"""Columns of the table maps that :attr:`Scenes.map` needs."""


@dataclass(frozen=True)
class Requests:
    """Samples of some scenarios.

    Attributes:
        scene: (B,) int32 scenario of each sample.
        moment: (B,) int32 recorded timestep that is the current one.
        targets: Ids of the targets of each sample.
        keys: (B,) uint64 keys of random numbers.
    """

    scene: Int32
    moment: Int32
    targets: Sequence[tuple[str, ...]]
    keys: UInt64


@dataclass(frozen=True, eq=False)
class Scenes:
    """Rows of S scenarios, and B samples that are wanted of them.

    Attributes:
        metadata: Metadata row of each scenario.
        track_rows: Rows of the table tracks.
        map_rows: Rows of the table maps; None without any.
        shared_maps: Crop of each scenario's shared map, in its frame; None for scenarios with their own map.
        requests: The samples.
        memory: Memory for the arrays of samples, and for others while they are made.
    """

    metadata: Sequence[Mapping[str, Any]]
    track_rows: ScenarioColumns
    map_rows: ScenarioColumns | None
    shared_maps: Sequence[MapFeatures | None]
    requests: Requests
    memory: Memory

    @cached_property
    def tracks(self) -> TrackLists:
        """The objects as lists.

        Raises:
            LakeError: Lists do not match: a file is damaged.
        """
        codec.check_lists(self.track_rows, [row["num_timesteps"] for row in self.metadata], _LISTS)
        columns = self.track_rows.columns
        lists = {name: columns.lists(name)[1:] for name in _LISTS}
        x = columns.lists("x")
        states = (lists[name][1] for name in ("x", "y", "heading", "vx", "vy"))
        others = (part for name in ("length", "width", "height", "valid", "is_interpolated") for part in lists[name])
        return TrackLists(
            np.array(self.track_rows.bounds, np.int64),
            codec.codes(columns, "object_type", ObjectType),
            columns.values("start"),
            x.lengths,
            x.offsets,
            *states,
            *others,
        )

    @cached_property
    def map(self) -> MapLists:
        """The map features as lists, of scenarios with their own and with a shared map.

        Raises:
            LakeError: Lists do not match: a file is damaged.
        """
        shared = [features or _EMPTY_MAP for features in self.shared_maps]
        own = _own_map(self.map_rows, len(self.metadata))
        return own if all(features is None for features in self.shared_maps) else _joined(own, shared)

    @cached_property
    def descriptions(self) -> list[ScenarioDescription]:
        """The scenarios whole, for layouts that need all columns of tracks and maps; without traffic lights."""
        return codec.decode_many(self.metadata, self.track_rows, None, self.map_rows, self.shared_maps)

    @cached_property
    def track_ids(self) -> list[list[str]]:
        """Ids of each scenario's objects."""
        ids = self.track_rows.columns.strings("track_id").tolist()
        return [ids[first:end] for first, end in pairwise(self.track_rows.bounds)]

    def _row(self, scene: int, track_id: str) -> int:
        """Row of an object; -1 if its scenario has none of this id."""
        ids = self.track_ids[scene]
        return self.track_rows.bounds[scene] + ids.index(track_id) if track_id in ids else -1

    def wanted(self, choices: Choices) -> Wanted:
        """The samples for kernels, with rows for ids."""
        requests = self.requests
        scenes = requests.scene.tolist()
        rows = [
            [self._row(scene, name) for name in names] for scene, names in zip(scenes, requests.targets, strict=True)
        ]
        is_agent = choices.perspective == "agent"
        egos = [] if is_agent else [self._row(scene, self.metadata[scene]["ego_id"]) for scene in scenes]
        centre = [found[0] for found in rows] if is_agent else egos
        augmentation = choices.augmentation
        draws = uniform(requests.keys ^ np.uint64(0xA5A5A5A5A5A5A5A5), 2)
        return Wanted(
            requests.scene,
            requests.moment,
            np.array(centre, np.int64),
            np.cumsum([0, *map(len, rows)], dtype=np.int64),
            np.array([row for found in rows for row in found], np.int64),
            augmentation.rotation * (2.0 * draws[:, 0] - 1.0),
            np.where(draws[:, 1] < augmentation.flip, -1.0, 1.0),
            requests.keys,
        )

    def frames(self, choices: Choices, wanted: Wanted) -> RecordedFrames:
        """The recorded frames around each timestep of each sample."""
        window = choices.window
        listed = [timestamps(row) for row in self.metadata]
        shape = (len(wanted.scene), window.num_history + window.num_future)
        frames = RecordedFrames(np.empty(shape, np.int32), np.empty(shape), np.empty(shape))
        bounds = np.cumsum([0, *map(len, listed)], dtype=np.int64)
        find_frames(np.concatenate(listed), bounds, wanted, rules(choices), frames)
        return frames


class SceneReader:
    """Reads the columns that a layout needs; for one thread.

    Args:
        files: The lake's files.
        snapshot: The snapshot.
        columns: Columns of the tables tracks and maps; all that a scenario is decoded from by default.
        with_map: Whether to read maps.
    """

    def __init__(
        self, files: LakeFiles, snapshot: Snapshot, columns: Mapping[str, frozenset[str]] | None, *, with_map: bool
    ) -> None:
        self._files, self._snapshot = files, snapshot
        self._reader = ScenarioReader(files, snapshot, columns=columns)
        self._tables = ("tracks", "maps") if with_map else ("tracks",)
        self._maps = MapCache(files, snapshot)

    def prefetch(self, metadata: Sequence[Mapping[str, Any]]) -> None:
        """Request the row groups of scenarios that will be read next."""
        self._reader.prefetch(metadata, self._tables)

    def read(self, metadata: Sequence[Mapping[str, Any]], requests: Requests) -> Scenes:
        """Read scenarios.

        Raises:
            LakeError: A file is missing or damaged; the message names it.
        """
        rows = self._reader.read(metadata, self._tables)
        with_map = "maps" in self._tables
        crops = [self._maps.crop(row) if with_map and row["map_crop"] is not None else None for row in metadata]
        return Scenes(metadata, with_tracks(metadata, rows), rows.get("maps"), crops, requests, self._reader.memory)


def timestamps(row: Mapping[str, Any]) -> Float64:
    """(T,) [s] times of a scenario, from its metadata row."""
    recorded = row["timestamps"]
    found: Float64 = np.arange(row["num_timesteps"]) * row["dt"] if recorded is None else np.array(recorded)
    return found


def rules(choices: Choices) -> Rules:
    """Choices as numbers for kernels."""
    window, agents, augmentation = choices.window, choices.agents, choices.augmentation
    types = np.array(agents.types, np.uint8)
    num_history, gap = window.num_history, window.longest_gap
    return Rules(num_history, window.dt, gap, agents.radius, types, augmentation.noise, augmentation.drop)


def uniform(keys: UInt64, count: int) -> Float64:
    """(n, count) random numbers in [0, 1): SplitMix64 (Steele, Lea, Flood 2014), a function of the keys."""
    state = keys[:, None] + np.arange(1, count + 1, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    found: Float64 = ((state ^ (state >> np.uint64(31))) >> np.uint64(11)).astype(np.float64) * 2.0**-53
    return found


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
