"""Load scenarios from a lake: their ids are looked up once in the metadata files, rows are then read by row group.

Loading a scenario through DuckDB takes 44 ms, by row group 1.6. A loader pickles as path and ids and opens its files
lazily in each process and thread, so that it works in the workers of a torch ``DataLoader``.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Self

import numpy as np

from scenarionet_data import codec
from scenarionet_data.arrays.dtypes import is_count
from scenarionet_data.cards import HasCard
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import BadParameter, ScenarioNotFound
from scenarionet_data.query.lake_view import LakeLike, LakeView, open_view
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription, Tracks
from scenarionet_data.storage.read.map_cache import MapCache
from scenarionet_data.storage.read.metadata_rows import MetadataRows
from scenarionet_data.storage.read.older_lakes import ContentComparison
from scenarionet_data.storage.read.scenario_reader import TABLES, ScenarioReader, with_tracks

Metadata = Mapping[str, Any]
"""A scenario's row of the metadata table: description, and addresses of its rows in the other tables."""

Decode = Callable[[Sequence[Metadata]], Sequence[Any]]

_DECODED_TOGETHER = 16
"""Scenarios that are decoded in one call, which divides the fixed costs by 16."""

_PREFETCHED = 64
"""Number of scenarios whose row groups are requested from an object store together."""


class ScenarioLoader(HasCard, Sequence[ScenarioDescription]):
    """The scenarios of a database (or of a list of ids, or of the whole lake) as a sequence.

    Args:
        lake: The lake, its path or its URL.
        database: A database (saved or not), its name, or scenario ids; by default all scenarios, ordered by id.

    Raises:
        ScenarioNotFound: The lake does not have a scenario.

    Example:
        loader = ScenarioLoader("lake", "busy")
        scenario = loader[0]
        scenario.tracks.position  # (N, T, 3) float32
    """

    def __init__(self, lake: LakeLike, database: DatabaseRecord | str | Iterable[str] | None = None) -> None:
        self._open(*open_view(lake).find(database))

    def _open(self, view: LakeView, rows: MetadataRows) -> None:
        self._files, self._snapshot, self._rows = view.files, view.snapshot, rows
        self._maps = MapCache(self._files, self._snapshot)
        self._comparison = ContentComparison.if_needed(self._files, self._snapshot)
        self._local = threading.local()

    @classmethod
    def of_rows(cls, view: LakeView, rows: MetadataRows) -> Self:
        """A loader of scenarios that have been looked up already."""
        loader = cls.__new__(cls)
        loader._open(view, rows)
        return loader

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_local"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _local=threading.local())

    def __repr__(self) -> str:
        return f"ScenarioLoader({str(self._files.root)!r}, snapshot={self._snapshot.number}, {len(self):,} scenarios)"

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def scenario_ids(self) -> list[str]:
        """Ids of the scenarios, in order."""
        return self._rows.scenario_ids

    def __iter__(self) -> Iterator[ScenarioDescription]:
        return self._stream(range(len(self)), TABLES, self._scenarios)

    def __getitem__(self, index: Any) -> Any:
        """Scenario ``index``, or of an id; a list of scenarios for a slice or several indices."""
        if isinstance(index, slice):
            if not all(part is None or is_count(part, None) for part in (index.start, index.stop, index.step)):
                raise BadParameter(f"expected a slice of indices, such as 0:8, found {index}")
            return self.batch(range(len(self))[index])
        if isinstance(index, list | range | np.ndarray):
            return self.batch(list(index))
        (scenario,) = self._scenarios(self._metadata([index]))
        return scenario

    def __getitems__(self, indices: Sequence[int]) -> list[ScenarioDescription]:
        """Call :meth:`batch`; torch's ``DataLoader`` uses this name."""
        return self.batch(indices)

    def tracks(self, index: int) -> Tracks:
        """Tracks of scenario ``index`` without lights and map: the fastest way to trajectories."""
        (tracks,) = self._tracks(self._metadata([index]))
        return tracks

    def batch(self, indices: Sequence[int]) -> list[ScenarioDescription]:
        """Scenarios at ``indices``, read in the order on disk and returned in the order of the indices."""
        return self._in_disk_order(indices, TABLES, self._scenarios)

    def batch_tracks(self, indices: Sequence[int]) -> list[Tracks]:
        """Tracks at ``indices``; see :meth:`batch`."""
        return self._in_disk_order(indices, ("tracks",), self._tracks)

    def compare(self, indices: Sequence[int]) -> None:
        """Compare scenarios of a lake that an older version wrote with what was converted; see :mod:`.older_lakes`.

        Raises:
            LakeError: A scenario is damaged.
        """
        if self._comparison:
            self._comparison.compare(self._metadata(indices), self._decode)

    def _in_disk_order(self, indices: Sequence[int], tables: Sequence[str], decode: Decode) -> list[Any]:
        metadata = self._metadata(indices)
        order = sorted(range(len(metadata)), key=lambda k: _disk_position(metadata[k]))
        loaded: list[Any] = [None] * len(metadata)
        for k, scenario in zip(order, self._stream([indices[k] for k in order], tables, decode), strict=True):
            loaded[k] = scenario
        return loaded

    def _stream(self, indices: Sequence[int], tables: Sequence[str], decode: Decode) -> Iterator[Any]:
        """Decode scenarios in groups, while the row groups of the following ones are being fetched."""
        for start in range(0, len(indices), _PREFETCHED):
            metadata = self._metadata(indices[start : start + 2 * _PREFETCHED])
            self._reader.prefetch(metadata, tables)
            for group in _decoding_groups(metadata[:_PREFETCHED]):
                yield from decode(group)

    def _metadata(self, indices: Sequence[Any]) -> list[Metadata]:
        size, rows = len(self._rows), []
        if isinstance(indices, str) or not isinstance(indices, Iterable):
            raise BadParameter(f"expected indices or ids of scenarios, such as [0, 1], found {indices!r}")
        for index in indices:
            if not isinstance(index, int | np.integer) or isinstance(index, bool):
                if not isinstance(index, str):
                    raise BadParameter(f"expected the index of a scenario, 0 ... {len(self) - 1}, or its id; {index!r}")
                ids = self.scenario_ids
                if index not in ids:
                    raise ScenarioNotFound(f"none of {len(ids):,} scenarios is {index!r}; ids look like {ids[:1]}")
                index = ids.index(index)
            if not -size <= index < size:
                raise IndexError(f"scenario {index} of {size}" + ("" if size else ": the selection is empty"))
            rows.append(self._rows[index % size])
        return rows

    def _scenarios(self, metadata: Sequence[Metadata]) -> list[ScenarioDescription]:
        if self._comparison:
            self._comparison.compare(metadata, self._decode)
        return self._decode(metadata)

    def _decode(self, metadata: Sequence[Metadata]) -> list[ScenarioDescription]:
        rows = self._reader.read(metadata, TABLES)
        crops: list[MapFeatures | None] = []
        for row in metadata:
            crops.append(None if row["map_crop"] is None else self._maps.crop(row))
        return codec.decode_many(metadata, with_tracks(metadata, rows), rows["lights"], rows["maps"], crops)

    def _tracks(self, metadata: Sequence[Metadata]) -> list[Tracks]:
        if self._comparison:
            self._comparison.compare(metadata, self._decode)
        rows = with_tracks(metadata, self._reader.read(metadata, ("tracks",)))
        return codec.decode_tracks(rows, [row["num_timesteps"] for row in metadata])

    @property
    def _reader(self) -> ScenarioReader:
        """This thread's reader."""
        reader: ScenarioReader | None = getattr(self._local, "reader", None)
        if reader is None:
            reader = self._local.reader = ScenarioReader(self._files, self._snapshot)
        return reader


def _decoding_groups(metadata: Sequence[Metadata]) -> Iterator[Sequence[Metadata]]:
    """Scenarios to decode together; those in the same row group stay together."""
    start = 0
    for end in range(1, len(metadata) + 1):
        is_last, is_full = end == len(metadata), end - start >= _DECODED_TOGETHER
        if is_last or (is_full and _disk_position(metadata[end]) != _disk_position(metadata[end - 1])):
            yield metadata[start:end]
            start = end


def _disk_position(row: Metadata) -> tuple[str, int]:
    """File and row group of a scenario's tracks."""
    return row["tracks_file"], row["tracks_row_group"]
