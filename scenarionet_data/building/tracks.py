"""Tracks in canonical form, from a source's grid of states or from its list of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict, TypeVar, Unpack

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.building import kernels
from scenarionet_data.building.precision import METRES, RADIANS, offsets_from, rounded
from scenarionet_data.scenario.canonical_json import to_json
from scenarionet_data.scenario.description import Tracks, strings

_STEPS = np.array([METRES, RADIANS], np.float32)
_PI = np.float32(np.pi)
_BELOW_PI = np.nextafter(_PI, np.float32(0.0))

Number = TypeVar("Number", np.float32, np.float64)


class TrackFacts(TypedDict, total=False):
    """What may be said of each track besides its states.

    Attributes:
        source_type: (N,) the source's own words.
        is_size_assumed, is_type_assumed, is_velocity_estimated: (N,) or one bool for all; False unless given.
        extras: (N,) JSON-able mappings.
    """

    source_type: Sequence[str | None] | None
    is_size_assumed: npt.ArrayLike
    is_type_assumed: npt.ArrayLike
    is_velocity_estimated: npt.ArrayLike
    extras: Sequence[Mapping[str, Any] | None] | None


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
    **facts: Unpack[TrackFacts],
) -> Tracks:
    """Tracks in canonical form from arrays in the source frame.

    Args:
        ids: (N,).
        object_type: (N,) codes of ``ObjectType``.
        position: (N, T, 3) float64 [m], source frame.
        heading: (N, T) [rad], any turn.
        velocity: (N, T, 2) [m/s].
        size: (N, T, 3) or (N, 3) [m] length, width, height.
        valid: (N, T); values elsewhere are dropped, whatever they are.
        origin: (3,) float64 [m].
        **facts: See :class:`TrackFacts`.
    """
    valid = np.ascontiguousarray(valid, dtype=np.bool_)
    shapes = [(*valid.shape, 3), valid.shape, (*valid.shape, 2)]
    source = [
        _source(values, shape, np.float64) for values, shape in zip((position, heading, velocity), shapes, strict=True)
    ]
    poses = tuple(np.zeros(shape, np.float32) for shape in shapes)
    kernels.fill_poses(source[0], source[1], source[2], valid, origin, _STEPS, poses)
    return Tracks(
        position=poses[0],
        heading=poses[1],
        velocity=poses[2],
        size=_sizes(np.asarray(size), valid),
        valid=valid,
        **_told(ids, object_type, facts),
    )


def make_tracks_of_rows(
    ids: Sequence[str],
    object_type: npt.ArrayLike,
    position: Array,
    heading: Array,
    velocity: Array,
    size: Array,
    track: Array,
    timestep: Array,
    num_timesteps: int,
    *,
    origin: Float64,
    **facts: Unpack[TrackFacts],
) -> Tracks:
    """What :func:`make_tracks` makes, from R rows of one observed state each.

    For sources that list states: when most tracks are short, arithmetic on the whole grid of tracks and timesteps
    would be spent on nothing.

    Args:
        ids, object_type, origin: As there.
        position: (R, 3) float64 [m], source frame.
        heading: (R,) [rad], any turn.
        velocity: (R, 2) [m/s].
        size: (R, 3) [m] length, width, height.
        track, timestep: (R,) where each row stands; no two stand in one place.
        num_timesteps: T.
        **facts: See :class:`TrackFacts`.
    """
    shape = (len(ids), num_timesteps)

    def grid(rows: Array) -> Array:
        cells = np.zeros((*shape, *rows.shape[1:]), rows.dtype)
        cells[track, timestep] = rows
        return cells

    return Tracks(
        position=grid(_canonical(offsets_from(origin, position), METRES)),
        heading=grid(np.clip(_canonical(wrap_angle(heading), RADIANS), -_PI, _BELOW_PI)),
        velocity=grid(_canonical(velocity, METRES)),
        size=grid(_row_sizes(size, track, len(ids))),
        valid=grid(np.ones(len(track), np.bool_)),
        **_told(ids, object_type, facts),
    )


def _told(ids: Sequence[str], object_type: npt.ArrayLike, facts: TrackFacts) -> dict[str, Any]:
    """The fields of tracks that are one value each."""
    count = len(ids)
    source_type, extras = facts.get("source_type"), facts.get("extras")
    none = np.full(count, None, dtype=object)
    return {
        "ids": strings(ids),
        "object_type": np.asarray(object_type, dtype=np.uint8),
        "source_type": none if source_type is None else np.array(source_type, dtype=object),
        "is_size_assumed": _flags(facts.get("is_size_assumed", False), count),
        "is_type_assumed": _flags(facts.get("is_type_assumed", False), count),
        "is_velocity_estimated": _flags(facts.get("is_velocity_estimated", False), count),
        "extras": none if extras is None else np.array([to_json(e) for e in extras], dtype=object),
    }


def _canonical(values: npt.ArrayLike, step: float) -> Float32:
    """Rounded, without negative zeros."""
    kept = rounded(values, step)
    kept += np.float32(0.0)
    return kept


def _sizes(size: Array, valid: Bool) -> Float32:
    """Sizes of an object that never changes stay as they are given; those measured at every step are rounded."""
    shape = (*valid.shape, 3)
    sizes = np.zeros(shape, np.float32)
    with np.errstate(over="ignore"):  # beyond float32 becomes infinite, which validation names
        source = _source(size[:, None, :] if size.ndim == 2 else size, shape, np.float32)
    kernels.fill_sizes(source, valid, np.float32(METRES), sizes)
    return sizes


def _source(values: npt.ArrayLike, shape: tuple[int, ...], kind: type[Number]) -> npt.NDArray[Number]:
    """What a kernel reads: always one layout, and read-only, because kernels are compiled for each kind of array."""
    source = np.ascontiguousarray(np.broadcast_to(values, shape), kind)
    source.flags.writeable = False
    return source


def _row_sizes(size: Array, track: Array, count: int) -> Float32:
    """As :func:`_sizes`, of rows (R, 3) of ``count`` objects."""
    with np.errstate(over="ignore"):
        exact = size.astype(np.float32)
    some_row, changing = np.zeros(count, np.int64), np.zeros(count, np.bool_)
    some_row[track] = np.arange(len(track))
    changing[track[(exact != exact[some_row[track]]).any(axis=1)]] = True
    return np.where(changing[track][:, None], rounded(exact, METRES), exact)


def _flags(values: npt.ArrayLike, count: int) -> Bool:
    return np.array(np.broadcast_to(np.asarray(values, dtype=np.bool_), (count,)))
