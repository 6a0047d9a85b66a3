"""Read Argoverse 1's forecasting CSV: one row per observed object and time, city frame, metres.

    TIMESTAMP,TRACK_ID,OBJECT_TYPE,X,Y,CITY_NAME
    315971499.0250085,00000000-0000-0000-0000-000000000000,AV,2661.0156381377387,1145.753051913686,PIT

OBJECT_TYPE is the role in the challenge: AV is the recording vehicle, AGENT is to be predicted, OTHERS.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv

from scenarionet_data.arrays.dtypes import Float64, Int64
from scenarionet_data.errors import CorruptSource

EGO = "AV"
FOCAL = "AGENT"
NUM_OBSERVED = 20
_LENGTHS = (NUM_OBSERVED, 50)
"""Recorded times: the test split ends with the history."""

_TYPES = {
    "TIMESTAMP": pa.float64(),
    "TRACK_ID": pa.string(),
    "OBJECT_TYPE": pa.string(),
    "X": pa.float64(),
    "Y": pa.float64(),
    "CITY_NAME": pa.string(),
}
_CONVERT = pa.csv.ConvertOptions(column_types=_TYPES, include_columns=list(_TYPES))
_HEADER = ",".join(_TYPES).encode()
_TWO_LINES = 512


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
    """

    city: str
    ids: list[str]
    types: list[str]
    start: float
    times: Float64
    track: Int64
    frame: Int64
    position: Float64

    def only(self, word: str) -> int:
        """Row of the only track of a type."""
        return self.types.index(word)


def is_recording(path: Path) -> bool:
    """Whether a file begins like a forecasting CSV."""
    with path.open("rb") as file:
        return file.readline(len(_HEADER) + 2).rstrip() == _HEADER


def city_of(path: Path) -> str:
    """City of the first row, or an empty string."""
    with path.open("rb") as file:
        _, row, *_ = [*file.read(_TWO_LINES).splitlines(), b"", b""]
    return row.rpartition(b",")[2].decode("ascii", "replace")


def read_recording(path: Path) -> Argoverse1Recording:
    """Read one file.

    Raises:
        CorruptSource: Missing, damaged, incomplete, or of another format.
    """
    rows = _read(path)
    stamps, frame = np.unique(rows["TIMESTAMP"].to_numpy(), return_inverse=True)
    ids, track = _words(rows, "TRACK_ID")
    types = _one_word_each(rows, track, len(ids), path)
    _check(path, stamps, types)
    order = np.lexsort((frame, track))
    track, frame = track[order], frame[order].astype(np.int64)
    twice = np.flatnonzero((track[1:] == track[:-1]) & (frame[1:] == frame[:-1]))
    if len(twice):
        raise CorruptSource(f"{path}: track {ids[track[twice[0]]]} has two rows with the same time; download it again")
    return Argoverse1Recording(
        city=_city(rows, path),
        ids=ids,
        types=types,
        start=float(stamps[0]),
        times=stamps - stamps[0],
        track=track,
        frame=frame,
        position=np.column_stack([rows["X"].to_numpy(), rows["Y"].to_numpy()])[order],
    )


def _read(path: Path) -> dict[str, Any]:
    """Read the columns as arrays, with finite numbers."""
    try:
        data = path.read_bytes()
        table = pa.csv.read_csv(
            pa.BufferReader(data),
            pa.csv.ReadOptions(use_threads=False, block_size=max(len(data), 1)),
            convert_options=_CONVERT,
        )
    except (OSError, KeyError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0].strip("'") if str(error) else type(error).__name__
        raise CorruptSource(f"{path} cannot be read ({reason}); download it again") from error
    if not table.num_rows:
        raise CorruptSource(f"{path}: expected rows, found none; download it again")
    rows = {name: table.column(name).combine_chunks() for name in _TYPES}
    for name, column in rows.items():
        is_whole = not column.null_count and (name not in _NUMBERS or np.isfinite(column.to_numpy()).all())
        if not is_whole:
            raise CorruptSource(f"{path}: column {name}: expected a value in every row; download it again")
    return rows


_NUMBERS = ("TIMESTAMP", "X", "Y")


def _words(rows: dict[str, Any], name: str) -> tuple[list[str], Int64]:
    """Distinct words in order of first appearance, and the index of each row's word."""
    encoded = rows[name].dictionary_encode()
    return encoded.dictionary.to_pylist(), encoded.indices.to_numpy().astype(np.int64)


def _one_word_each(rows: dict[str, Any], track: Int64, count: int, path: Path) -> list[str]:
    """(N,) type of each track."""
    words, code = _words(rows, "OBJECT_TYPE")
    code_of_track = np.zeros(count, np.int64)
    code_of_track[track] = code
    if (code_of_track[track] != code).any():
        raise CorruptSource(f"{path}: a track changes its OBJECT_TYPE; download it again")
    return [words[number] for number in code_of_track]


def _city(rows: dict[str, Any], path: Path) -> str:
    words, _ = _words(rows, "CITY_NAME")
    if len(words) != 1:
        raise CorruptSource(f"{path}: expected one CITY_NAME, found {', '.join(words[:3])}; download it again")
    return words[0]


def _check(path: Path, stamps: Float64, types: list[str]) -> None:
    if len(stamps) not in _LENGTHS:
        wanted = f"expected {_LENGTHS[0]} or {_LENGTHS[1]} times, found {len(stamps)}"
        raise CorruptSource(f"{path}: {wanted}; download it again")
    for word in (EGO, FOCAL):
        if types.count(word) != 1:
            raise CorruptSource(f"{path}: expected one {word}, found {types.count(word)}; download it again")
