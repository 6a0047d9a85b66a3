"""Read the boxes and light states of a nuPlan log as compact arrays, sorted by sweep.

The tables have no index by sweep and no fixed order, so each is read in one pass and tokens are replaced by row
numbers. A window is then a slice, even if windows overlap, at 48 bytes per box of the requested sweeps. Rows are read
as Arrow batches through ADBC's SQLite driver, twice as fast as Python's, and tokens are looked up with Arrow, ten times
as fast as joins in SQLite.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Array, Bool, Int64
from scenarionet_data.converters.nuplan.log import NuPlanLog, as_text, unreadable, uri
from scenarionet_data.converters.nuplan.types import LIGHTS
from scenarionet_data.errors import needing
from scenarionet_data.ingest.defects import Defect

BOX = np.dtype([("sweep", "i4"), ("track", "i4"), ("position", "f8", 2), ("state", "f4", 6)])
"""A box: sweep, row of its track or -1, x, y [m], heading [rad], length, width, height [m], vx, vy [m/s]; NaN if
missing."""
LIGHT = np.dtype([("sweep", "i4"), ("connector", "i8"), ("state", "i2")])
"""A light's state: sweep, lane connector and code of ``LightState``; -1 if missing."""

_CHUNK = 65536
"""Rows per batch."""


def _number(column: str) -> str:
    """SQL of a column that is NULL for a text or blob in place of a number."""
    return f"iif(typeof({column}) IN ('real', 'integer'), {column}, NULL)"


def _blob(column: str) -> str:
    """SQL of a column of blobs in which anything else is a blob, too."""
    return f"CAST(ifnull({column}, x'') AS BLOB)"


# Rows that refer to no sweep are kept, to be counted. The first row of a query determines the types of its columns:
# the driver infers them from the first rows, which may all be NULL.
_UNWANTED = "CREATE TEMP TABLE unwanted (token BLOB PRIMARY KEY) WITHOUT ROWID"
_IS_WANTED = "lidar_pc_token IS NULL OR lidar_pc_token NOT IN (SELECT token FROM temp.unwanted)"
_BOXES = f"""
    SELECT x'', x'', 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0 UNION ALL
    SELECT {{tokens}}, {{numbers}} FROM lidar_box WHERE {_IS_WANTED}
"""
_BOX_TOKENS = ("lidar_pc_token", "track_token")
_BOX_NUMBERS = ("x", "y", "yaw", "length", "width", "height", "vx", "vy")
_LIGHTS = f"""
    SELECT x'', -1, -1 UNION ALL
    SELECT {_blob("lidar_pc_token")}, {_number("lane_connector_id")},
        CASE status {" ".join(f"WHEN '{word}' THEN {int(state)}" for word, state in LIGHTS.items())} END
    FROM traffic_light_status WHERE {_IS_WANTED}
"""
_TRACKS = f"""
    SELECT x'', x'' UNION ALL
    SELECT {_blob("t.token")}, CAST(c.name AS BLOB) FROM track t LEFT JOIN category c ON c.token = t.category_token
"""


@dataclass(frozen=True, eq=False)
class SqliteRows:
    """Rows sorted by sweep.

    Attributes:
        values: (R,) of ``BOX`` or ``LIGHT``.
        starts: (S + 1,) int64 first row of each sweep.
        lost: Sweep of the row before each dropped row that refers to no sweep of the log, sorted.
    """

    values: Array
    starts: Int64
    lost: Int64

    def num_lost(self, sweeps: Int64) -> int:
        """Number of dropped rows among those of increasing sweeps."""
        return int(np.diff(np.searchsorted(self.lost, [sweeps[0], sweeps[-1] + 1]))[0])

    def of(self, sweeps: Int64) -> tuple[Array, Int64]:
        """Rows of increasing sweeps, and the position of each row's sweep among them."""
        first, last = int(sweeps[0]), int(sweeps[-1])
        part = self.values[self.starts[first] : self.starts[last + 1]]
        place = np.full(last - first + 1, -1)
        place[sweeps - first] = np.arange(len(sweeps))
        found = place[part["sweep"] - first]
        return part[found >= 0], found[found >= 0]


@dataclass(frozen=True, eq=False)
class NuPlanContent:
    """Boxes and light states of the requested sweeps of a log.

    Attributes:
        boxes: Rows of ``BOX``.
        lights: Rows of ``LIGHT``.
        tracks: Tokens of 16 hex digits.
        categories: The tracks' categories; None if missing.
    """

    boxes: SqliteRows
    lights: SqliteRows
    tracks: list[str]
    categories: list[str | None]

    def lost_rows(self, file: str, sweeps: Int64) -> Iterator[Defect]:
        """Rows among those of increasing sweeps that belong to no sweep; ``file`` is the log's, for reports."""
        for table, rows, name in (("tracks", self.boxes, "lidar_box"), ("lights", self.lights, "traffic_light_status")):
            count = rows.num_lost(sweeps)
            if count:
                reason = "expected a sweep of lidar_pc with a time, found none"
                yield Defect(table, file, name, f"{name}.lidar_pc_token", "dropped", reason, count)


def read_content(path: Path, log: NuPlanLog, is_wanted: Bool) -> NuPlanContent:
    """Read boxes and light states of a log.

    Args:
        path: The log's file.
        log: The other tables of the log.
        is_wanted: (S,) whether to read a sweep.

    Raises:
        CorruptSource: The file is damaged, or lacks a table or column.
        MissingDependency: The driver is not installed.
    """
    sweeps = pa.array([bytes.fromhex(token) for token in log.tokens], pa.binary())
    with _cursor(path) as cursor:
        cursor.execute(_TRACKS)
        tracks, categories = (column.combine_chunks()[1:] for column in cursor.fetch_arrow_table().columns)
        cursor.execute(_UNWANTED)
        unwanted = sweeps.filter(pa.array(~is_wanted))
        cursor.executemany("INSERT INTO temp.unwanted VALUES (?)", pa.record_batch({"token": unwanted}))
        return NuPlanContent(
            boxes=_in_order(_read_boxes(cursor, sweeps, tracks), len(is_wanted)),
            lights=_in_order(_read(cursor, _LIGHTS, LIGHT, sweeps), len(is_wanted)),
            tracks=[token.hex() for token in tracks.to_pylist()],
            categories=[as_text(word) if word else None for word in categories.to_pylist()],
        )


@contextmanager
def _cursor(path: Path) -> Iterator[Any]:
    with needing("nuPlan logs need ADBC", "nuplan"):
        from adbc_driver_sqlite import dbapi
    try:
        with dbapi.connect(uri(path)) as connection, connection.cursor() as cursor:
            cursor.adbc_statement.set_options(**{"adbc.sqlite.query.batch_rows": _CHUNK})
            yield cursor
    except (dbapi.Error, OSError, pa.ArrowException, TypeError) as error:
        raise unreadable(path, error) from error


def _read_boxes(cursor: Any, sweeps: pa.Array, tracks: pa.Array) -> Array:
    """Read boxes; check the type of every cell only if a number is replaced by a text or blob."""
    try:
        query = _BOXES.format(tokens=", ".join(_BOX_TOKENS), numbers=", ".join(_BOX_NUMBERS))
        return _read(cursor, query, BOX, sweeps, tracks)
    except (OSError, TypeError, pa.ArrowException):  # the driver's error for a later batch, ours for the first
        query = _BOXES.format(tokens=", ".join(map(_blob, _BOX_TOKENS)), numbers=", ".join(map(_number, _BOX_NUMBERS)))
        return _read(cursor, query, BOX, sweeps, tracks)


def _read(cursor: Any, query: str, kind: np.dtype[Any], *known: pa.Array) -> Array:
    """Read the rows of a query as an array of ``kind``, without the query's first row.

    The first columns are tokens, which are replaced by positions among the ``known`` ones, or -1.
    """
    cursor.execute(query)
    return np.concatenate([_filled(batch, kind, known) for batch in cursor.fetch_record_batch()])[1:]


def _filled(batch: pa.RecordBatch, kind: np.dtype[Any], known: Sequence[pa.Array]) -> Array:
    """Convert a batch to ``kind``, field by field; NULL becomes -1 in integer fields, else NaN."""
    rows, column = np.zeros(batch.num_rows, kind), 0
    for name in kind.names or ():
        field = rows[name].reshape(len(rows), -1)
        for part in range(field.shape[1]):
            cells = batch.column(column)
            if column < len(known):
                cells = pc.index_in(cells, value_set=known[column])
            if not (pa.types.is_floating(cells.type) or pa.types.is_integer(cells.type)):
                raise TypeError(f"expected numbers in {kind.names}, found {cells.type}")
            values = cells.to_numpy(zero_copy_only=False)
            field[:, part] = values if field.dtype.kind == "f" else np.nan_to_num(values, nan=-1.0)
            column += 1
    return rows


def _in_order(rows: Array, num_sweeps: int) -> SqliteRows:
    is_known = rows["sweep"] >= 0
    known, lost = rows, np.zeros(0, np.int64)
    if not is_known.all():
        before = np.maximum.accumulate(np.where(is_known, np.arange(len(rows)), -1))
        lost = np.sort(rows["sweep"][np.where(before < 0, np.argmax(is_known), before)][~is_known].astype(np.int64))
        known = rows[is_known]
    sweep = np.ascontiguousarray(known["sweep"])
    if (np.diff(sweep) < 0).any():
        order = np.argsort(sweep, kind="stable")
        known, sweep = known[order], sweep[order]
    starts = np.searchsorted(sweep, np.arange(num_sweeps + 1))
    return SqliteRows(known, starts, lost)
