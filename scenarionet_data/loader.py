"""Scenarios out of the lake, one or a batch at a time: addresses are resolved once, files are read by row group.

DuckDB finds scenarios, pyarrow loads them (44 ms against 1.3 ms). A loader pickles as path and ids, opens its
files lazily in whichever process or thread uses it, and so works in torch ``DataLoader`` workers.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data import codec, tables
from scenarionet_data.catalog.database import Database
from scenarionet_data.catalog.lake import Lake
from scenarionet_data.codec import LoadedRows
from scenarionet_data.scenario import MapFeatures, ScenarioDescription, Tracks
from scenarionet_data.shared_maps import SharedMaps
from scenarionet_data.store import snapshot as snapshots
from scenarionet_data.store.file_errors import reading
from scenarionet_data.store.row_group_readers import Address, RowGroupReader, open_reader

Row = Mapping[str, Any]
"""What a database knows of a scenario: the columns that describe it, and where its rows of the tables are."""

_TABLES = ("tracks", "lights", "maps")
_FETCHED_TOGETHER = 64
"""Scenarios whose row groups are asked of an object store at once, so that only the first waits for it."""


class ScenarioLoader(Sequence[ScenarioDescription]):
    """The scenarios of a database (or of a list of ids, or of the whole lake) as a sequence.

    Args:
        lake: The lake, its folder or its URL.
        scenarios: A database or its name, or scenario ids; everything, ordered by id, for None.

    Raises:
        ScenarioNotFound: A scenario is not in the lake.

    Example:
        loader = ScenarioLoader("lake", "busy")
        scenario = loader[0]
        scenario.tracks.position  # (N, T, 3) float32
    """

    def __init__(self, lake: Lake | str | Path, scenarios: Database | str | Iterable[str] | None = None) -> None:
        opened = lake if isinstance(lake, Lake) else Lake(lake)
        holder, rows = opened.resolve(scenarios)
        self._files = opened.files
        self._snapshot = holder.snapshot
        self._rows = rows.combine_chunks()
        self._shared_maps = SharedMaps(self._files, holder.shared_maps())
        self.scenario_ids: list[str] = self._rows["scenario_id"].to_pylist()
        self._local = threading.local()

    def __getstate__(self) -> dict[str, Any]:
        return {"files": self._files, "snapshot": self._snapshot, "rows": self._rows, "maps": self._shared_maps}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._files, self._snapshot = state["files"], state["snapshot"]
        self._rows, self._shared_maps = state["rows"], state["maps"]
        self.scenario_ids = self._rows["scenario_id"].to_pylist()
        self._local = threading.local()

    def __len__(self) -> int:
        return len(self.scenario_ids)

    def __iter__(self) -> Iterator[ScenarioDescription]:
        return self._loaded(range(len(self)), _TABLES, self._scenario)

    def __getitem__(self, index: Any) -> Any:
        """Scenario ``index``; a list of scenarios for a slice."""
        if isinstance(index, slice):
            return self.batch(range(len(self))[index])
        (row,) = self._rows_at([index])
        self._fetch_one(row, _TABLES)
        return self._scenario(row)

    def __getitems__(self, indices: Sequence[int]) -> list[ScenarioDescription]:
        """:meth:`batch`, by the name under which torch's ``DataLoader`` asks for it."""
        return self.batch(indices)

    def tracks(self, index: int) -> Tracks:
        """The objects of scenario ``index`` alone: the quickest way to trajectories."""
        (row,) = self._rows_at([index])
        self._fetch_one(row, ("tracks",))
        return self._tracks(row)

    def batch(self, indices: Sequence[int]) -> list[ScenarioDescription]:
        """Scenarios at ``indices``, read in the order they lie on disk and returned in the order asked for."""
        return self._in_disk_order(indices, _TABLES, self._scenario)

    def batch_tracks(self, indices: Sequence[int]) -> list[Tracks]:
        """Like :meth:`batch`, the objects alone."""
        return self._in_disk_order(indices, ("tracks",), self._tracks)

    def _in_disk_order(self, indices: Sequence[int], wanted: Sequence[str], load: Callable[[Row], Any]) -> list[Any]:
        rows = self._rows_at(indices)
        order = sorted(range(len(rows)), key=lambda k: (rows[k]["tracks_file"], rows[k]["tracks_row_group"]))
        loaded: list[Any] = [None] * len(rows)
        for place, found in zip(order, self._loaded([indices[k] for k in order], wanted, load), strict=True):
            loaded[place] = found
        return loaded

    def _loaded(self, indices: Sequence[int], wanted: Sequence[str], load: Callable[[Row], Any]) -> Iterator[Any]:
        """What ``load`` makes of each, with the row groups of the next ones fetched together."""
        for start in range(0, len(indices), _FETCHED_TOGETHER):
            coming = self._rows_at(indices[start : start + 2 * _FETCHED_TOGETHER])  # the next come while these are read
            self._fetch(address for row in coming for address in _addresses(row, wanted))
            yield from map(load, coming[:_FETCHED_TOGETHER])

    def _rows_at(self, indices: Sequence[int]) -> list[Row]:
        """What is known of scenarios before they are read."""
        outside = [index for index in indices if not -len(self) <= index < len(self)]
        if outside:
            raise IndexError(f"scenario {outside[0]} of {len(self)}")
        places = np.array([index % len(self) for index in indices], np.int64)
        rows = self._rows.slice(places[0], 1) if len(places) == 1 else self._rows.take(places)  # take: 90 us slower
        found: list[Row] = rows.to_pylist()
        return found

    def _scenario(self, row: Row) -> ScenarioDescription:
        """A scenario whose row groups are at hand."""
        rows = codec.Encoded(row, self._read("tracks", row), self._read("lights", row), self._read("maps", row))
        return codec.decode(rows, self._crop(row))

    def _tracks(self, row: Row) -> Tracks:
        """The objects of a scenario whose row groups are at hand."""
        return codec.decode_tracks(self._read("tracks", row), row["num_timesteps"])

    def _read(self, table: str, row: Row) -> LoadedRows | None:
        """A scenario's rows of one table; None where it has none."""
        name = row[f"{table}_file"]
        if name is None:
            return None
        address = (table, name, row[f"{table}_row_group"])
        group = self._group(address)
        if group.num_rows != row[f"{table}_num_rows"]:
            self._kept[table] = address, group  # of a compacted lake: those who share it are often next
            group = group.slice(row[f"{table}_first_row"], row[f"{table}_num_rows"])
        return group

    def _group(self, address: Address) -> LoadedRows:
        """A row group."""
        table, name, _ = address
        kept = self._kept.get(table)
        if kept and kept[0] == address:
            return kept[1]
        with snapshots.reading_from(self._files, self._snapshot), reading(self._files.url(name)):
            return self._reader.read(address)

    def _fetch(self, addresses: Iterable[Address]) -> None:
        """Have row groups at hand that are read next."""
        with snapshots.reading_from(self._files, self._snapshot):
            self._reader.fetch(addresses)

    def _fetch_one(self, row: Row, wanted: Sequence[str]) -> None:
        """Have a scenario's row groups at hand, but for those that are kept."""
        kept = {address for address, _ in self._kept.values()}
        self._fetch(address for address in _addresses(row, wanted) if address not in kept)

    def _crop(self, row: Row) -> MapFeatures | None:
        """A scenario's window on a shared map; None where it has a map of its own, or none."""
        if row["map_crop"] is None:
            return None
        with snapshots.reading_from(self._files, self._snapshot):
            shared = self._shared_maps.get(row["dataset"], row["version"], row["map_id"])
        return shared.crop(tuple(row["map_crop"]), np.array([row["origin_x"], row["origin_y"], row["origin_z"]]))

    @property
    def _kept(self) -> dict[str, tuple[Address, LoadedRows]]:
        """This thread's last row group of each table that scenarios share."""
        if not hasattr(self._local, "kept"):
            self._local.kept = {}
        kept: dict[str, tuple[Address, LoadedRows]] = self._local.kept
        return kept

    @property
    def _reader(self) -> RowGroupReader:
        """This thread's."""
        if not hasattr(self._local, "reader"):
            self._local.reader = open_reader(self._files, _NEEDED)
        reader: RowGroupReader = self._local.reader
        return reader


def _addresses(row: Row, wanted: Sequence[str]) -> Iterator[Address]:
    """Where a scenario's rows of some tables are."""
    return ((table, row[f"{table}_file"], row[f"{table}_row_group"]) for table in wanted if row[f"{table}_file"])


_UNUSED = {"scenario_id", "map_id", "track_index", "feature_index", "tile"} | {
    f"{end}_{axis}" for end in ("min", "max", "origin") for axis in "xyz"
}
_NEEDED = {
    table: [column.name for column in tables.load(table).columns if column.name not in _UNUSED]
    for table in ("tracks", "lights", "maps")
}
