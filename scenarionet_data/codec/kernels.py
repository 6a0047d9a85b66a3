"""Compiled loops of decoding and encoding; they do not check their arguments."""

from __future__ import annotations

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Array


@kernel(nogil=True, allocates=False)
def fill_states(
    first: int, start: Array, lengths: Array, at: int, at_z: int, inputs: tuple[Array, ...], outputs: tuple[Array, ...]
) -> None:
    """Scatter the lists of a scenario's objects to their timesteps: ``position[i, start[i] + k]`` is element ``k``.

    Args:
        first: Row of the scenario's first object.
        start: (rows,) int32 timestep of each list's first element.
        lengths: (rows,) int32.
        at: Offset of the first object's elements.
        at_z: The same for ``z``; negative for a scenario without heights.
        inputs: Elements of the lists: float32 x, y, z, heading, vx, vy.
        outputs: (N, T, 3) position, (N, T) heading, (N, T, 2) velocity, float32 zeros, filled.
    """
    x, y, z, heading, vx, vy = inputs
    position, headings, velocity = outputs
    for row in range(len(headings)):
        begin = start[first + row]
        for step in range(begin, begin + lengths[first + row]):
            position[row, step, 0] = x[at]
            position[row, step, 1] = y[at]
            position[row, step, 2] = 0 if at_z < 0 else z[at_z]
            headings[row, step] = heading[at]
            velocity[row, step, 0] = vx[at]
            velocity[row, step, 1] = vy[at]
            at += 1
            at_z += at_z >= 0


@kernel(nogil=True, allocates=False)
def fill_flags(
    first: int, start: Array, lengths: Array, num_flags: Array, at: int, flags: Array, default: bool, out: Array
) -> None:
    """Fill the flags of each span: the listed ones, or ``default`` where there is no list.

    Args:
        first, start, lengths: As in :func:`fill_states`.
        num_flags: (rows,) int32 length of the span, or 0.
        at: Offset of the first object's flags.
        flags: bool.
        default: Flag of the spans without a list.
        out: (N, T) bool, all False, filled.
    """
    for row in range(len(out)):
        begin = start[first + row]
        has_flags = num_flags[first + row] > 0
        for step in range(begin, begin + lengths[first + row]):
            out[row, step] = flags[at] if has_flags else default
            at += has_flags


@kernel(nogil=True, allocates=False)
def fill_sizes(
    first: int, start: Array, spans: Array, lengths: Array, at: int, values: Array, valid: Array, size: Array, axis: int
) -> None:
    """Fill extents at the valid timesteps; a list of one element holds at all of them.

    Args:
        first, start: As in :func:`fill_states`.
        spans: (rows,) int32 timesteps from the first valid one to the last.
        lengths: (rows,) int32: 1, or the length of the span.
        at: Offset of the first object's elements.
        values: float32 elements.
        valid: (N, T) bool.
        size: (N, T, 3) float32 zeros, filled along ``axis``.
    """
    for row in range(len(valid)):
        begin, length = start[first + row], lengths[first + row]
        step_size = 0 if length == 1 else 1
        for step in range(begin, begin + spans[first + row]):
            if valid[row, step]:
                size[row, step, axis] = values[at + step_size * (step - begin)]
        at += length


@kernel(nogil=True)
def find_bounds(offsets: Array, points: Array, bounds: Array) -> None:
    """Extend each row's bounding box by the points of its list.

    Args:
        offsets: (M + 1,) int32, see ``Ragged``.
        points: (P, 3) float32.
        bounds: (M, 4) float32 min_x, min_y, max_x, max_y, extended; NaN without points.
    """
    for row in range(len(offsets) - 1):
        for point in range(offsets[row], offsets[row + 1]):
            for axis in range(2):
                value = points[point, axis]
                # "not >=" rather than "<": the first point replaces NaN.
                if not value >= bounds[row, axis]:
                    bounds[row, axis] = value
                if not value <= bounds[row, axis + 2]:
                    bounds[row, axis + 2] = value
