"""Read Argoverse 2's Parquet and Feather files as validated columns and (track, timestep) grids."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.feather
import pyarrow.parquet

from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.errors import CorruptSource


def read_parquet(path: Path) -> pa.Table:
    """Read all columns of a small Parquet file.

    Raises:
        CorruptSource: The file is missing or cannot be read to its end.
    """
    try:
        return pa.parquet.ParquetFile(pa.BufferReader(path.read_bytes())).read(use_threads=False)
    except (OSError, pa.ArrowException) as error:
        raise _unreadable(path, error) from error


def word_in_footer(path: Path, column: str) -> str:
    """Minimum of a text column from the file's footer, or an empty string if it has no statistics."""
    try:
        group = pa.parquet.read_metadata(path).row_group(0)
        names = [group.column(number).path_in_schema for number in range(group.num_columns)]
        statistics = group.column(names.index(column)).statistics
    except (OSError, ValueError, IndexError, pa.ArrowException):  # reported when the file is converted
        return ""
    return str(statistics.min) if statistics and statistics.has_min_max else ""


def read_feather(path: Path, columns: Iterable[str]) -> pa.Table:
    """Read columns of a Feather file.

    Raises:
        CorruptSource: The file is missing, lacks a column, or cannot be read to its end.
    """
    try:
        return pa.feather.read_table(path, columns=list(columns), use_threads=False, memory_map=False)
    except (OSError, KeyError, pa.ArrowException) as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: Exception) -> CorruptSource:
    reason = str(error).splitlines()[0] if str(error) else type(error).__name__
    return CorruptSource(f"{path} cannot be read ({reason}); download it again")


def column(table: pa.Table, path: Path, name: str) -> pa.ChunkedArray:
    """Return one column.

    Raises:
        CorruptSource: The column is missing or has nulls.
    """
    if name not in table.column_names:
        names = ", ".join(table.column_names)
        raise CorruptSource(f"{path}: expected a column {name}, found {names}; is this an Argoverse 2 file?")
    found = table.column(name)
    if found.null_count:
        raise CorruptSource(f"{path}: column {name}: expected no nulls, found {found.null_count}")
    return found


def numbers(table: pa.Table, path: Path, *names: str) -> Array:
    """One column as (R,), or several as (R, len(names)) float64.

    Raises:
        CorruptSource: A column is missing, or has nulls, NaN or infinities.
    """
    arrays = [column(table, path, name).to_numpy() for name in names]
    for name, array in zip(names, arrays, strict=True):
        if array.dtype.kind not in "biuf" or not np.isfinite(array).all():
            raise CorruptSource(f"{path}: column {name}: expected finite numbers; download it again")
    return arrays[0] if len(arrays) == 1 else np.stack(arrays, axis=-1).astype(np.float64, copy=False)


def text(table: pa.Table, path: Path, name: str) -> pa.DictionaryArray:
    """Return a text column as a dictionary, with words in order of first appearance.

    Raises:
        CorruptSource: The column is missing or has nulls.
    """
    return column(table, path, name).combine_chunks().dictionary_encode()


class TrackGrid:
    """Grid of N tracks and T timesteps, with the cell of each row.

    Attributes:
        ids: (N,) tracks in order of first appearance.
        first: (N,) int64 first row of each track.
        valid: (N, T) bool: whether the cell has a row.

    Raises:
        CorruptSource: A timestep is outside 0 to T - 1, or a track has two rows for one timestep.
    """

    def __init__(self, tracks: pa.DictionaryArray, timesteps: Array, num_timesteps: int, path: Path) -> None:
        outside = timesteps[(timesteps < 0) | (timesteps >= num_timesteps)]
        if len(outside):
            wanted = f"expected timesteps 0 to {num_timesteps - 1}, found {outside[0]}"
            raise CorruptSource(f"{path}: {wanted}; download it again")
        words = tracks.dictionary.to_pylist()
        used, self.first, row = np.unique(tracks.indices.to_numpy(), return_index=True, return_inverse=True)
        self.ids = [words[code] for code in used]
        self._cell = row * num_timesteps + timesteps
        counts = np.bincount(self._cell, minlength=len(self.ids) * num_timesteps)
        if counts.max(initial=0) > 1:
            track, step = divmod(int(counts.argmax()), num_timesteps)
            found = f"found {counts.max()} of track {self.ids[track]} at timestep {step}"
            raise CorruptSource(f"{path}: expected one row per track and timestep, {found}")
        self.valid = (counts > 0).reshape(len(self.ids), num_timesteps)

    def place(self, values: Array) -> Array:
        """Scatter values (R, ...) of rows to (N, T, ...), 0 elsewhere."""
        cells = np.zeros((self.valid.size, *values.shape[1:]), values.dtype)
        cells[self._cell] = values
        return cells.reshape(*self.valid.shape, *values.shape[1:])
