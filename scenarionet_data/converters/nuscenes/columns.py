"""Convert columns of nuScenes' tables to arrays: tokens to row numbers, lists to vectors, rows sorted by scene."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Array, Float64, Int64, UInt64
from scenarionet_data.arrays.geometry import yaw_from_quaternion

TEXT, NUMBER, NUMBERS, TEXTS = pa.string(), pa.float64(), pa.list_(pa.float64()), pa.list_(pa.string())

POSE = {"translation": NUMBERS, "rotation": NUMBERS}
"""Fields read by :func:`poses`."""

UNKNOWN_BIT = 63
"""Bit of unknown words."""


@dataclass(frozen=True, eq=False)
class TableRows:
    """Rows of a table by scene: those of scene ``i`` are ``start[i]`` to ``start[i + 1]``.

    Attributes:
        start: (C + 1,).
        columns: (R, ...) each.
    """

    start: Int64
    columns: dict[str, Array]

    def of(self, scene: int) -> dict[str, Array]:
        """Rows of one scene."""
        rows = slice(self.start[scene], self.start[scene + 1])
        return {name: column[rows] for name, column in self.columns.items()}

    @property
    def scene(self) -> Int64:
        """(R,) scene of each row."""
        return np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))


def gather(
    blocks: Iterable[pa.Table], convert: Callable[[pa.Table], dict[str, Array]], schema: pa.Schema
) -> dict[str, Array]:
    """Concatenate the arrays that ``convert`` returns for each block, and number the rows as ``row``."""
    parts = [convert(block) for block in blocks] or [convert(schema.empty_table())]
    found = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    return found | {"row": np.arange(len(next(iter(found.values()))))}


def by_scene(columns: dict[str, Array], num_scenes: int) -> TableRows:
    """Sort rows by ``scene`` and, if present, ``time``; drop rows without scene (-1)."""
    scene = columns["scene"]
    order = np.lexsort((columns["time"], scene) if "time" in columns else (scene,))
    order = order[scene[order] >= 0]
    start = np.searchsorted(scene[order], np.arange(num_scenes + 1))
    return TableRows(start, {name: column[order] for name, column in columns.items() if name != "scene"})


def filled(scene: Int64) -> Int64:
    """(R,) scenes, where a row without scene (-1) has that of the last row before it, or of the first row after it."""
    known = scene >= 0
    if known.all() or not known.any():
        return scene
    last = np.maximum.accumulate(np.where(known, np.arange(len(scene)), -1))
    return scene[np.where(last < 0, np.argmax(known), last)]


def index(tokens: pa.Array | pa.ChunkedArray, known: Sequence[str] | Array) -> Int64:
    """(R,) position of each token among the ``known`` ones, or -1."""
    place = pc.fill_null(pc.index_in(tokens, value_set=pa.array(known, TEXT), skip_nulls=True), -1)
    return np.asarray(place.to_numpy(), dtype=np.int64)


def vectors(lists: pa.ChunkedArray, width: int) -> Float64:
    """(R, width) from lists of numbers; NaN if a list is missing, of another length or has null."""
    array = lists.combine_chunks()
    fits = pc.fill_null(pc.equal(pc.list_value_length(array), width), False)
    found = np.full((len(array), width), np.nan)
    values = array.filter(fits).flatten().to_numpy(zero_copy_only=False)
    found[fits.to_numpy(zero_copy_only=False)] = values.reshape(-1, width)
    return found


def poses(rows: pa.Table) -> Float64:
    """(R, 4) x, y, z [m] and heading [rad]; NaN heading if the quaternion is not of length 1."""
    quaternion = vectors(rows["rotation"], 4)
    norm = np.linalg.norm(quaternion, axis=1)
    is_turn = np.abs(norm - 1.0) < 1e-2
    heading = np.where(is_turn, yaw_from_quaternion(*(quaternion / np.where(is_turn, norm, 1.0)[:, None]).T), np.nan)
    return np.column_stack([vectors(rows["translation"], 3), heading])


def bits(lists: pa.ChunkedArray, known: Sequence[str]) -> UInt64:
    """(R,) bit mask of the ``known`` words (at most 63) in each list."""
    array = lists.combine_chunks()
    place = index(pc.list_flatten(array), known)
    found = np.zeros(len(array), np.uint64)
    bit = np.where(place < 0, UNKNOWN_BIT, place).astype(np.uint64)
    np.bitwise_or.at(found, pc.list_parent_indices(array).to_numpy(), np.uint64(1) << bit)
    return found
