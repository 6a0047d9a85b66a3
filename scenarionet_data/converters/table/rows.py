"""Read a table of tracks, CSV or Parquet: one row per road user and time."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv
import pyarrow.parquet as pq

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64, Object
from scenarionet_data.building.motion import estimate_motion
from scenarionet_data.building.plausible import find_bad_rows, find_repeated_rows
from scenarionet_data.converters.formats.xml_files import to_number
from scenarionet_data.converters.table.columns import COMPASS, DEGREES, NEEDED, TEXTS, TableColumns
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.scenario.vocabulary import ObjectType

_MOVING = 0.2
"""Speed [m/s] below which a velocity says nothing of the heading."""
_OFF_STEP = 0.01
"""Share of a timestep by which a time may be off."""
_LONGEST = 86_400.0
"""Longest time between a row and the middle one [s]."""


@dataclass(frozen=True)
class FrameClock:
    """Times of frames.

    Attributes:
        step: Time between frames [s].
        start: Time of frame 0 on the source's clock [s].
        times: (S,) [s] from ``start``, of each frame; None where they are all a step apart.
    """

    step: float
    start: float
    times: Float64 | None = None

    def timestamps(self, first: int, last: int) -> Float64:
        """Times of frames ``first`` to ``last - 1``, from the first [s]."""
        if self.times is not None:
            since: Float64 = self.times[first:last] - self.times[first]
            return since
        return np.linspace(0.0, (last - first - 1) * self.step, last - first)

    def moment(self, frame: int) -> float:
        """Time of a frame on the source's clock [s]."""
        return self.start + (frame * self.step if self.times is None else float(self.times[frame]))


@dataclass(frozen=True, eq=False)
class TrackRows:
    """R rows, sorted by track and frame.

    Attributes:
        line: (R,) line of the file, from 1.
        track: (R,) number of the track in ``ids``.
        frame: (R,) number of the time.
        position, velocity: (R, 2) [m], [m/s].
        height: (R,) [m], z of the position.
        heading: (R,) [rad].
        size: (R, 3) [m].
        ids, words: (N,) id of each track, and its type as the source names it.
        kinds: (N,) its type.
        has_sizes, has_types, has_velocities: (N,) whether they are recorded, and not assumed or estimated.
    """

    line: Int64
    track: Int64
    frame: Int64
    position: Float64
    velocity: Float64
    height: Float64
    heading: Float64
    size: Float64
    ids: Object
    words: Object
    kinds: Int64
    has_sizes: Bool
    has_types: Bool
    has_velocities: Bool

    def take(self, mask: Bool) -> TrackRows:
        """TrackRows where ``mask`` (R,) is True, with the tracks that they belong to."""
        known, track = np.unique(self.track[mask], return_inverse=True)
        of_rows = {name: getattr(self, name)[mask] for name in _OF_ROWS}
        return TrackRows(**{**of_rows, "track": track}, **{name: getattr(self, name)[known] for name in _OF_TRACKS})


_OF_ROWS = ("line", "track", "frame", "position", "velocity", "height", "heading", "size")
_OF_TRACKS = ("ids", "words", "kinds", "has_sizes", "has_types", "has_velocities")


def joined(first: TrackRows, second: TrackRows) -> TrackRows:
    """The rows of two files of one recording; ids of the second that the first has as well get the prefix ``P``."""
    taken = set(first.ids)
    ids = np.array([f"P{name}" if name in taken else name for name in second.ids], object)
    changed = {**vars(second), "track": second.track + len(first.ids), "ids": ids}
    return TrackRows(
        **{name: np.concatenate([getattr(first, name), changed[name]]) for name in (*_OF_ROWS, *_OF_TRACKS)}
    )


def read_rows(path: Path, file: str, columns: TableColumns, defects: Defects) -> tuple[TrackRows, FrameClock]:
    """Read a file; rows that cannot be used are dropped.

    Args:
        path: The file, CSV or ``*.parquet``.
        file: Its name relative to the raw folder, for ``defects``.
        columns: What its columns hold.
        defects: Collects the rows that are dropped.

    Raises:
        CorruptSource: Missing, without the columns, or without a usable row.
    """
    table, wanted = _read_table(path, file, columns, defects)
    count, line = table.num_rows, np.arange(2, table.num_rows + 2)
    given = {name: _floats(table[wanted[name]]) * columns.factor(name) for name in wanted if name not in TEXTS}
    position = np.column_stack([given["x"], given["y"]])
    if columns.columns["x"].unit == DEGREES:
        is_on_earth = np.all(np.abs(position) <= np.array([180.0, 90.0]), axis=1, keepdims=True)
        position = columns.to_metres(*np.where(is_on_earth, position, np.nan).T)
    ids, words = (_words(table, wanted.get(name)) for name in TEXTS)
    track = ids.indices.fill_null(len(ids.dictionary)).to_numpy().astype(np.int64)
    kinds, word = _types(words, columns)
    clock, frame, is_timed = _frames(given["time"], columns.step)
    is_timed &= track < len(ids.dictionary)
    heading = given.get("heading", np.zeros(count))
    if "heading" in given and columns.columns["heading"].unit == COMPASS:
        heading = np.pi / 2.0 - heading
    velocity = None
    if "vx" in given:
        velocity = np.column_stack([given["vx"], given["vy"]])
    elif "speed" in given and "heading" in given:
        velocity = given["speed"][:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
    default = columns.sizes.get(ObjectType.OTHER, columns.sizes.get(ObjectType.VEHICLE))
    by_kind = np.array([columns.sizes.get(kind, default) for kind in ObjectType])
    size = by_kind[kinds]
    for number, each in enumerate(words.dictionary.to_pylist()):
        if each.lower() in columns.sizes:
            size[word == number] = columns.sizes[each.lower()]
    for axis, name in enumerate(("length", "width", "height")):
        if name in given:
            size[:, axis] = given[name]
    size, has_size = size, "length" in given

    keep = is_timed
    expected = f"a multiple of {columns.step:g} s" if columns.step else "a time within a day of the others"
    reason = f"expected a track and {expected}, found another"
    defects.drop("tracks", file, line[~is_timed].tolist(), wanted["time"], reason)
    middle = np.nanmedian(position, axis=0) if np.isfinite(position).all(axis=1).any() else np.zeros(2)
    height = given.get("z", np.zeros(count))
    place = np.column_stack([position, height]) if "z" in given else position
    repeated = find_repeated_rows(track, np.where(is_timed, frame, -line))
    for fault in [*find_bad_rows(place, heading, velocity, size, middle), *([repeated] if repeated else [])]:
        new = fault.mask & keep
        defects.drop("tracks", file, line[new].tolist(), fault.field, fault.reason)
        keep = keep & ~fault.mask
    if not keep.any():
        why = "; ".join(f"{each.field}: {each.reason} ({each.count:,} rows)" for each in defects.found())
        raise CorruptSource(f"{path}: expected rows that can be used, found none ({why}); download it again")
    order = np.flatnonzero(keep)
    order = order[np.lexsort((frame[order], track[order]))]
    known, first, renumbered = np.unique(track[order], return_index=True, return_inverse=True)
    of_tracks = order[first]
    if columns.step is None:  # only times of rows that are used
        clock, frame = _distinct(given["time"], order)
    frame = frame[order]
    if velocity is None:
        start = int(frame.min())
        times, at = clock.timestamps(start, int(frame.max()) + 1), (renumbered, frame - start)
        motion = estimate_motion(*at, position[order], times, "recorded", np.zeros(len(order), np.bool_))
        speeds, course = motion.velocity[at], motion.course[at]
    else:
        speeds = velocity[order]
        course = np.where(np.hypot(*speeds.T) > _MOVING, np.arctan2(speeds[:, 1], speeds[:, 0]), 0.0)
    names = np.array([*words.dictionary.to_pylist(), ""], object)[word[of_tracks]]
    rows = TrackRows(
        line=line[order],
        track=renumbered,
        frame=frame,
        position=position[order],
        velocity=speeds,
        height=height[order],
        heading=heading[order] if "heading" in given else course,
        size=size[order],
        ids=np.array(ids.dictionary.to_pylist(), object)[known],
        words=names,
        kinds=kinds[of_tracks],
        has_sizes=np.full(len(known), has_size),
        has_types=np.array([name.lower() in columns.types and name not in columns.unsure for name in names], np.bool_),
        has_velocities=np.full(len(known), velocity is not None),
    )
    return rows, clock


def _read_table(path: Path, file: str, columns: TableColumns, defects: Defects) -> tuple[pa.Table, dict[str, str]]:
    """A file, and the name of its column of each quantity that it has; text in columns of numbers is kept as text."""
    lines: list[int] = []

    def skip(row: pa.csv.InvalidRow) -> str:
        lines.append(row.number or 0)
        return "skip"

    try:
        if path.suffix == ".parquet":
            table = pq.read_table(path, use_threads=False)
            names = table.column_names
            wanted = _wanted(path, names, columns)
        else:
            data = path.read_bytes().decode("utf-8-sig", "replace").encode()
            names = next(csv.reader([data.split(b"\n", 1)[0].decode("utf-8", "replace").strip()]), [])
            wanted = _wanted(path, names, columns)
            table = pa.csv.read_csv(
                BytesIO(data),
                pa.csv.ReadOptions(use_threads=False, block_size=max(len(data), 1)),
                pa.csv.ParseOptions(invalid_row_handler=skip),
                pa.csv.ConvertOptions(
                    column_types={wanted[name]: pa.string() for name in TEXTS if name in wanted},
                    include_columns=list(dict.fromkeys(wanted.values())),
                ),
            )
    except (OSError, csv.Error, pa.ArrowException) as error:
        raise CorruptSource(f"{path}: expected a table, found none that can be read; download it again") from error
    if not len(table):
        raise CorruptSource(f"{path}: expected rows with the columns {', '.join(wanted.values())}, found no row")
    defects.drop("tracks", file, lines, "row", f"expected {len(names)} cells, found another number")
    return table, wanted


def _wanted(path: Path, names: list[str], columns: TableColumns) -> dict[str, str]:
    """Name of the column of each quantity that the file has."""
    wanted = {quantity: column.name for quantity, column in columns.columns.items() if column.name in names}
    missing = [columns.columns[quantity].name for quantity in NEEDED if quantity not in wanted]
    if missing or len(set(names)) < len(names):
        found = f"no {missing[0]}" if missing else "a name twice"
        raise CorruptSource(
            f"{path}: expected the columns {', '.join(columns.columns[each].name for each in NEEDED)}, found {found} "
            f"among {', '.join(names)[:300]}; say in columns.toml which column is what, or download it again"
        )
    for pair in (("vx", "vy"), ("length", "width")):
        if sum(name in wanted for name in pair) == 1:
            raise CorruptSource(f"{path}: expected {' and '.join(pair)} or neither, found one of them")
    return wanted


def _words(table: pa.Table, name: str | None) -> pa.DictionaryArray:
    column = pa.nulls(table.num_rows, pa.string()) if name is None else pc.cast(table[name], pa.string())
    column = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    return column.dictionary_encode()


def _floats(column: pa.ChunkedArray) -> Float64:
    """(R,) numbers; NaN for other text."""
    kind = column.type
    if pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind) or pa.types.is_null(kind):
        numbers: Float64 = pc.cast(column, pa.float64(), safe=False).to_numpy()
        return numbers
    return np.array([to_number(text) for text in column.to_pylist()], np.float64)


def _types(words: pa.DictionaryArray, columns: TableColumns) -> tuple[Int64, Int64]:
    """(R,) type and number of the word of each row; without a column of types all are vehicles."""
    known = words.dictionary.to_pylist()
    types = [columns.types.get(word.lower(), ObjectType.OTHER) for word in known]
    missing = ObjectType.OTHER if known else ObjectType.VEHICLE
    word = words.indices.fill_null(len(known)).to_numpy().astype(np.int64)
    return np.array([*types, missing], np.int64)[word], word


def _frames(time: Float64, step: float | None) -> tuple[FrameClock, Int64, Bool]:
    """The clock, (R,) frames, and whether each time can be used."""
    finite = np.isfinite(time)
    middle = float(np.partition(time[finite], finite.sum() // 2)[finite.sum() // 2]) if finite.any() else 0.0
    is_timed = finite & (np.abs(np.where(finite, time, 0.0) - middle) <= _LONGEST)
    if step is None:
        return FrameClock(1.0, middle), np.unique(np.where(is_timed, time, middle), return_inverse=True)[1], is_timed
    clock = FrameClock(step, middle - round(middle / step) * step)
    frames = (np.where(is_timed, time, middle) - clock.start) / step
    frame = np.round(frames).astype(np.int64)
    return clock, frame, is_timed & (np.abs(frames - frame) <= _OFF_STEP)


def _distinct(time: Float64, order: Int64) -> tuple[FrameClock, Int64]:
    """The clock of the times of rows ``order``, and (R,) frames."""
    times, found = np.unique(time[order], return_inverse=True)
    frame = np.zeros(len(time), np.int64)
    frame[order] = found
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    return FrameClock(step, float(times[0]), times - times[0]), frame
