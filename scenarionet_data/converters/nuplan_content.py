"""What a nuPlan log records of the world: boxes and light states, as compact arrays in order of sweeps.

The tables have no index by sweep and may lie in any order, so each is read in one pass, joined to integers by SQL.
A window is then a slice, however many windows overlap, and the memory is 48 bytes a box of the wanted sweeps.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.converters.nuplan_log import Log, floats
from scenarionet_data.converters.nuplan_types import LIGHTS

Array = npt.NDArray[Any]
Bool = npt.NDArray[np.bool_]

BOX = np.dtype([("sweep", "i4"), ("track", "i4"), ("position", "f8", 2), ("state", "f4", 6)])
"""A box: its sweep, row of its track or -1, x, y [m], and heading [rad], length, width, height [m], vx, vy [m/s];
NaN for what the log lacks."""
LIGHT = np.dtype([("sweep", "i4"), ("connector", "i8"), ("state", "i2")])
"""A light's state: its sweep, lane connector and code of ``LightState``; -1 for what the log lacks."""

_CHUNK = 2000
"""Rows fetched at a time: more are slower, as they leave the processor's cache."""

# Unwanted sweeps have the number -1; what refers to no sweep at all is kept, to be counted.
_SWEEP_TABLE = "CREATE TEMP TABLE sweep (token BLOB PRIMARY KEY, number INTEGER) WITHOUT ROWID"
_TRACK_TABLE = "CREATE TEMP TABLE numbered (token BLOB PRIMARY KEY, number INTEGER) WITHOUT ROWID"
_BOXES = """
    SELECT s.number, t.number, b.x, b.y, b.yaw, b.length, b.width, b.height, b.vx, b.vy
    FROM lidar_box b LEFT JOIN temp.sweep s ON s.token = b.lidar_pc_token
        LEFT JOIN temp.numbered t ON t.token = b.track_token
    WHERE s.number IS NULL OR s.number >= 0
"""
_LIGHTS = f"""
    SELECT s.number, l.lane_connector_id,
        CASE l.status {" ".join(f"WHEN '{word}' THEN {int(state)}" for word, state in LIGHTS.items())} END
    FROM traffic_light_status l LEFT JOIN temp.sweep s ON s.token = l.lidar_pc_token
    WHERE s.number IS NULL OR s.number >= 0
"""
_TRACKS = "SELECT t.token, c.name FROM track t LEFT JOIN category c ON c.token = t.category_token"


@dataclass(frozen=True, eq=False)
class Content:
    """Boxes and light states of the wanted sweeps of a log, in order of sweeps.

    Attributes:
        boxes: (R,) of ``BOX``.
        lights: (K,) of ``LIGHT``.
        tracks: Tokens of 16 hex digits.
        categories: The tracks' categories; None where the log lacks it.
        num_lost: Boxes and light states that refer to no sweep of the log.
    """

    boxes: Array
    lights: Array
    tracks: list[str]
    categories: list[str | None]
    num_lost: int


def read_content(database: sqlite3.Connection, log: Log, is_wanted: Bool) -> Content:
    """Boxes and light states of a log.

    Args:
        database: The log's file.
        log: The rest of it.
        is_wanted: (S,) which sweeps' content to read.
    """
    database.execute(_SWEEP_TABLE)
    numbers = np.where(is_wanted, np.arange(len(is_wanted)), -1).tolist()
    sweeps = zip(map(bytes.fromhex, log.tokens), numbers, strict=True)
    database.executemany("INSERT INTO temp.sweep VALUES (?, ?)", sweeps)
    tracks = database.execute(_TRACKS).fetchall()
    database.execute(_TRACK_TABLE)
    database.executemany("INSERT INTO temp.numbered VALUES (?, ?)", ((t, n) for n, (t, _) in enumerate(tracks)))
    boxes, lost_boxes = _in_order(_read(database, _BOXES, BOX))
    lights, lost_lights = _in_order(_read(database, _LIGHTS, LIGHT))
    return Content(
        boxes=boxes,
        lights=lights,
        tracks=[token.hex() for token, _ in tracks],
        categories=[category for _, category in tracks],
        num_lost=lost_boxes + lost_lights,
    )


def _read(database: sqlite3.Connection, query: str, kind: np.dtype[Any]) -> Array:
    return np.concatenate([np.zeros(0, kind), *(_rows(rows, kind) for rows in _chunks(database, query))])


def _chunks(database: sqlite3.Connection, query: str) -> Iterator[Sequence[Any]]:
    cursor = database.execute(query)
    while rows := cursor.fetchmany(_CHUNK):
        yield rows


def _rows(rows: Sequence[Any], kind: np.dtype[Any]) -> Array:
    """Rows of a query as an array of ``kind``: the query's columns fill its fields in order."""
    table, filled, column = floats(rows), np.zeros(len(rows), kind), 0
    for name in kind.names or ():
        field = filled[name]
        width = field.shape[1] if field.ndim == 2 else 1
        values = table[:, column : column + width].reshape(field.shape)
        filled[name] = values if field.dtype.kind == "f" else np.nan_to_num(values, nan=-1.0)
        column += width
    return filled


def _in_order(rows: Array) -> tuple[Array, int]:
    """The rows of known sweeps, in order of sweeps, and how many belong to none."""
    known = rows[rows["sweep"] >= 0]
    lost = len(rows) - len(known)
    is_sorted = bool((np.diff(known["sweep"]) >= 0).all())
    return (known if is_sorted else known[np.argsort(known["sweep"], kind="stable")]), lost
