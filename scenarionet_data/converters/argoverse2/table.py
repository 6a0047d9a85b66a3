"""Read Argoverse 2's Parquet and Feather files as columns of checked types and (track, timestep) grids."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.feather
import pyarrow.parquet
import pyarrow.types as kinds

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.building import StateGrid
from scenarionet_data.errors import CorruptSource

_LARGEST = 2.0**62


def read_parquet(path: Path) -> pa.Table:
    """Read all columns of a small Parquet file.

    Raises:
        CorruptSource: The file is missing or cannot be read to its end.
    """
    try:
        return pa.parquet.ParquetFile(pa.BufferReader(path.read_bytes())).read(use_threads=False)
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        raise _unreadable(path, "Parquet", error) from error


def word_in_footer(path: Path, column: str) -> str:
    """Minimum of a text column from the file's footer, or an empty string if it has no statistics."""
    try:
        group = pa.parquet.read_metadata(path).row_group(0)
        names = [group.column(number).path_in_schema for number in range(group.num_columns)]
        statistics = group.column(names.index(column)).statistics
        return str(statistics.min) if statistics and statistics.has_min_max else ""
    except (OSError, ValueError, IndexError, pa.ArrowException):  # reported when the file is converted
        return ""


def read_feather(path: Path, columns: Iterable[str]) -> pa.Table:
    """Read columns of a Feather file; those that it lacks are missing in the result, too.

    Raises:
        CorruptSource: The file is missing, or cannot be read to its end.
    """
    try:
        rows = pa.feather.read_table(path, use_threads=False, memory_map=False)
        wanted = set(columns)
        chosen = rows.select([number for number, name in enumerate(rows.column_names) if name in wanted])
        chosen.validate(full=True)  # Arrow would read beyond the end of damaged columns
        return chosen
    except (OSError, pa.ArrowException, UnicodeDecodeError) as error:
        raise _unreadable(path, "Feather", error) from error


def _unreadable(path: Path, form: str, error: Exception) -> CorruptSource:
    if isinstance(error, OSError) and error.strerror:
        return CorruptSource(f"{path}: cannot be read ({error.strerror}); download it again")
    return CorruptSource(f"{path}: expected a complete {form} file, found other bytes; download it again")


def column(table: pa.Table, path: Path, name: str) -> pa.Array:
    """Return one column, with nulls.

    Raises:
        CorruptSource: The column is missing, or there are several.
    """
    if table.column_names.count(name) != 1:
        names = ", ".join(table.column_names)
        raise CorruptSource(f"{path}: expected one column {name}, found {names}; is this an Argoverse 2 file?")
    return table.column(name).combine_chunks()


def numbers(table: pa.Table, path: Path, *names: str) -> Float64:
    """One column as (R,), or several as (R, len(names)) float64; nulls are NaN.

    Raises:
        CorruptSource: A column is missing or does not contain numbers.
    """
    arrays = [_numeric(table, path, name).cast(pa.float64(), safe=False) for name in names]
    values = [np.asarray(array.to_numpy(zero_copy_only=False), np.float64) for array in arrays]
    return values[0] if len(values) == 1 else np.stack(values, axis=-1)


def integers(table: pa.Table, path: Path, name: str) -> tuple[Int64, Bool]:
    """A column of whole numbers as (R,) int64, and whether each is known; 0 where it is not.

    Raises:
        CorruptSource: The column is missing or does not contain numbers.
    """
    found = _numeric(table, path, name)
    known = np.asarray(pc.is_valid(found).to_numpy(zero_copy_only=False), np.bool_)
    if not kinds.is_signed_integer(found.type):
        real = numbers(table, path, name)
        with np.errstate(invalid="ignore"):
            known &= (np.abs(real) < _LARGEST) & (np.floor(real) == real)
        return np.where(known, real, 0.0).astype(np.int64), known
    return np.asarray(found.fill_null(0).cast(pa.int64()).to_numpy(zero_copy_only=False), np.int64), known


def _numeric(table: pa.Table, path: Path, name: str) -> pa.Array:
    found = column(table, path, name)
    is_number = kinds.is_integer(found.type) or kinds.is_floating(found.type) or kinds.is_boolean(found.type)
    if not is_number:
        raise CorruptSource(f"{path}: column {name}: expected numbers, found {found.type}; download it again")
    return found.cast(pa.uint8()) if kinds.is_boolean(found.type) else found


def text(table: pa.Table, path: Path, name: str) -> tuple[pa.DictionaryArray, Bool]:
    """A text column as a dictionary, with words in order of first appearance, and whether each row has one.

    Raises:
        CorruptSource: The column is missing or does not contain text.
    """
    found = column(table, path, name)
    form = found.type.value_type if kinds.is_dictionary(found.type) else found.type
    try:
        words = found.cast(form) if kinds.is_dictionary(found.type) else found
        if not (kinds.is_string(form) or kinds.is_large_string(form)):
            raise CorruptSource(f"{path}: column {name}: expected text, found {found.type}; download it again")
        words.validate(full=True)
    except pa.ArrowException as error:
        raise CorruptSource(f"{path}: column {name}: expected text, found other bytes; download it again") from error
    known = np.asarray(pc.is_valid(words).to_numpy(zero_copy_only=False), np.bool_)
    return words.fill_null("").dictionary_encode(), known


def first_word(table: pa.Table, path: Path, name: str) -> str:
    """The first word of a text column with the same value in all rows.

    Raises:
        CorruptSource: The column is missing, does not contain text, or has none.
    """
    words, known = text(table, path, name)
    if not known.any():
        raise CorruptSource(f"{path}: column {name}: expected text, found only nulls; download it again")
    return str(words[int(np.argmax(known))].as_py())


def first_number(table: pa.Table, path: Path, name: str, low: float, high: float) -> int:
    """The first whole number of a column with the same value in all rows.

    Raises:
        CorruptSource: The column is missing, or its first known number is not between ``low`` and ``high``.
    """
    values, known = integers(table, path, name)
    first = int(values[int(np.argmax(known))]) if known.any() else None
    if first is None or not low <= first <= high:
        found = "nothing" if first is None else first
        raise CorruptSource(f"{path}: column {name}: expected {low:g} to {high:g}, found {found}; download it again")
    return first


class TrackGrid(StateGrid):
    """The grid of tracks that are named by a column of text.

    Attributes:
        ids: (N,) tracks in order of first appearance.
        first: (N,) int64 first row of each track.
    """

    def __init__(self, tracks: pa.DictionaryArray, timesteps: Int64, num_timesteps: int) -> None:
        words = tracks.dictionary.to_pylist()
        used, self.first, track = np.unique(tracks.indices.to_numpy(), return_index=True, return_inverse=True)
        self.ids = [words[code] for code in used]
        super().__init__(track, timesteps, (len(self.ids), num_timesteps))
