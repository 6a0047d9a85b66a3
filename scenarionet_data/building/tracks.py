"""Build canonical tracks from a source's grid of states, or from a list of states placed on one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64
from scenarionet_data.building import kernels
from scenarionet_data.building.precision import METRES, RADIANS
from scenarionet_data.scenario.canonical_json import to_json
from scenarionet_data.scenario.description import Tracks, strings

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
    shapes = [(*valid.shape, 3), valid.shape, (*valid.shape, 2)]
    source = [
        _source(values, shape, np.float64) for values, shape in zip((position, heading, velocity), shapes, strict=True)
    ]
    poses = tuple(np.zeros(shape, np.float32) for shape in shapes)
    none = np.full(len(ids), None, dtype=object)

    def flags(values: npt.ArrayLike) -> Bool:
        return np.array(np.broadcast_to(np.asarray(values, dtype=np.bool_), (len(ids),)))

    kernels.fill_poses(source[0], source[1], source[2], valid, origin, _STEPS, poses)
    return Tracks(
        position=poses[0],
        heading=poses[1],
        velocity=poses[2],
        size=_sizes(np.asarray(size), valid),
        valid=valid,
        is_interpolated=valid & np.asarray(is_interpolated, np.bool_),
        ids=strings(ids),
        object_type=np.asarray(object_type, dtype=np.uint8),
        source_type=none if source_type is None else np.array(source_type, dtype=object),
        is_size_assumed=flags(is_size_assumed),
        is_type_assumed=flags(is_type_assumed),
        is_velocity_estimated=flags(is_velocity_estimated),
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


def _sizes(size: Array, valid: Bool) -> Float32:
    """Round sizes that vary over time; keep constant ones exactly."""
    shape = (*valid.shape, 3)
    sizes = np.zeros(shape, np.float32)
    with np.errstate(over="ignore"):  # overflow becomes infinity, which validation reports
        source = _source(size[:, None, :] if size.ndim == 2 else size, shape, np.float32)
    kernels.fill_sizes(source, valid, np.float32(METRES), sizes)
    return sizes


def _source(values: npt.ArrayLike, shape: tuple[int, ...], kind: type[Float]) -> npt.NDArray[Float]:
    """Input of a kernel: contiguous and read-only, so that one compiled signature serves all converters."""
    source = np.ascontiguousarray(np.broadcast_to(values, shape), kind)
    source.flags.writeable = False
    return source
