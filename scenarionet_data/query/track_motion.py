"""The motion of objects from their positions, as a function ``track_motion`` of SQL."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.query.motion_kernels import mark_turns, smooth

ArrowColumn: TypeAlias = pa.Array | pa.ChunkedArray

_SMOOTHED = ("x", "y", "vx", "vy", "accel_x", "accel_y")
_LISTS = (
    {"timestep": "INTEGER[]"}
    | dict.fromkeys(
        (
            *(
                "seconds",
                *_SMOOTHED,
                "yaw_rate",
                "speed",
                "course",
                "box_x",
                "box_y",
                "heading",
                "heading_x",
                "heading_y",
            ),
            *("length", "width", "radius"),
        ),
        "DOUBLE[]",
    )
    | {"turning": "UTINYINT[]"}
)
_STATES = ("x", "y", "z", "heading", "length", "width")
PARAMETERS = (
    f"STRUCT({', '.join(f'{name} FLOAT[]' for name in _STATES)})",
    "BOOLEAN[]",
    "INTEGER",
    "DOUBLE[]",
    "DOUBLE",
)
_WHOLE = ("extent", "min_x", "max_x", "min_y", "max_y", "longest")
RETURNS = f"STRUCT({', '.join(f'{name} {kind}' for name, kind in (_LISTS | dict.fromkeys(_WHOLE, 'DOUBLE')).items())})"
"""Types in SQL."""


def track_motion(
    states: pa.ChunkedArray, valid: ArrowColumn, start: ArrowColumn, timestamps: ArrowColumn, dt: ArrowColumn
) -> pa.StructArray:
    """Return the motion of objects at the timesteps at which they were observed; see the view ``smoothed``.

    Args:
        states: Of N objects by name the lists x, y, z, heading over their spans [m, rad], z null where no heights are
            recorded; and length and width, over the same spans, or of the one size that they have at all times [m].
        valid: Lists of which steps were observed; null for all of them.
        start: First timestep of each span.
        timestamps: Times of the scenario's timesteps [s]; null if they are ``dt`` apart.
        dt: Time between two timesteps [s].

    Returns:
        For each object lists of ``timestep``, ``seconds``, smoothed ``x``, ``y``, ``vx``, ``vy``, ``accel_x`` and
        ``accel_y`` [m, m/s, m/s^2], ``yaw_rate`` [rad/s], ``speed`` [m/s] and ``course`` [rad]; of its box as recorded
        ``box_x``, ``box_y``, ``heading``, the same as a vector, ``length``, ``width``, ``radius``; and ``turning``, 1
        where it turns left, 2 where right, 3 for both; and numbers [m]: ``extent``, the diagonal of the box around all
        its smoothed positions, ``min_x``, ``max_x``, ``min_y``, ``max_y`` of these and of the recorded ones, and its
        ``longest`` length.
    """
    x, y, z, heading, length, width = (states.combine_chunks().field(name) for name in _STATES)
    spans = _lengths(x)
    track = np.repeat(np.arange(len(spans)), spans)
    place = np.arange(len(track)) - (np.cumsum(spans) - spans)[track]
    observed = _values(valid, spans, True).astype(np.bool_)
    track, place = track[observed], place[observed]
    box_x, box_y, height, angle = (_values(each, spans, 0.0)[observed] for each in (x, y, z, heading))
    timestep = start.to_numpy()[track] + place
    seconds = _times(timestamps, dt, track, timestep)

    count = np.bincount(track, minlength=len(spans))
    ends = np.append(0, np.cumsum(count))
    rates, smoothed = np.empty((3, len(track))), np.empty((7, len(track)))
    smooth(ends, seconds, np.stack([box_x, box_y, height, angle]), rates, smoothed)

    turning = np.empty(len(track), np.uint8)
    mark_turns(ends, seconds, rates[2], turning)
    vx, vy = smoothed[2:4]
    sizes = [_sizes(each, track, place) for each in (length, width)]
    lists = [
        timestep.astype(np.int32),
        seconds,
        *smoothed[:-1],
        rates[2],
        np.sqrt(vx * vx + vy * vy),
        np.arctan2(vy, vx),
    ]
    lists += [box_x, box_y, angle, np.cos(angle), np.sin(angle)]
    lists += [*sizes, np.sqrt(sizes[0] * sizes[0] + sizes[1] * sizes[1]) / 2, turning]
    offsets = pa.array(ends.astype(np.int32))
    columns = [pa.ListArray.from_arrays(offsets, pa.array(each, from_pandas=True)) for each in lists]
    is_seen = count > 0
    whole = np.zeros((len(_WHOLE), len(count)))
    if len(track):
        starts, (x, y) = ends[:-1][is_seen], smoothed[:2]
        for axis in (x, y, smoothed[-1]):
            whole[0, is_seen] += (np.maximum.reduceat(axis, starts) - np.minimum.reduceat(axis, starts)) ** 2
        whole[0] = np.sqrt(whole[0])
        for row, outermost, pair in (
            (1, np.minimum, (x, box_x)), (2, np.maximum, (x, box_x)),
            (3, np.minimum, (y, box_y)), (4, np.maximum, (y, box_y)), (5, np.fmax, sizes[:1]),
        ):  # fmt: skip
            whole[row, is_seen] = outermost.reduce([outermost.reduceat(each, starts) for each in pair])
    columns += [pa.array(each, mask=~is_seen | np.isnan(each)) for each in whole]
    return pa.StructArray.from_arrays(columns, [*_LISTS, *_WHOLE])


def _lengths(lists: ArrowColumn) -> Int64:
    """Lengths of lists, 0 of null."""
    found: Int64 = pc.fill_null(pc.list_value_length(lists), 0).to_numpy().astype(np.int64)
    return found


def _values(lists: ArrowColumn, spans: Int64, default: float) -> Float64:
    """The elements of lists of such lengths, with a default for lists and elements that are null."""
    values = np.full(spans.sum(), default)
    given = pc.fill_null(pc.cast(pc.list_flatten(lists), pa.float64()), default)
    values[np.repeat(_lengths(lists) > 0, spans)] = given.to_numpy()
    return values


def _sizes(lists: ArrowColumn, track: Int64, place: Int64) -> Float64:
    """The elements of lists at some places, the last one beyond their end; NaN of empty lists."""
    lengths = _lengths(lists)
    values = np.append(pc.cast(pc.list_flatten(lists), pa.float64()).to_numpy(), np.nan)
    ends = np.cumsum(lengths)
    at = np.minimum((ends - lengths)[track] + place, ends[track] - 1)
    found: Float64 = values[np.where(lengths[track] > 0, at, -1)]
    return found


def _times(timestamps: ArrowColumn, dt: ArrowColumn, track: Int64, timestep: Int64) -> Float64:
    """The times of timesteps [s]; their number times ``dt`` where none are recorded."""
    recorded = _lengths(timestamps)
    times: Float64 = timestep * dt.to_numpy()[track]
    is_recorded: Bool = timestep < recorded[track]
    at = (np.cumsum(recorded) - recorded)[track] + timestep
    times[is_recorded] = pc.list_flatten(timestamps).to_numpy()[at[is_recorded]]
    return times
