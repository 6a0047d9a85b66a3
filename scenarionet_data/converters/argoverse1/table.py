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

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int64, Object
from scenarionet_data.converters.formats.xml_files import to_number
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects

EGO = "AV"
FOCAL = "AGENT"
OTHER = "OTHERS"
NUM_OBSERVED = 20

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
_UNREADABLE = "\N{REPLACEMENT CHARACTER}"


@dataclass(frozen=True, eq=False)
class CsvRows:
    """The rows of a file, in its order.

    Attributes:
        line: (R,) line of each row in the file, from 1.
        time, x, y: (R,) [s], [m]; NaN where the file has no number.
        track, word, city: (R,) text; empty where the file has none.
    """

    line: Int64
    time: Float64
    x: Float64
    y: Float64
    track: Object
    word: Object
    city: Object

    def take(self, mask: Bool) -> CsvRows:
        """Rows where ``mask`` (R,) is True."""
        return CsvRows(*(values[mask] for values in vars(self).values()))


def is_recording(path: Path) -> bool:
    """Whether a file begins like a forecasting CSV."""
    with path.open("rb") as file:
        return file.readline(len(_HEADER) + 2).rstrip() == _HEADER


def city_of(path: Path) -> str:
    """City of the first row, or an empty string."""
    with path.open("rb") as file:
        _, row, *_ = [*file.read(_TWO_LINES).splitlines(), b"", b""]
    return row.rpartition(b",")[2].decode("ascii", "replace")


def read_rows(path: Path, file: str, defects: Defects) -> CsvRows:
    """Read a file; lines of another number of cells are dropped.

    Args:
        path: The file.
        file: Its name relative to the raw folder, for ``defects``.
        defects: Collects the lines that are dropped.

    Raises:
        CorruptSource: Missing, without rows, or without these columns.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise CorruptSource(f"{path} cannot be read ({error.strerror}); download it again") from error
    try:  # the quick way needs every value to have the type of its column
        options = pa.csv.ReadOptions(use_threads=False, block_size=max(len(data), 1))
        parsing = pa.csv.ParseOptions(ignore_empty_lines=False)
        table = pa.csv.read_csv(pa.BufferReader(data), options, parsing, _CONVERT)
        numbers = [table[name].to_numpy() for name in ("TIMESTAMP", "X", "Y")]
        words = [_words(table[name].combine_chunks()) for name in ("TRACK_ID", "OBJECT_TYPE", "CITY_NAME")]
        rows = CsvRows(np.arange(2, table.num_rows + 2), *numbers, *words)
    except (KeyError, pa.ArrowException):  # something in it is damaged
        rows = _read_line_by_line(data, path, file, defects)
    if not len(rows.line):
        raise CorruptSource(f"{path}: expected rows, found none; download it again")
    return rows


def _words(column: Any) -> Object:
    """(R,) text; one object for each distinct word, so that comparisons are quick."""
    encoded = column.dictionary_encode()
    distinct = np.array([*encoded.dictionary.to_pylist(), ""], object)
    words: Object = distinct[encoded.indices.fill_null(len(distinct) - 1).to_numpy()]
    return words


def _read_line_by_line(data: bytes, path: Path, file: str, defects: Defects) -> CsvRows:
    lines = data.decode("utf-8", "replace").splitlines()
    names = lines[0].split(",") if lines else []
    missing = [name for name in _TYPES if name not in names]
    if missing:
        raise CorruptSource(
            f"{path}, line 1: expected the columns {', '.join(_TYPES)}, found no {missing[0]}; download it again"
        )
    cells = [line.split(",") for line in lines[1:]]
    is_complete = np.array([len(row) == len(names) for row in cells], np.bool_)
    numbers = np.arange(2, len(cells) + 2)
    if not is_complete.all():
        first = cells[int(np.argmin(is_complete))]
        reason = f"expected {len(names)} cells, found {len(first)}"
        defects.drop("tracks", file, numbers[~is_complete].tolist(), "row", reason)
    table = np.array([row for row in cells if len(row) == len(names)], object).reshape(-1, len(names))
    time, track, word, x, y, city = (table[:, names.index(name)] for name in _TYPES)
    return CsvRows(
        numbers[is_complete],
        _floats(time),
        _floats(x),
        _floats(y),
        np.array(["" if _UNREADABLE in cell else cell for cell in track], object),
        word,
        city,
    )


def _floats(cells: Array) -> Float64:
    """(R,) numbers; NaN for other text."""
    return np.array([to_number(cell) for cell in cells], np.float64)
