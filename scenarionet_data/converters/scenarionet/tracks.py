"""Read tracks from ScenarioNet pickles of every version: stack many small arrays into a few large ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, UInt8
from scenarionet_data.building import make_tracks
from scenarionet_data.building.plausible import MAX_STOP, find_dead_ends
from scenarionet_data.converters.scenarionet.frame import Frame
from scenarionet_data.converters.scenarionet.layout import LAYOUT
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.description import Tracks
from scenarionet_data.scenario.vocabulary import ObjectType

# Length, width, height [m] of objects that MetaDrive pickles without size: a typical cone, and MetaDrive's barrier.
_ASSUMED_SIZES: dict[int, tuple[float, float, float]] = {
    ObjectType.VEHICLE: (4.5, 1.9, 1.6),
    ObjectType.PEDESTRIAN: (0.6, 0.6, 1.75),
    ObjectType.CYCLIST: (1.8, 0.7, 1.7),
    ObjectType.TRAFFIC_CONE: (0.4, 0.4, 0.8),
    ObjectType.TRAFFIC_BARRIER: (2.0, 0.3, 1.0),
}
_ASSUMED_SIZE = (1.0, 1.0, 1.0)
_MINUS_PI = np.float32(-np.pi)

TrackDicts = Mapping[Any, Mapping[str, Any]]


@dataclass(frozen=True)
class States:
    """Stacked states of the tracks, in the pickle's frame and precision.

    Attributes:
        object_type: (N,) codes of ``ObjectType``.
        position: (N, T, 3) [m].
        heading: (N, T) [rad].
        velocity: (N, T, 2) [m/s].
        size: (N, T, 3) [m].
        valid: (N, T).
        is_size_assumed: (N,) whether the pickle has no size for the track.
        is_interpolated: (N, T) states of the ego that were dropped.
        is_velocity_repaired: (N,) whether :func:`repair_ends` replaced one of its velocities.
    """

    object_type: UInt8
    position: Array
    heading: Array
    velocity: Array
    size: Array
    valid: Bool
    is_size_assumed: Bool
    is_interpolated: Bool
    is_velocity_repaired: Bool


def read_states(tracks: TrackDicts, length: int, where: str) -> States:
    """Stack the states of all tracks.

    Args:
        tracks: ``description["tracks"]``.
        length: T.
        where: Name of the pickle in errors.

    Raises:
        InvalidScenario: No tracks, or a state is missing or has another length.
    """
    if not tracks:
        raise InvalidScenario(where, "tracks", "expected at least the ego, found none")
    stack = _Stack(tracks, length, where)
    valid: Bool = stack.scalars("valid") > 0.5
    types = np.array([_object_type(track) for track in tracks.values()], dtype=np.uint8)
    size = np.stack([stack.scalars(name, is_optional=True) for name in ("length", "width", "height")], axis=-1)
    # 0 at a valid step: the recorded simulator had no size for the object. States of a negative size are dropped later.
    unknown = np.asarray((valid & (size == 0).any(axis=-1)).any(axis=1), dtype=np.bool_)
    for row in np.flatnonzero(unknown):
        size[row] = _ASSUMED_SIZES.get(int(types[row]), _ASSUMED_SIZE)
    heading = stack.scalars("heading")
    if (heading == _MINUS_PI).any():  # float32's -pi is below -pi and would be wrapped to +pi
        heading = np.where(heading == _MINUS_PI, np.float64(-np.pi), heading)
    return States(
        object_type=types,
        position=stack.points("position", 3),
        heading=heading,
        velocity=stack.points("velocity", 2),
        size=size,
        valid=valid,
        is_size_assumed=unknown,
        is_interpolated=np.zeros_like(valid),
        is_velocity_repaired=np.zeros(len(types), np.bool_),
    )


def _object_type(track: Mapping[str, Any]) -> int:
    # This project's export stores the lake's type under "object_type" where MetaDrive only has OTHER.
    word = track["metadata"].get("object_type", track["type"])
    return ObjectType.__members__.get(word, ObjectType.OTHER)


@dataclass(frozen=True)
class _Stack:
    """Stacks one state over all tracks."""

    tracks: TrackDicts
    length: int
    where: str

    def scalars(self, name: str, is_optional: bool = False) -> Array:
        """(N, T) from (T,) or (T, 1); 0 if an optional one is missing."""
        rows = self._rows(name, (1,), is_optional)
        stacked = np.asarray(np.concatenate(rows, axis=None))
        return stacked.reshape(len(rows), self.length)

    def points(self, name: str, width: int) -> Array:
        """(N, T, width) from (T, 2) or (T, 3): a missing third coordinate is 0, an additional one is dropped."""
        rows = self._rows(name, (2, 3))
        if {row.shape for row in rows} == {(self.length, width)}:
            return np.asarray(np.concatenate(rows)).reshape(len(rows), self.length, width)
        points = np.zeros((len(rows), self.length, width), np.result_type(*{row.dtype for row in rows}))
        for number, row in enumerate(rows):
            kept = row[:, :width]
            points[number, :, : kept.shape[1]] = kept
        return points

    def _rows(self, name: str, widths: tuple[int, ...], is_optional: bool = False) -> list[Array]:
        """One state of each track, with T timesteps and one of the given widths."""
        rows, sizes = [], {self.length * width for width in widths}
        for track_id, track in self.tracks.items():
            state = track["state"]
            if is_optional and name not in state:
                rows.append(np.zeros(self.length))
                continue
            if name not in state:
                raise self._wrong(track_id, name, "is missing")
            values = state[name] if isinstance(state[name], np.ndarray) else np.asarray(state[name])
            if len(values) != self.length or values.size not in sizes:
                raise self._wrong(track_id, name, f"expected {self.length} timesteps, found an array {values.shape}")
            rows.append(values)
        return rows

    def _wrong(self, track_id: Any, name: str, reason: str) -> InvalidScenario:
        return InvalidScenario(self.where, f"tracks[{str(track_id)!r}].state.{name}", reason)


def is_wider(states: States, ego: int) -> bool:
    """Whether the ego is wider than long at any timestep."""
    return bool((states.size[ego, :, 1] > states.size[ego, :, 0]).any())


def repair_ends(states: States, times: Float64, is_nuscenes: bool) -> list[list[int]]:
    """Replace impossible velocities of 0 at the ends of tracks by their neighbours', in place; return [track, step].

    ScenarioNet's nuScenes converter takes differences to the next position, and leaves 0 where there is none.
    """
    fastest = 0.01 if is_nuscenes else MAX_STOP  # above what rounding in the lake changes
    rows, steps, near = find_dead_ends(states.position, states.velocity, states.valid, times, fastest)
    states.velocity[rows, steps] = states.velocity[rows, near]
    states.is_velocity_repaired[rows] = True
    return [list(place) for place in zip(rows.tolist(), steps.tolist(), strict=True)]


def restore_ego_size(states: States, ego: int) -> None:
    """Swap the ego's length and width in place, which ScenarioNet's nuScenes converter exchanges."""
    length, width = states.size[ego, :, 0], states.size[ego, :, 1]
    wider = width > length
    length[wider], width[wider] = width[wider], length[wider]


def make_pickled_tracks(
    tracks: TrackDicts, states: States, frame: Frame, ego: int, own: Sequence[Mapping[str, Any]]
) -> Tracks:
    """Build canonical tracks.

    Args:
        tracks: ``description["tracks"]``.
        states: Their stacked states.
        frame: The pickle's; its dataset determines what is assumed, estimated or interpolated.
        ego: Row of the ego.
        own: (N,) what the layout keeps with them.
    """
    metadata = [track["metadata"] for track in tracks.values()]
    return make_tracks(
        [str(track_id) for track_id in tracks],
        states.object_type,
        states.position,
        states.heading,
        states.velocity,
        states.size,
        states.valid,
        origin=frame.local_origin,
        source_type=[_source_type(track) for track in tracks.values()],
        is_size_assumed=states.is_size_assumed | _flags(metadata, "is_size_assumed", frame.quirks == "av2"),
        is_type_assumed=_flags(metadata, "is_type_assumed", False),
        is_velocity_estimated=states.is_velocity_repaired
        | _flags(metadata, "is_velocity_estimated", frame.quirks == "nuscenes"),
        is_interpolated=states.is_interpolated
        | np.stack(
            [
                _interpolated(described, states.valid.shape[1], frame.quirks == "nuscenes" and row != ego)
                for row, described in enumerate(metadata)
            ]
        ),
        extras=[
            described.get("extras") if frame.is_ours else {LAYOUT: kept} if kept else None
            for described, kept in zip(metadata, own, strict=True)
        ],
    )


def _source_type(track: Mapping[str, Any]) -> str | None:
    metadata = track["metadata"]
    if "source_type" in metadata:
        return None if metadata["source_type"] is None else str(metadata["source_type"])
    word = metadata.get("type")
    return None if word is None or word == track["type"] else str(word)


def _flags(metadata: list[Mapping[str, Any]], name: str, default: bool) -> Bool:
    return np.array([bool(described.get(name, default)) for described in metadata], dtype=np.bool_)


_KEYFRAME_STEPS = 5
"""ScenarioNet divides the 0.5 s between nuScenes' keyframes into this many steps, linearly."""


def _interpolated(described: Mapping[str, Any], length: int, is_between_keyframes: bool) -> Bool:
    """(T,) flags of a track: those that this project's export keeps, or what ScenarioNet interpolated."""
    flags = np.zeros(length, np.bool_)
    if "is_interpolated" in described:
        flags |= np.asarray(described["is_interpolated"]) > 0.5
    elif is_between_keyframes:
        flags[np.arange(length) % _KEYFRAME_STEPS > 0] = True
    return flags
