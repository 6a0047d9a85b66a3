"""The motion of objects from their positions, as a function ``track_motion`` of SQL."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64

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
    first, last = (np.cumsum(count) - count)[track], (np.cumsum(count) - 1)[track]
    here = np.arange(len(track))
    before, after = np.maximum(here - 1, first), np.minimum(here + 1, last)
    between = seconds[after] - seconds[before]
    between[between == 0] = np.inf  # of a single observation: no rate

    vx, vy = ((each[after] - each[before]) / between for each in (box_x, box_y))
    ax, ay = ((each[after] - each[before]) / between for each in (vx, vy))
    turned = angle[after] - angle[before]
    yaw_rate = (turned - 2 * np.pi * np.floor((turned + np.pi) / (2 * np.pi))) / between
    near = [np.clip(here + shift, first, last) for shift in range(-3, 4)]
    smoothed = [_median_of_seven([each[at] for at in near]) for each in (box_x, box_y, vx, vy, ax, ay, height)]

    lists = [timestep.astype(np.int32), seconds, *smoothed[:-1], yaw_rate, box_x, box_y, angle]
    offsets = pa.array(np.append(0, np.cumsum(count)).astype(np.int32))
    columns = [pa.ListArray.from_arrays(offsets, pa.array(each)) for each in lists]
    is_seen = count > 0
    starts, extent = (np.cumsum(count) - count)[is_seen], np.zeros(len(count))
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


def _median_of_seven(v: Sequence[Float64]) -> Float64:
    """Return the median of seven arrays, element by element.

    Of two sorted triples, the k-th number is the least, over i + j = k, of the greater one of the i-th of one and the
    j-th of the other; the median lies between the third and the fourth.
    """
    (a, b, c), (d, e, f) = _sorted(*v[:3]), _sorted(*v[4:])
    third = np.minimum(np.minimum(c, f), np.minimum(np.maximum(a, e), np.maximum(b, d)))
    fourth = np.minimum(np.maximum(a, f), np.minimum(np.maximum(c, d), np.maximum(b, e)))
    median: Float64 = np.maximum(third, np.minimum(v[3], fourth))
    return median


def _sorted(a: Float64, b: Float64, c: Float64) -> tuple[Float64, Float64, Float64]:
    low, high = np.minimum(a, b), np.maximum(a, b)
    return np.minimum(low, c), np.maximum(low, np.minimum(high, c)), np.maximum(high, c)
