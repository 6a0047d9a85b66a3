"""Scenarios out of the lake, one or a batch at a time: addresses are resolved once, files are read by row group.

DuckDB finds scenarios; loading one through it as well would take 44 ms instead of 1.6. A loader pickles as path and
ids, opens its files lazily in whichever process or thread uses it, and so works in torch ``DataLoader`` workers.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import accumulate
from typing import Any, TypeAlias

import numpy as np

from scenarionet_data import codec
from scenarionet_data.codec import Rows
from scenarionet_data.databases.record import DatabaseRecord
from scenarionet_data.errors import LakeError
from scenarionet_data.query.lake_view import LakeLike, open_view
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription, Tracks
from scenarionet_data.schema import tables
from scenarionet_data.storage.read.row_group_readers import Address, RowGroupReader, open_reader
from scenarionet_data.storage.read.row_table import ArrowRows
from scenarionet_data.storage.read.shared_maps import SharedMaps
from scenarionet_data.storage.snapshots import snapshot as snapshots

Row = Mapping[str, Any]
"""What a database knows of a scenario: the columns that describe it, and where its rows of the tables are."""

Load: TypeAlias = Callable[[Sequence[Row]], Sequence[Any]]
"""Makes of what is known of scenarios what is wanted of each."""

_TABLES = ("tracks", "lights", "maps")

_DECODED_TOGETHER = 16
"""Scenarios whose columns are decoded in one go: what does not depend on their size costs a sixteenth."""

_FETCHED_TOGETHER = 64
"""Scenarios whose row groups are asked of an object store at once, so that only the first waits for it."""


class ScenarioLoader(Sequence[ScenarioDescription]):
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
        view, rows = open_view(lake).resolve(database)
        self._files = view.files
        self._snapshot = view.snapshot
        self._rows = ArrowRows(rows)
        self._shared_maps = SharedMaps(self._files, view.shared_maps())
        self.scenario_ids: list[str] = self._rows.table["scenario_id"].to_pylist()
        self._local = threading.local()

    def __getstate__(self) -> dict[str, Any]:
        return {"files": self._files, "snapshot": self._snapshot, "rows": self._rows, "maps": self._shared_maps}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._files, self._snapshot = state["files"], state["snapshot"]
        self._rows, self._shared_maps = state["rows"], state["maps"]
        self.scenario_ids = self._rows.table["scenario_id"].to_pylist()
        self._local = threading.local()

    def __repr__(self) -> str:
        return f"ScenarioLoader({str(self._files.root)!r}, snapshot={self._snapshot.number}, {len(self):,} scenarios)"

    def __len__(self) -> int:
        return len(self.scenario_ids)

    def __iter__(self) -> Iterator[ScenarioDescription]:
        return self._loaded(range(len(self)), _TABLES, self._scenarios)

    def __getitem__(self, index: Any) -> Any:
        """Scenario ``index``; a list of scenarios for a slice."""
        if isinstance(index, slice):
            return self.batch(range(len(self))[index])
        return next(self._loaded([index], _TABLES, self._scenarios))

    def __getitems__(self, indices: Sequence[int]) -> list[ScenarioDescription]:
        """:meth:`batch`, by the name under which torch's ``DataLoader`` asks for it."""
        return self.batch(indices)

    def tracks(self, index: int) -> Tracks:
        """The objects of scenario ``index`` alone: the quickest way to trajectories."""
        tracks: Tracks = next(self._loaded([index], ("tracks",), self._tracks))
        return tracks

    def batch(self, indices: Sequence[int]) -> list[ScenarioDescription]:
        """Scenarios at ``indices``, read in the order they lie on disk and returned in the order asked for."""
        return self._in_disk_order(indices, _TABLES, self._scenarios)

    def batch_tracks(self, indices: Sequence[int]) -> list[Tracks]:
        """Like :meth:`batch`, the objects alone."""
        return self._in_disk_order(indices, ("tracks",), self._tracks)

    def _in_disk_order(self, indices: Sequence[int], wanted: Sequence[str], load: Load) -> list[Any]:
        rows = self._rows_at(indices)
        order = sorted(range(len(rows)), key=lambda k: _place(rows[k]))
        loaded: list[Any] = [None] * len(rows)
        for place, found in zip(order, self._loaded([indices[k] for k in order], wanted, load), strict=True):
            loaded[place] = found
        return loaded

    def _loaded(self, indices: Sequence[int], wanted: Sequence[str], load: Load) -> Iterator[Any]:
        """What ``load`` makes of each, with the row groups of the next ones fetched together."""
        for start in range(0, len(indices), _FETCHED_TOGETHER):
            coming = self._rows_at(indices[start : start + 2 * _FETCHED_TOGETHER])  # the next come while these are read
            kept = {address for addresses, _ in self._kept.values() for address in addresses}
            with snapshots.reading_from(self._files, self._snapshot):
                self._reader.fetch(
                    address for row in coming for address in _addresses(row, wanted) if address not in kept
                )
            for rows in _portions(coming[:_FETCHED_TOGETHER]):
                yield from load(rows)

    def _rows_at(self, indices: Sequence[int]) -> list[Row]:
        """What is known of scenarios before they are read."""
        outside = [index for index in indices if not -len(self) <= index < len(self)]
        if outside:
            raise IndexError(f"scenario {outside[0]} of {len(self)}")
        return [self._rows[index % len(self)] for index in indices]

    def _scenarios(self, known: Sequence[Row]) -> list[ScenarioDescription]:
        """Scenarios whose row groups are at hand."""
        tracks, lights, maps = self._track_rows(known), self._rows_of("lights", known), self._rows_of("maps", known)
        return codec.decode_many(known, tracks, lights, maps, [self._crop(row) for row in known])

    def _tracks(self, known: Sequence[Row]) -> list[Tracks]:
        """The objects of scenarios whose row groups are at hand."""
        return codec.decode_tracks(self._track_rows(known), [row["num_timesteps"] for row in known])

    def _track_rows(self, known: Sequence[Row]) -> Rows:
        rows = self._rows_of("tracks", known)
        if rows is None:
            name = known[0]["scenario_id"]
            raise LakeError(f"{name} has no tracks; `scenarionet check` names every such scenario: convert them again")
        return rows

    def _rows_of(self, table: str, known: Sequence[Row]) -> Rows | None:
        """The scenarios' rows of one table; None where there are none."""
        addresses = list(dict.fromkeys(address for row in known for address in _addresses(row, [table])))
        if not addresses:
            return None
        read, rows = self._read(table, addresses)
        bounds = [0, *accumulate(row[f"{table}_num_rows"] or 0 for row in known)]
        first = dict(zip(read, rows.bounds, strict=False))
        spans = [
            (first[address] + row[f"{table}_first_row"], row[f"{table}_num_rows"])
            for row in known
            for address in _addresses(row, [table])
        ]
        if rows.bounds == [*(start for start, _ in spans), bounds[-1]]:
            return Rows(rows.columns, bounds)
        self._kept[table] = read, rows  # of a compacted lake: those who share it are often next
        return Rows(rows.columns.pick(spans), bounds)

    def _read(self, table: str, addresses: list[Address]) -> tuple[list[Address], Rows]:
        """Row groups of one table, these and perhaps others."""
        kept = self._kept.get(table)
        if kept and set(addresses) <= set(kept[0]):
            return kept
        with snapshots.reading_from(self._files, self._snapshot):
            return addresses, self._reader.read(addresses)

    def _crop(self, row: Row) -> MapFeatures | None:
        """A scenario's window on a shared map; None where it has a map of its own, or none."""
        if row["map_crop"] is None:
            return None
        with snapshots.reading_from(self._files, self._snapshot):
            shared = self._shared_maps.get(row["dataset"], row["version"], row["map_id"])
        return shared.crop(tuple(row["map_crop"]), np.array([row["origin_x"], row["origin_y"], row["origin_z"]]))

    @property
    def _kept(self) -> dict[str, tuple[list[Address], Rows]]:
        """This thread's last row groups of each table that scenarios share."""
        if not hasattr(self._local, "kept"):
            self._local.kept = {}
        kept: dict[str, tuple[list[Address], Rows]] = self._local.kept
        return kept

    @property
    def _reader(self) -> RowGroupReader:
        """This thread's."""
        if not hasattr(self._local, "reader"):
            self._local.reader = open_reader(self._files, _NEEDED)
        reader: RowGroupReader = self._local.reader
        return reader


def _portions(rows: Sequence[Row]) -> Iterator[Sequence[Row]]:
    """Scenarios that are decoded together; those that share a row group are not torn apart."""
    start = 0
    for end in range(1, len(rows) + 1):
        is_last, is_enough = end == len(rows), end - start >= _DECODED_TOGETHER
        if is_last or (is_enough and _place(rows[end]) != _place(rows[end - 1])):
            yield rows[start:end]
            start = end


def _place(row: Row) -> tuple[str, int]:
    """Where a scenario's tracks lie; what is decoded in this order is read in this order."""
    return row["tracks_file"], row["tracks_row_group"]


def _addresses(row: Row, wanted: Sequence[str]) -> Iterator[Address]:
    """Where a scenario's rows of some tables are."""
    return ((table, row[f"{table}_file"], row[f"{table}_row_group"]) for table in wanted if row[f"{table}_file"])


_UNUSED = {"scenario_id", "map_id", "track_index", "feature_index", "tile"} | {
    f"{end}_{axis}" for end in ("min", "max", "origin") for axis in "xyz"
}
_NEEDED = {
    table: [column.name for column in tables.load(table).columns if column.name not in _UNUSED] for table in _TABLES
}
