"""Build canonical tracks from a source's grid of states, or from a list of states placed on one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.canonical_json import to_json
from scenarionet_data.scenario.description import Tracks, strings

METRES = 2.0**-14
"""Rounding step of positions and speeds: 0.06 mm, the resolution of float32 at 500 m from the origin."""

WIDTHS = 2.0**-10
"""Rounding step of lane widths given per point: 1 mm."""

RADIANS = 2.0**-20
"""Rounding step of headings: 1e-6 rad."""

_STEPS = np.array([METRES, RADIANS], np.float32)

Float = TypeVar("Float", np.float32, np.float64)


def make_tracks(
    ids: Sequence[str],
    object_type: npt.ArrayLike,
    position: Array,
    heading: Array,
    velocity: Array,
    size: Array,
    valid: Array,
    *,
    origin: Float64,
    source_type: Sequence[str | None] | None = None,
    is_size_assumed: npt.ArrayLike = False,
    is_type_assumed: npt.ArrayLike = False,
    is_velocity_estimated: npt.ArrayLike = False,
    is_interpolated: npt.ArrayLike = False,
    extras: Sequence[Mapping[str, Any] | None] | None = None,
) -> Tracks:
    """Build canonical tracks from arrays in the source frame.

    Args:
        ids: (N,).
        object_type: (N,) codes of ``ObjectType``.
        position: (N, T, 3) float64 [m], source frame.
        heading: (N, T) [rad], not necessarily wrapped.
        velocity: (N, T, 2) [m/s].
        size: (N, T, 3) or (N, 3) [m] length, width, height.
        valid: (N, T); values at other states are ignored.
        origin: (3,) float64 [m].
        source_type: (N,) type names of the source.
        is_size_assumed, is_type_assumed, is_velocity_estimated: (N,) or one bool for all.
        is_interpolated: (N, T), (T,) or one bool: states between the recorded times.
        extras: (N,) JSON-serialisable mappings.
    """
    valid = np.ascontiguousarray(valid, dtype=np.bool_)
    if valid.ndim != 2:
        raise BadParameter(f"valid: expected truth values of shape (objects, timesteps), found shape {valid.shape}")
    position = _source(position, (*valid.shape, 3), np.float64)
    heading = _source(heading, valid.shape, np.float64)
    velocity = _source(velocity, (*valid.shape, 2), np.float64)
    poses = tuple(np.zeros(array.shape, np.float32) for array in (position, heading, velocity))
    fill_poses(position, heading, velocity, valid, origin, _STEPS, poses)
    codes = np.asarray(object_type)
    if codes.dtype.kind not in "iuf":
        raise BadParameter(f"object_type={object_type!r}; expected codes, such as [ObjectType.VEHICLE]")
    size, sizes = np.asarray(size), np.zeros(position.shape, np.float32)
    with np.errstate(over="ignore"):  # overflow becomes infinity, which validation reports
        size = _source(size[:, None, :] if size.ndim == 2 else size, position.shape, np.float32)
    fill_sizes(size, valid, np.float32(METRES), sizes)
    flags = np.empty((3, len(ids)), np.bool_)
    flags[0], flags[1], flags[2] = is_size_assumed, is_type_assumed, is_velocity_estimated
    none = np.full(len(ids), None, dtype=object)
    return Tracks(
        position=poses[0],
        heading=poses[1],
        velocity=poses[2],
        size=sizes,
        valid=valid,
        is_interpolated=valid & np.asarray(is_interpolated, np.bool_),
        ids=strings(ids),
        object_type=codes.astype(np.uint8),
        source_type=none if source_type is None else np.array(source_type, dtype=object),
        is_size_assumed=flags[0],
        is_type_assumed=flags[1],
        is_velocity_estimated=flags[2],
        extras=none if extras is None else np.array([to_json(each) for each in extras], dtype=object),
    )


class StateGrid:
    """Grid of N tracks and T timesteps for sources that list R rows of one observed state each.

    Args:
        track, timestep: (R,) indices of each row; pairs are unique.
        shape: N, T.

    Attributes:
        valid: (N, T) whether the cell has a row.
    """

    def __init__(self, track: Array, timestep: Array, shape: tuple[int, int]) -> None:
        self._cell = track * shape[1] + timestep
        self.valid: Bool = np.zeros(shape, np.bool_)
        self.valid.reshape(-1)[self._cell] = True

    def place(self, values: Array) -> Array:
        """Scatter values (R, ...) of rows to (N, T, ...), 0 elsewhere."""
        cells = np.zeros((self.valid.size, *values.shape[1:]), values.dtype)
        cells[self._cell] = values
        return cells.reshape(*self.valid.shape, *values.shape[1:])


def _source(values: npt.ArrayLike, shape: tuple[int, ...], kind: type[Float]) -> npt.NDArray[Float]:
    """Input of a kernel: contiguous and read-only, so that one compiled signature serves all converters."""
    try:
        source = np.ascontiguousarray(np.broadcast_to(values, shape), kind)
    except (TypeError, ValueError) as error:
        raise BadParameter(f"states of tracks: expected numbers of shape {shape}, found {np.shape(values)}") from error
    source.flags.writeable = False
    return source


_PI = np.pi
_BELOW_PI = np.nextafter(np.float32(np.pi), np.float32(0.0))


@kernel
def fill_poses(
    position: Array, heading: Array, velocity: Array, valid: Array, origin: Array, steps: Array, outs: tuple[Array, ...]
) -> None:
    """Fill positions, headings and velocities in canonical form, at valid states only.

    Args:
        position: (N, T, 3) float64 [m], source frame.
        heading: (N, T) float64 [rad], not necessarily wrapped.
        velocity: (N, T, 2) float64 [m/s].
        valid: (N, T) bool.
        origin: (3,) float64 [m].
        steps: (2,) float32 rounding steps of metres and radians, powers of two.
        outs: The same three as float32; zeros on entry.
    """
    metres, radians = steps[0], steps[1]
    for row in range(valid.shape[0]):
        for step in range(valid.shape[1]):
            if not valid[row, step]:
                continue
            for axis in range(3):
                outs[0][row, step, axis] = _rounded(position[row, step, axis] - origin[axis], metres)
            for axis in range(2):
                outs[2][row, step, axis] = _rounded(velocity[row, step, axis], metres)
            turned = _rounded(_wrapped(heading[row, step]), radians)
            outs[1][row, step] = min(max(turned, -np.float32(_PI)), _BELOW_PI) if turned == turned else turned


@kernel
def fill_sizes(size: Array, valid: Array, metres: np.float32, out: Array) -> None:
    """Fill sizes at valid states: exact for objects of constant size, else rounded.

    Args:
        size: (N, T, 3) float32 [m].
        valid: (N, T) bool.
        metres: Rounding step, a power of two.
        out: (N, T, 3) float32; zeros on entry.
    """
    for row in range(valid.shape[0]):
        first, is_changing = -1, False
        for step in range(valid.shape[1]):
            if valid[row, step]:
                first = step if first < 0 else first
                for axis in range(3):
                    is_changing = is_changing or size[row, step, axis] != size[row, first, axis]
        for step in range(valid.shape[1]):
            if valid[row, step]:
                for axis in range(3):
                    value = size[row, step, axis]
                    out[row, step, axis] = _rounded(value, metres) if is_changing else value


@device_function
def _rounded(value: float, step: np.float32) -> np.float32:
    """Round to a multiple of ``step`` (a power of two), as float32, without negative zeros."""
    return np.float32(np.rint(np.float32(value) * (np.float32(1.0) / step)) * step) + np.float32(0.0)


@device_function
def _wrapped(angle: float) -> float:
    if -_PI <= angle < _PI:
        return angle
    turned: float = angle - 2 * _PI * np.floor((angle + _PI) / (2 * _PI))  # NaN for infinity
    return turned


def rounded(values: npt.ArrayLike, step: float) -> Float32:
    """Round to multiples of ``step``, as float32.

    Digits below the precision of any sensor would take up a fifth of the lake.
    """
    with np.errstate(over="ignore"):  # overflow becomes infinity, which validation reports
        array = np.array(values, dtype=np.float32)
        array *= np.float32(1.0 / step)  # a power of two: exact
        np.rint(array, out=array)
        array *= np.float32(step)
    return array


def make_origin(position: Array, valid: Bool, has_z: bool) -> Float64:
    """Return the origin of a scenario: the ego's first valid position rounded to whole metres.

    Args:
        position: (T, 3) ego positions in the source frame [m].
        valid: (T,).
        has_z: If False, the origin's z is 0.

    Returns:
        (3,) float64 [m].
    """
    position = np.asarray(position, dtype=np.float64)
    if position.shape != (len(position) if position.ndim else 0, 3):
        raise BadParameter(f"position: expected the ego's (timesteps, 3), found shape {position.shape}")
    first = np.round(position[int(np.argmax(valid))])
    return np.array([first[0], first[1], first[2] if has_z else 0.0], dtype=np.float64) + 0.0


def offsets_from(origin: Float64, points: Array) -> Float32:
    """Return points (..., 3) as float32 offsets, subtracted in float64 without a float64 copy."""
    offsets = np.empty(points.shape, np.float32)
    with np.errstate(over="ignore"):  # overflow becomes infinity, which validation reports
        np.subtract(points, origin, out=offsets, casting="same_kind")
    return offsets
