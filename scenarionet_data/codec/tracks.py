"""Tracks to rows and back: each list runs over its object's span, the grid is filled by one scatter."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from scenarionet_data.codec.arrow import (
    Rows,
    batch,
    bools,
    codes_of,
    dictionary_of,
    list_array,
    lists,
    names_of,
    numbers,
    offsets_of,
    string_array,
    strings,
)
from scenarionet_data.codec.kernels import fill, fill_sizes, fill_valid
from scenarionet_data.errors import LakeError
from scenarionet_data.scenario import Tracks
from scenarionet_data.vocabulary import ObjectType

Array = npt.NDArray[Any]


def encode_tracks(scenario_id: str, tracks: Tracks, has_z: bool) -> pa.RecordBatch:
    """Rows of a scenario's tracks."""
    count, steps = tracks.valid.shape
    start, lengths = _spans(tracks.valid)
    time = np.arange(steps, dtype=np.int32)
    inside = (time >= start[:, None]) & (time < (start + lengths)[:, None])
    offsets = offsets_of(lengths)
    flat_valid = tracks.valid[inside]
    gaps = offsets_of(~flat_valid)  # running count of invalid steps
    is_gapless = gaps[offsets[1:]] == gaps[offsets[:-1]]

    def column(values: Array) -> pa.Array:
        return list_array(offsets, values[inside])

    nulls = pa.nulls(count, pa.list_(pa.field("element", pa.float32(), nullable=False)))
    columns = {
        "scenario_id": pa.array([scenario_id] * count, pa.string()),
        "track_id": string_array(tracks.ids),
        "track_index": np.arange(count, dtype=np.int32),
        "object_type": names_of(tracks.object_type, ObjectType),
        "start": start,
        "x": column(tracks.position[..., 0]),
        "y": column(tracks.position[..., 1]),
        "z": column(tracks.position[..., 2]) if has_z else nulls,
        "heading": column(tracks.heading),
        "vx": column(tracks.velocity[..., 0]),
        "vy": column(tracks.velocity[..., 1]),
        "length": _encode_size(tracks.size[..., 0], tracks.valid, inside, lengths),
        "width": _encode_size(tracks.size[..., 1], tracks.valid, inside, lengths),
        "height": _encode_size(tracks.size[..., 2], tracks.valid, inside, lengths),
        "valid": _encode_valid(flat_valid, lengths, is_gapless),
        "source_type": dictionary_of(tracks.source_type),
        "is_size_assumed": pa.array(tracks.is_size_assumed),
        "is_type_assumed": pa.array(tracks.is_type_assumed),
        "is_velocity_estimated": pa.array(tracks.is_velocity_estimated),
        "extras": string_array(tracks.extras),
    }
    return batch("tracks", columns)


def decode_tracks(rows: Rows, steps: int) -> Tracks:
    """Tracks over ``steps`` timesteps from their rows.

    Raises:
        LakeError: Lists do not fit their spans, or spans the scenario: the file is damaged.
    """
    start, lengths = numbers(rows, "start"), lists(rows, "x")[0]
    _require("start", bool(((start >= 0) & (start + lengths <= steps)).all()))
    shape = (rows.num_rows, steps)

    def grid(*names: str) -> Array:
        block = np.zeros((*shape, len(names)), np.float32)
        for axis, name in enumerate(names):
            stored, values = lists(rows, name)
            if len(values):  # a source without heights has no z
                _require(name, np.array_equal(stored, lengths))
                fill(block, axis, start, lengths, values)
        return block

    valid, size = np.zeros(shape, np.bool_), np.zeros((*shape, 3), np.float32)
    fill_valid(valid, start, lengths, *_gaps(rows, lengths))
    for axis, name in enumerate(("length", "width", "height")):
        stored, values = lists(rows, name)
        _require(name, bool(((stored == lengths) | (stored == 1)).all()))
        fill_sizes(size, axis, valid, start, stored, values)
    return Tracks(
        ids=strings(rows, "track_id"),
        object_type=codes_of(rows.column("object_type"), ObjectType),
        position=grid("x", "y", "z"),
        heading=grid("heading")[..., 0],
        velocity=grid("vx", "vy"),
        size=size,
        valid=valid,
        source_type=strings(rows, "source_type"),
        is_size_assumed=bools(rows, "is_size_assumed"),
        is_type_assumed=bools(rows, "is_type_assumed"),
        is_velocity_estimated=bools(rows, "is_velocity_estimated"),
        extras=strings(rows, "extras"),
    )


def _spans(valid: Array) -> tuple[Array, Array]:
    """First valid step and number of steps to the last one, both (N,) int32; 0, 0 when never valid."""
    steps = valid.shape[1]
    some = valid.any(axis=1)
    start = np.where(some, valid.argmax(axis=1), 0)
    stop = np.where(some, steps - valid[:, ::-1].argmax(axis=1), 0)
    return start.astype(np.int32), (stop - start).astype(np.int32)


def _encode_size(size: Array, valid: Array, inside: Array, lengths: Array) -> pa.Array:
    """One element per track whose size never changes, else one per step of its span."""
    rows = np.arange(len(size))
    first = valid.argmax(axis=1)
    is_constant = ((size == size[rows, first][:, None]) | ~valid).all(axis=1) & (lengths > 0)
    kept = inside & ~is_constant[:, None]
    kept[rows[is_constant], first[is_constant]] = True
    return list_array(offsets_of(np.where(is_constant, 1, lengths)), size[kept])


def _encode_valid(flat_valid: Array, lengths: Array, is_gapless: Array) -> pa.Array:
    """Null where the whole span is valid."""
    kept = flat_valid[np.repeat(~is_gapless, lengths)]
    return list_array(offsets_of(np.where(is_gapless, 0, lengths)), kept, mask=is_gapless)


def _gaps(rows: Rows, lengths: Array) -> tuple[Array, Array]:
    """Which objects have gaps, and their flags, one object after the other."""
    column = rows.column("valid")
    has_gaps = column.is_valid().to_numpy(zero_copy_only=False)
    flags = column.flatten().to_numpy(zero_copy_only=False)
    _require("valid", len(flags) == lengths[has_gaps].sum())
    return has_gaps, flags


def _require(column: str, fits: bool) -> None:
    """Compiled loops do not look at bounds: what they read and write is made sure of here."""
    if not fits:
        raise LakeError(
            f"tracks.{column} does not fit the scenario's spans: its file is damaged; `scenarionet check` names every "
            "scenario that is hit; restore the file from a copy of the lake, or convert its recordings again"
        )
