"""The motion of objects from their positions, as a function ``track_motion`` of SQL."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.query.motion_kernels import smooth

ArrowColumn: TypeAlias = pa.Array | pa.ChunkedArray

_SMOOTHED = ("x", "y", "vx", "vy", "accel_x", "accel_y")
_LISTS = {"timestep": "INTEGER[]"} | dict.fromkeys(
    ("seconds", *_SMOOTHED, "yaw_rate", "box_x", "box_y", "heading"), "DOUBLE[]"
)
PARAMETERS = ("FLOAT[]", "FLOAT[]", "FLOAT[]", "FLOAT[]", "BOOLEAN[]", "INTEGER", "DOUBLE[]", "DOUBLE")
RETURNS = f"STRUCT({', '.join(f'{name} {kind}' for name, kind in _LISTS.items())}, extent DOUBLE)"
"""Types in SQL."""


def track_motion(
    x: ArrowColumn,
    y: ArrowColumn,
    z: ArrowColumn,
    heading: ArrowColumn,
    valid: ArrowColumn,
    start: ArrowColumn,
    timestamps: ArrowColumn,
    dt: ArrowColumn,
) -> pa.StructArray:
    """Return the motion of objects at the timesteps at which they were observed; see the view ``smoothed``.

    Args:
        x, y, z, heading: Lists over the spans of N objects [m, rad]; z is null where no heights are recorded.
        valid: Lists of which steps were observed; null for all of them.
        start: First timestep of each span.
        timestamps: Times of the scenario's timesteps [s]; null if they are ``dt`` apart.
        dt: Time between two timesteps [s].

    Returns:
        For each object lists of ``timestep``, ``seconds``, smoothed ``x``, ``y``, ``vx``, ``vy``, ``accel_x`` and
        ``accel_y`` [m, m/s, m/s^2], ``yaw_rate`` [rad/s], and as recorded ``box_x``, ``box_y`` and ``heading``; and
        ``extent`` [m], the diagonal of the box around all its smoothed positions.
    """
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

    lists = [timestep.astype(np.int32), seconds, *smoothed[:-1], rates[2], box_x, box_y, angle]
    offsets = pa.array(ends.astype(np.int32))
    columns = [pa.ListArray.from_arrays(offsets, pa.array(each)) for each in lists]
    is_seen = count > 0
    starts, extent = ends[:-1][is_seen], np.zeros(len(count))
    for axis in (smoothed[0], smoothed[1], smoothed[-1]) if len(track) else ():
        extent[is_seen] += (np.maximum.reduceat(axis, starts) - np.minimum.reduceat(axis, starts)) ** 2
    return pa.StructArray.from_arrays([*columns, pa.array(np.sqrt(extent), mask=~is_seen)], [*_LISTS, "extent"])


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


def _times(timestamps: ArrowColumn, dt: ArrowColumn, track: Int64, timestep: Int64) -> Float64:
    """The times of timesteps [s]; their number times ``dt`` where none are recorded."""
    recorded = _lengths(timestamps)
    times: Float64 = timestep * dt.to_numpy()[track]
    is_recorded: Bool = timestep < recorded[track]
    at = (np.cumsum(recorded) - recorded)[track] + timestep
    times[is_recorded] = pc.list_flatten(timestamps).to_numpy()[at[is_recorded]]
    return times
