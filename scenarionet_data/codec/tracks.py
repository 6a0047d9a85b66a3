"""Encode tracks as table rows, and decode them. Lists cover the span from the first to the last valid timestep."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np
import pyarrow as pa

from scenarionet_data.arrays.columns import chosen, offsets_of
from scenarionet_data.arrays.dtypes import Array
from scenarionet_data.codec.arrow import batch, list_array, names_of, string_array
from scenarionet_data.codec.check_kernels import TRACK_LISTS, check_lengths, check_spans
from scenarionet_data.codec.stored_part import STEPS, ScenarioColumns, StoredPart
from scenarionet_data.codec.track_kernels import fill_tracks
from scenarionet_data.scenario.description import Tracks
from scenarionet_data.scenario.vocabulary import ObjectType


def encode_tracks(scenario_id: str, tracks: Tracks, has_z: bool) -> pa.RecordBatch:
    """Encode a scenario's tracks as rows."""
    count, steps = tracks.valid.shape
    start, lengths = _spans(tracks.valid)
    time = np.arange(steps, dtype=np.int32)
    inside = (time >= start[:, None]) & (time < (start + lengths)[:, None])
    offsets = offsets_of(lengths)

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
        "valid": _encode_flags(tracks.valid[inside], lengths, default=True),
        "source_type": string_array(tracks.source_type).dictionary_encode(),
        "is_size_assumed": pa.array(tracks.is_size_assumed),
        "is_type_assumed": pa.array(tracks.is_type_assumed),
        "is_velocity_estimated": pa.array(tracks.is_velocity_estimated),
        "is_interpolated": _encode_flags(tracks.is_interpolated[inside], lengths, default=False),
        "extras": string_array(tracks.extras),
    }
    return batch("tracks", columns)


class StoredTracks(StoredPart):
    """Tracks in memory; see ``Tracks`` for the shapes."""

    table = "tracks"
    columns = (
        *TRACK_LISTS,
        "start",
        "object_type",
        "is_size_assumed",
        "is_type_assumed",
        "is_velocity_estimated",
        "source_type",
    )
    words: ClassVar = {"object_type": ObjectType}
    fill = fill_tracks
    expected = "does not match the scenario's spans"
    arrays: ClassVar = {
        "position": (np.float32, "rows", (STEPS, 3)),
        "velocity": (np.float32, "rows", (STEPS, 2)),
        "size": (np.float32, "rows", (STEPS, 3)),
        "heading": (np.float32, "rows", (STEPS,)),
        "source_type": (np.int32, "rows", ()),
        "valid": (np.bool_, "rows", (STEPS,)),
        "is_interpolated": (np.bool_, "rows", (STEPS,)),
        "object_type": (np.uint8, "rows", ()),
        "is_size_assumed": (np.bool_, "rows", ()),
        "is_type_assumed": (np.bool_, "rows", ()),
        "is_velocity_estimated": (np.bool_, "rows", ()),
    }
    texts: ClassVar = {"ids": "track_id", "extras": "extras"}

    def __getitem__(self, field: str) -> Any:
        found = super().__getitem__(field)
        return chosen(self.dictionaries[field], found) if field == "source_type" else found


def check_lists(rows: ScenarioColumns, steps: Sequence[int], names: tuple[str, ...]) -> None:
    """Raise unless lists are as long as their spans, and spans are within their scenarios.

    Args:
        rows: Rows of the tracks table.
        steps: (scenarios) number of timesteps.
        names: Columns of lists.

    Raises:
        LakeError: They are not: the file is damaged.
    """
    block, layout, bounds = rows.columns.block, rows.columns.layout, np.array(rows.bounds)
    is_inside = check_spans(block, layout.place("start"), layout.place("x"), bounds, np.array(steps))
    if not is_inside:
        raise StoredTracks.damage("start")
    others, likes = np.array([TRACK_LISTS[name] for name in names]), layout.places(("x",) * len(names))
    differs = check_lengths(block, likes, layout.places(names), others, bounds)
    if differs < len(names):
        raise StoredTracks.damage(names[differs])


def _spans(valid: Array) -> tuple[Array, Array]:
    """First valid timestep and length of the span to the last one, both (N,) int32; 0 and 0 when never valid."""
    steps = valid.shape[1]
    some = valid.any(axis=1)
    start = np.where(some, valid.argmax(axis=1), 0)
    stop = np.where(some, steps - valid[:, ::-1].argmax(axis=1), 0)
    return start.astype(np.int32), (stop - start).astype(np.int32)


def _encode_size(size: Array, valid: Array, inside: Array, lengths: Array) -> pa.Array:
    """Lists of one element for tracks of constant size, else of one element per timestep of the span."""
    rows = np.arange(len(size))
    first = valid.argmax(axis=1)
    is_constant = ((size == size[rows, first][:, None]) | ~valid).all(axis=1) & (lengths > 0)
    kept = inside & ~is_constant[:, None]
    kept[rows[is_constant], first[is_constant]] = True
    return list_array(offsets_of(np.where(is_constant, 1, lengths)), size[kept])


def _encode_flags(flags: Array, lengths: Array, *, default: bool) -> pa.Array:
    """Lists of flags; null where the whole span has the default."""
    offsets, others = offsets_of(lengths), offsets_of(flags != default)
    is_uniform = others[offsets[1:]] == others[offsets[:-1]]
    kept = flags[np.repeat(~is_uniform, lengths)]
    return list_array(offsets_of(np.where(is_uniform, 0, lengths)), kept, mask=is_uniform)
