"""Which rows of recorded boxes cannot be: values that are missing, or that no road user has.

The bounds are far above what sensors record, so that they find faults of the recording and not rare traffic. They are
the parameters of the check ``states_are_plausible``, too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int64

MAX_DISTANCE = 10_000.0
"""Distance from the ego [m]; sensors of cars reach some 300 m."""

MAX_SIZE = 200.0
"""Length, width or height [m]; the longest trams have 60 m, trains at level crossings are labelled in parts."""

MAX_SPEED = 150.0
"""Speed [m/s], 540 km/h."""

MAX_STOP = 5.0
"""Speed [m/s] from which no road user stops within a timestep, nor reaches it; a check has it as well."""

MAX_MAP_DISTANCE = 200_000.0
"""Distance of a point of a map from the median of its points [m]; the largest city maps have 50 km."""


class BadRows(NamedTuple):
    """Rows with one fault.

    Attributes:
        mask: (R,) whether a row has the fault.
        field: The field at fault: ``"position"``, ``"heading"``, ``"velocity"`` or ``"size"``.
        reason: What was expected, and what was found in the first of the rows.
    """

    mask: Bool
    field: str
    reason: str


def find_bad_rows(
    position: Array, heading: Array, velocity: Array | None, size: Array | None, reference: Array
) -> list[BadRows]:
    """Find rows of boxes that cannot be; each row is in one mask at most.

    Args:
        position: (R, 3) or (R, 2) [m].
        heading: (R,) [rad].
        velocity: (R, 2) [m/s]; None if the source does not record it.
        size: (R, 3) [m] length, width, height; None if the source does not record it.
        reference: (2,) or (R, 2) [m] position of the ego, in the frame of ``position``.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        distance = np.abs(position[:, :2] - reference).max(axis=1, initial=0.0)
        heights = np.abs(position[:, 2:]).max(axis=1, initial=0.0)
        faults = [
            (~np.isfinite(position).all(axis=1), "position", "expected finite metres", position),
            (
                ~((distance <= MAX_DISTANCE) & (heights <= MAX_DISTANCE)),
                "position",
                f"expected a position within {MAX_DISTANCE:,.0f} m of the ego",
                position,
            ),
            (~np.isfinite(heading), "heading", "expected finite radians", heading),
        ]
        if size is not None:
            fits = ((size > 0) & (size.astype(np.float32) > 0) & (size <= MAX_SIZE)).all(axis=1)
            faults += [(~fits, "size", f"expected a size above 0 and up to {MAX_SIZE:,.0f} m", size)]
        if velocity is not None:
            fits = (np.abs(velocity) <= MAX_SPEED).all(axis=1)
            faults += [(~fits, "velocity", f"expected a velocity of up to {MAX_SPEED:,.0f} m/s", velocity)]
    found, is_bad = [], np.zeros(len(position), np.bool_)
    for mask, field, expected, values in faults:
        new = mask & ~is_bad
        is_bad |= new
        if new.any():
            found.append(BadRows(new, field, f"{expected}, found {_shown(values[np.argmax(new)])}"))
    return found


def find_repeated_rows(track: Array, timestep: Array, kept: Bool | None = None) -> BadRows | None:
    """Find rows of a track and timestep that an earlier row has already; None if there are none.

    Args:
        track: (R,) integers.
        timestep: (R,) integers.
        kept: (R,) which rows count; all by default.
    """
    rows = np.arange(len(track)) if kept is None else np.flatnonzero(kept)
    order = rows[np.lexsort((timestep[rows], track[rows]))]  # stable: an earlier row precedes those that repeat it
    mask = np.zeros(len(track), np.bool_)
    mask[order[1:]] = (track[order[1:]] == track[order[:-1]]) & (timestep[order[1:]] == timestep[order[:-1]])
    return BadRows(mask, "timestep", "expected one row for an object and time, found another") if mask.any() else None


def find_middle(points: Array) -> Float64:
    """Median (2,) [m] of those points (P, 2 or 3) that are finite; 0, 0 without any."""
    finite = points[np.isfinite(points).all(axis=1), :2]
    return np.median(finite, axis=0) if len(finite) else np.zeros(2)


def find_jumps(position: Float64, seen: Bool, seconds: Array) -> Bool:
    """States (N, T) that cannot be reached from their neighbours at ``MAX_SPEED``.

    A state between two steps that are too fast has jumped; of a single such step, the later state, or the first of all.

    Args:
        position: (N, T, 2) [m].
        seen: (N, T).
        seconds: (T,) strictly increasing.
    """
    moved = np.hypot(*np.moveaxis(np.diff(position, axis=1), -1, 0))
    is_fast = (moved > MAX_SPEED * np.diff(seconds)) & seen[:, 1:] & seen[:, :-1]
    found = np.zeros(seen.shape, np.bool_)
    if not is_fast.any():
        return found
    found[:, 1:-1] = is_fast[:, 1:] & is_fast[:, :-1]
    single = is_fast & ~found[:, 1:] & ~found[:, :-1]
    has_before = np.zeros_like(is_fast)
    has_before[:, 1:] = seen[:, :-2]
    found[:, 1:] |= single & has_before
    found[:, :-1] |= single & ~has_before
    return found


def find_dead_ends(
    position: Array, velocity: Array, valid: Bool, seconds: Array, fastest: float = MAX_STOP
) -> tuple[Int64, Int64, Int64]:
    """Find velocities of exactly 0 in the first and last state of objects that move there.

    Args:
        position: (N, T, 2 or more) [m].
        velocity: (N, T, 2) [m/s].
        valid: (N, T).
        seconds: (T,) strictly increasing.
        fastest: Speed [m/s] that the neighbouring state, and the step between the two, have to exceed.

    Returns:
        Object and timestep of each such state, and the timestep of the neighbouring one.
    """
    rows = np.tile(np.flatnonzero(valid.any(axis=1)), 2)
    first, last = valid.argmax(axis=1), valid.shape[1] - 1 - valid[:, ::-1].argmax(axis=1)
    end = np.where(np.arange(len(rows)) < len(rows) // 2, first[rows], last[rows])
    near = np.clip(np.where(np.arange(len(rows)) < len(rows) // 2, end + 1, end - 1), 0, valid.shape[1] - 1)
    moved = np.hypot(*np.moveaxis(position[rows, near, :2] - position[rows, end, :2], -1, 0))
    is_moving = np.hypot(*np.moveaxis(velocity[rows, near], -1, 0)) > fastest
    is_moving &= moved > fastest * np.abs(seconds[near] - seconds[end])
    chosen = is_moving & valid[rows, near] & ~velocity[rows, end].any(axis=-1)
    return rows[chosen], end[chosen], near[chosen]


def find_bad_geometry(points: Array, centre: Array) -> str | None:
    """Return why the points of a map feature cannot be: what was expected and found. None if they can.

    Args:
        points: (P, 2) or (P, 3) [m].
        centre: (2,) [m] of the map, see ``MAX_MAP_DISTANCE``.
    """
    is_bad = ~np.isfinite(points).all(axis=1)
    if is_bad.any():
        return f"expected finite metres, found {_shown(points[np.argmax(is_bad)])}"
    is_far = np.abs(points[:, :2] - centre).max(axis=1, initial=0.0) > MAX_MAP_DISTANCE
    if is_far.any():
        limit = f"{MAX_MAP_DISTANCE:,.0f} m"
        return f"expected points within {limit} of the map's centre, found {_shown(points[np.argmax(is_far)])}"
    return None


def _shown(values: Array) -> str:
    return ", ".join("no number" if np.isnan(value) else f"{value:g}" for value in np.atleast_1d(values))
