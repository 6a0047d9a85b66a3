"""Read INTERACTION's track files: CSV with one row per road user and frame, in the frame of the place's map, metres.

    track_id,frame_id,timestamp_ms,agent_type,x,y,vx,vy,psi_rad,length,width
    1,1,100,car,1019.991,1003.0,-3.167,-2.734,-2.429,5.62,2.2

Files of pedestrians and cyclists lack the last three columns.
"""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64, Object
from scenarionet_data.building.plausible import find_bad_rows, find_repeated_rows
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.scenario.vocabulary import ObjectType

FRAME_MS = 100
"""Time between frames [ms]."""
TYPES = {
    "car": ObjectType.VEHICLE,
    "truck": ObjectType.VEHICLE,
    "bus": ObjectType.VEHICLE,
    "truck/bus": ObjectType.VEHICLE,
    "motorcycle": ObjectType.VEHICLE,
    "bicycle": ObjectType.CYCLIST,
    "motorcycle/bicycle": ObjectType.CYCLIST,
    "pedestrian": ObjectType.PEDESTRIAN,
    "pedestrian/bicycle": ObjectType.PEDESTRIAN,
}
HEIGHT = 1.6
"""Height of every road user [m]; none is recorded."""
PERSON = (0.7, 0.7)
"""Length and width [m] where none is recorded: of pedestrians and cyclists."""

_NUMBERS = ("timestamp_ms", "x", "y", "vx", "vy", "psi_rad", "length", "width")
_OPTIONAL = ("psi_rad", "length", "width")
_MOVING = 0.2
"""Speed [m/s] below which the velocity of a pedestrian says nothing of the heading."""


@dataclass(frozen=True, eq=False)
class TrackRows:
    """R rows, sorted by track and frame.

    Attributes:
        line: (R,) line of the file, from 1.
        track: (R,) number of the track in ``ids``.
        frame: (R,) number of 100 ms from time 0.
        position, velocity: (R, 2) [m], [m/s].
        heading: (R,) [rad].
        size: (R, 3) [m].
        ids, words: (N,) id of each track, and its type as the source names it.
        has_boxes: (N,) whether headings, lengths and widths are recorded.
    """

    line: Int64
    track: Int64
    frame: Int64
    position: Float64
    velocity: Float64
    heading: Float64
    size: Float64
    ids: Object
    words: Object
    has_boxes: Bool

    def take(self, mask: Bool) -> TrackRows:
        """TrackRows where ``mask`` (R,) is True, with the tracks that they belong to."""
        known, track = np.unique(self.track[mask], return_inverse=True)
        return TrackRows(
            self.line[mask],
            track,
            self.frame[mask],
            self.position[mask],
            self.velocity[mask],
            self.heading[mask],
            self.size[mask],
            self.ids[known],
            self.words[known],
            self.has_boxes[known],
        )


def read_rows(path: Path, file: str, defects: Defects) -> TrackRows:
    """Read a file; rows that cannot be used are dropped.

    Args:
        path: The file.
        file: Its name relative to the raw folder, for ``defects``.
        defects: Collects the rows that are dropped.

    Raises:
        CorruptSource: Missing, without the columns, or without a usable row.
    """
    table = _read_table(path, file, defects)
    numbers = {name: _floats(table[name]) for name in _NUMBERS if name in table.column_names}
    has_boxes = all(name in numbers for name in _OPTIONAL)
    words, ids = (table[name].combine_chunks().dictionary_encode() for name in ("agent_type", "track_id"))
    position, velocity = (np.column_stack([numbers[name] for name in pair]) for pair in (("x", "y"), ("vx", "vy")))
    count = len(position)
    heading = numbers["psi_rad"] if has_boxes else _courses(velocity)
    sides = np.column_stack([numbers["length"], numbers["width"]]) if has_boxes else np.tile(PERSON, (count, 1))
    size = np.column_stack([sides, np.full(count, HEIGHT)])
    track = ids.indices.fill_null(len(ids.dictionary)).to_numpy().astype(np.int64)
    finite = np.isfinite(numbers["timestamp_ms"]) & (np.abs(numbers["timestamp_ms"]) < 1e12)
    milliseconds = np.where(finite, numbers["timestamp_ms"], 0.0)
    frame = np.round(milliseconds / FRAME_MS).astype(np.int64)
    middle = np.nanmedian(position, axis=0) if np.isfinite(position).all(axis=1).any() else np.zeros(2)
    is_timed = finite & (milliseconds == frame * FRAME_MS) & (track < len(ids.dictionary))
    line = np.arange(2, count + 2)
    keep = is_timed
    reason = f"expected a track and a multiple of {FRAME_MS} ms, found another"
    defects.drop("tracks", file, line[~is_timed].tolist(), "timestamp_ms", reason)
    bad = find_bad_rows(position, heading, velocity, size, middle)
    repeated = find_repeated_rows(track, np.where(is_timed, frame, -line))
    for fault in [*bad, *([repeated] if repeated else [])]:
        new = fault.mask & keep
        defects.drop("tracks", file, line[new].tolist(), fault.field, fault.reason)
        keep = keep & ~fault.mask
    if not keep.any():
        raise CorruptSource(f"{path}: expected rows of road users, found none that can be used; download it again")
    order = np.flatnonzero(keep)
    order = order[np.lexsort((frame[order], track[order]))]
    known, first, renumbered = np.unique(track[order], return_index=True, return_inverse=True)
    kinds = words.indices.fill_null(len(words.dictionary)).to_numpy()[order][first]
    names = np.array([*words.dictionary.to_pylist(), ""], object)
    return TrackRows(
        line[order],
        renumbered,
        frame[order],
        position[order],
        velocity[order],
        heading[order],
        size[order],
        np.array(ids.dictionary.to_pylist(), object)[known],
        names[kinds],
        np.full(len(known), has_boxes),
    )


def joined(first: TrackRows, second: TrackRows) -> TrackRows:
    """The rows of two files of one recording; ids of the second that the first has as well get the prefix ``P``."""
    taken = set(first.ids)
    ids = np.array([f"P{name}" if name in taken else name for name in second.ids], object)
    return TrackRows(
        np.concatenate([first.line, second.line]),
        np.concatenate([first.track, second.track + len(first.ids)]),
        np.concatenate([first.frame, second.frame]),
        np.concatenate([first.position, second.position]),
        np.concatenate([first.velocity, second.velocity]),
        np.concatenate([first.heading, second.heading]),
        np.concatenate([first.size, second.size]),
        np.concatenate([first.ids, ids]),
        np.concatenate([first.words, second.words]),
        np.concatenate([first.has_boxes, second.has_boxes]),
    )


def _read_table(path: Path, file: str, defects: Defects) -> pa.Table:
    """The columns of a file, as text where a cell is no number; lines of another number of cells are dropped."""
    lines: list[int] = []

    def skip(row: pa.csv.InvalidRow) -> str:
        lines.append(row.number or 0)
        return "skip"

    try:
        data = path.read_bytes().decode("utf-8", "replace").encode()
        names = data.split(b"\n", 1)[0].decode("utf-8", "replace").strip().split(",")
        kinds = {"track_id": pa.string(), "agent_type": pa.string()}
        wanted = [name for name in (*kinds, *_NUMBERS) if name in names]
        table = pa.csv.read_csv(
            BytesIO(data),
            pa.csv.ReadOptions(use_threads=False, block_size=max(len(data), 1)),
            pa.csv.ParseOptions(invalid_row_handler=skip),
            pa.csv.ConvertOptions(column_types=kinds, include_columns=wanted),
        )
    except (OSError, pa.ArrowException) as error:
        raise CorruptSource(f"{path}: expected a CSV file, found none that can be read; download it again") from error
    needed = [*kinds, *(name for name in _NUMBERS if name not in _OPTIONAL)]
    missing = [name for name in needed if name not in table.column_names]
    if missing or not len(table):
        found = f"found no {missing[0]}" if missing else "found no row"
        raise CorruptSource(f"{path}: expected rows with the columns {', '.join(needed)}, {found}; download it again")
    reason = f"expected {len(names)} cells, found another number"
    defects.drop("tracks", file, lines, "row", reason)
    return table


def _floats(column: pa.ChunkedArray) -> Float64:
    """(R,) numbers; NaN for other text."""
    if pa.types.is_string(column.type) or pa.types.is_binary(column.type):
        return np.array([_number(text) for text in column.to_pylist()], np.float64)
    numbers: Float64 = pc.cast(column, pa.float64(), safe=False).to_numpy()
    return numbers


def _number(text: str | bytes | None) -> float:
    try:
        return float(text or "nan")
    except ValueError:
        return np.nan


def _courses(velocity: Float64) -> Float64:
    """(R,) headings [rad] along velocities; 0 at standstill."""
    is_moving = np.hypot(*velocity.T) > _MOVING
    courses: Float64 = np.where(is_moving, np.arctan2(velocity[:, 1], velocity[:, 0]), 0.0)
    return courses
