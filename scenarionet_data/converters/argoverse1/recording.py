"""Sort the rows of an Argoverse 1 file into tracks and times; rows that cannot be are dropped and listed."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int64
from scenarionet_data.building import bridge_gaps
from scenarionet_data.building.plausible import find_bad_rows, find_repeated_rows
from scenarionet_data.converters.argoverse1.table import EGO, FOCAL, NUM_OBSERVED, OTHER, CsvRows, read_rows
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects

_LENGTHS = (NUM_OBSERVED, 50)
"""Recorded times: the test split ends with the history."""
_LONGEST = 60.0
"""Longest time between a row and the middle one [s]; recordings with lost frames last up to 14 s."""


@dataclass(frozen=True, eq=False)
class Argoverse1Recording:
    """One file: N tracks, S recorded times, R rows sorted by track and time.

    Attributes:
        city: MIA or PIT.
        ids: (N,) tracks in order of first appearance.
        types: (N,) AV, AGENT or OTHERS.
        start: Time of the first row [s], on the source's clock.
        times: (S,) [s] from the start, strictly increasing.
        track, frame: (R,) indices of each row.
        position: (R, 2) [m].
        is_interpolated: (R,) whether the ego's row at this time was dropped and is interpolated.
        ego: Track of the recording vehicle.
        targets: Tracks to predict; one, unless the file is damaged.
    """

    city: str
    ids: list[str]
    types: list[str]
    start: float
    times: Float64
    track: Int64
    frame: Int64
    position: Float64
    is_interpolated: Bool
    ego: int
    targets: list[int]


def read_recording(path: Path, file: str, defects: Defects) -> Argoverse1Recording:
    """Read one file.

    Args:
        path: The file.
        file: Its name relative to the raw folder.
        defects: Collects the rows that are dropped, or completed by an assumption.

    Raises:
        CorruptSource: Of another format, or its ego or its times cannot be read.
    """
    cleaning = _Cleaning(file, defects)
    rows = cleaning.plausible(read_rows(path, file, defects), path)
    rows, stamps = cleaning.timed(rows, path)
    numbers = {name: number for number, name in enumerate(dict.fromkeys(rows.track.tolist()))}
    ids, track = list(numbers), np.array([numbers[name] for name in rows.track.tolist()], np.int64)
    types = cleaning.types(rows, track, len(ids), path)
    frame = np.searchsorted(stamps, rows.time)
    repeated = find_repeated_rows(track, frame)
    if repeated is not None:
        cleaning.drop(rows, repeated.mask, "TIMESTAMP", repeated.reason)
        track, frame, rows = track[~repeated.mask], frame[~repeated.mask], rows.take(~repeated.mask)
    ego, times = types.index(EGO), stamps - stamps[0]
    track, frame, position, is_interpolated = cleaning.complete_ego(
        ego, times, track, frame, np.column_stack([rows.x, rows.y])
    )
    order = np.lexsort((frame, track))
    return Argoverse1Recording(
        city=str(rows.city[0]),
        ids=ids,
        types=types,
        start=float(stamps[0]),
        times=times,
        track=track[order],
        frame=frame[order],
        position=position[order],
        is_interpolated=is_interpolated[order],
        ego=ego,
        targets=[row for row, word in enumerate(types) if word == FOCAL],
    )


@dataclass(frozen=True)
class _Cleaning:
    """Drops rows of one file, and lists them."""

    file: str
    defects: Defects

    def drop(self, rows: CsvRows, mask: Bool, field: str, reason: str) -> None:
        self.defects.drop("tracks", self.file, rows.line[mask].tolist(), field, reason)

    def plausible(self, rows: CsvRows, path: Path) -> CsvRows:
        """Rows with a track, a city and finite numbers that objects in the ego's surroundings can have."""
        city = Counter(rows.city[rows.city != ""].tolist()).most_common(1)
        if not city:
            raise CorruptSource(f"{path}: expected a CITY_NAME, found none; download it again")
        own = (rows.word == EGO) & np.isfinite(rows.x) & np.isfinite(rows.y)
        if not own.any():
            raise CorruptSource(f"{path}: expected rows of the ego, OBJECT_TYPE {EGO}, found none; download it again")
        middle = np.array([np.median(rows.x[own]), np.median(rows.y[own])])
        finite = np.isfinite(rows.time)
        center = float(np.median(rows.time[finite])) if finite.any() else 0.0
        with np.errstate(invalid="ignore"):
            is_timely = np.abs(rows.time - center) <= _LONGEST
        position = np.column_stack([rows.x, rows.y])
        faults: list[tuple[Array, str, str]] = [
            (rows.track == "", "TRACK_ID", "expected a track, found none"),
            (rows.city != city[0][0], "CITY_NAME", f"expected {city[0][0]} as in most rows, found another"),
            (~is_timely, "TIMESTAMP", f"expected a time within {_LONGEST:.0f} s of the others, found another"),
            *find_bad_rows(position, np.zeros(len(position)), None, None, middle),
        ]
        is_bad = np.zeros(len(rows.line), np.bool_)
        for mask, field, reason in faults:
            self.drop(rows, mask & ~is_bad, field, reason)
            is_bad |= mask
        return rows.take(~is_bad)

    def timed(self, rows: CsvRows, path: Path) -> tuple[CsvRows, Float64]:
        """Rows at the times of the recording, and these; a time with a single row may be a damaged one."""
        stamps, counts = np.unique(rows.time, return_counts=True)
        wanted = max((length for length in _LENGTHS if length <= len(stamps)), default=_LENGTHS[0])
        alone = stamps[counts == 1]
        if len(stamps) - wanted == len(alone) > 0:
            is_odd = np.isin(rows.time, alone)
            self.drop(rows, is_odd, "TIMESTAMP", f"expected one of the {wanted} times, found a row at its own")
            rows, stamps = rows.take(~is_odd), stamps[counts > 1]
        if len(stamps) != wanted:
            expected = f"expected {_LENGTHS[0]} or {_LENGTHS[1]} times, found {len(stamps)}"
            raise CorruptSource(f"{path}: {expected}; download it again")
        return rows, stamps

    def types(self, rows: CsvRows, track: Int64, count: int, path: Path) -> list[str]:
        """(N,) role of each track: that of most of its rows; a second ego is one of the others."""
        words = np.array([OTHER, EGO, FOCAL], object)
        votes = np.stack([np.bincount(track[rows.word == word], minlength=count) for word in words], axis=1)
        chosen = np.where(votes.any(axis=1), votes.argmax(axis=1), 0)
        (egos,) = np.nonzero(chosen == 1)
        if not len(egos):
            raise CorruptSource(f"{path}: expected rows of the ego, OBJECT_TYPE {EGO}, found none; download it again")
        chosen[egos[egos != egos[votes[egos, 1].argmax()]]] = 0
        types = words[chosen]
        is_other = rows.word != types[track]
        reason = "expected the OBJECT_TYPE of the track's other rows and one ego, found another"
        self.defects.assume("tracks", self.file, rows.line[is_other].tolist(), "OBJECT_TYPE", reason)
        if np.count_nonzero(types == FOCAL) != 1:
            found = f"expected one {FOCAL}, found {np.count_nonzero(types == FOCAL)}"
            self.defects.assume("tracks", self.file, ["the whole file"], "OBJECT_TYPE", found)
        return [str(word) for word in types]

    def complete_ego(
        self, ego: int, times: Float64, track: Int64, frame: Int64, position: Float64
    ) -> tuple[Int64, Int64, Float64, Bool]:
        """Interpolate the ego's rows that were dropped; every whole recording has one at each time."""
        (own,) = np.nonzero(track == ego)
        known, path = np.zeros(len(times), np.bool_), np.zeros((len(times), 2))
        known[frame[own]], path[frame[own]] = True, position[own]
        path, is_filled = bridge_gaps(times, known, path)
        (missing,) = np.nonzero(is_filled)
        reason = "expected the ego at every time, found times without it, which are interpolated"
        self.defects.assume("tracks", self.file, [f"{times[each]:.3f} s" for each in missing], "X", reason)
        return (
            np.append(track, np.full(len(missing), ego)),
            np.append(frame, missing),
            np.concatenate([position, path[missing]]),
            np.append(np.zeros(len(track), np.bool_), np.ones(len(missing), np.bool_)),
        )
