"""Lyft's agents on a grid of tracks and timesteps, and the recording car, which is not among them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.building import make_tracks
from scenarionet_data.converters.lyft_recording import Content
from scenarionet_data.converters.lyft_zarr import Records
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.geometry import estimate_velocity
from scenarionet_data.scenario import Bool, Float64, Tracks
from scenarionet_data.vocabulary import ObjectType

EGO = "ego"
EGO_SIZE = (4.87, 1.85, 1.8)
"""Length, width, height [m] that the owner assumes of the recording car, with sensors
(``l5kit/rasterization/rasterizer.py``)."""

MOVING = 1.0
"""[m/s] from which on a road user that stands still by its recorded velocity is taken to move."""
_REACH = 4
"""Frames to either side over which its velocity is then estimated: boxes jump by decimetres from frame to frame,
most of all where a track begins, which is where the recorded velocities are zero."""

# A bicycle or motorcycle that nobody rides is no cyclist: the dataset has labels of their own for riders.
_GROUPS = {
    ObjectType.VEHICLE: "CAR VAN TRAM BUS TRUCK EMERGENCY_VEHICLE OTHER_VEHICLE",
    ObjectType.CYCLIST: "CYCLIST MOTORCYCLIST",
    ObjectType.PEDESTRIAN: "PEDESTRIAN",
}
_TYPES = {f"PERCEPTION_LABEL_{word}": kind for kind, words in _GROUPS.items() for word in words.split()}
_UNTOLD = frozenset(
    {*(f"PERCEPTION_LABEL_{word}" for word in ("NOT_SET", "UNKNOWN", "DONTCARE")), "AVRESEARCH_LABEL_DONTCARE"}
)


def tracks(
    content: Content, labels: Sequence[str], origin: Float64, where: str, keep_unknown: bool
) -> tuple[Tracks, int]:
    """The agents, the ego after them, and how many of the agents' velocities were repaired.

    A track has the label that is the most probable over its frames. The source writes a velocity of exactly zero
    where it has estimated none, also for road users that move; there it is estimated from the positions.

    Args:
        content: T frames.
        labels: Words of the labels.
        origin: (3,) [m].
        where: Names the scenario in errors.
        keep_unknown: Whether to keep objects of which the source does not say what they are.

    Raises:
        InvalidScenario: A track has two rows in one frame.
    """
    agents, frame = content.agents, content.frame
    if not keep_unknown:
        grid = _Grid(agents, frame, len(content.times), where)
        is_told = ~np.isin(_words(grid, agents, labels)[0], list(_UNTOLD))[grid.track]
        agents, frame = agents[is_told], frame[is_told]
    grid = _Grid(agents, frame, len(content.times), where)
    words, is_varied = _words(grid, agents, labels)
    kinds = np.array([*(_TYPES.get(word, ObjectType.OTHER) for word in words), ObjectType.VEHICLE], np.uint8)
    position = grid.place(_in_plane(agents["centroid"]), _in_plane(content.ego[:, :2]))
    velocity, is_repaired = _velocity(
        grid, agents["velocity"], position, (content.times - content.times[0]) * 1e-9, kinds
    )
    made = make_tracks(
        [*map(str, grid.ids.tolist()), EGO],
        kinds,
        position,
        grid.place(agents["yaw"], content.ego[:, 2]),
        velocity,
        grid.place(agents["extent"], EGO_SIZE),
        grid.valid,
        origin=origin,
        source_type=[*words.tolist(), "EGO"],
        is_size_assumed=[False] * len(words) + [True],
        is_type_assumed=[*is_varied.tolist(), False],
        is_velocity_estimated=is_repaired.any(axis=1),
    )
    return made, int(is_repaired[:-1].sum())


class _Grid:
    """Where each row stands among N tracks and T timesteps; the ego, always there, is one row more.

    Attributes:
        ids: (N,) ascending.
        track: (R,) row of ``ids``.
        valid: (N + 1, T).
    """

    def __init__(self, agents: Records, frame: npt.NDArray[np.int64], steps: int, where: str) -> None:
        self.ids, self.track = np.unique(agents["track_id"], return_inverse=True)
        self._cell = self.track * steps + frame
        counts = np.bincount(self._cell, minlength=(len(self.ids) + 1) * steps)
        if counts.max() > 1:
            track, step = divmod(int(counts.argmax()), steps)
            found = f"found {counts.max()} of track {self.ids[track]} at timestep {step}"
            raise InvalidScenario(where, "agents.track_id", f"wanted one row per track and frame, {found}")
        self.valid = (counts > 0).reshape(-1, steps)
        self.valid[-1] = True

    def place(self, values: npt.NDArray[Any], ego: npt.ArrayLike) -> npt.NDArray[Any]:
        """Values (R, ...) of the rows and the ego's, for all timesteps or each, as (N + 1, T, ...); 0 elsewhere."""
        cells = np.zeros((self.valid.size, *values.shape[1:]), values.dtype)
        cells[self._cell] = values
        grid: npt.NDArray[Any] = cells.reshape(*self.valid.shape, *values.shape[1:])
        grid[-1] = ego
        return grid


def _in_plane(points: npt.NDArray[Any]) -> Float64:
    """(R, 3) float64 of points (R, 2)."""
    return np.column_stack([points, np.zeros(len(points))])


def _words(grid: _Grid, agents: Records, labels: Sequence[str]) -> tuple[npt.NDArray[np.object_], Bool]:
    """(N,) label of each track, and whether its frames disagree about it."""
    probabilities = agents["label_probabilities"]
    count, size = len(grid.ids), len(labels)
    cells = (grid.track[:, None] * size + np.arange(size)).ravel()
    total = np.bincount(cells, probabilities.ravel(), count * size).reshape(count, size)
    label = total.argmax(axis=1)
    differs = probabilities.argmax(axis=1) != label[grid.track]
    return np.array(labels, dtype=object)[label], np.bincount(grid.track, differs, count) > 0


def _velocity(
    grid: _Grid, recorded: npt.NDArray[Any], position: Float64, times: Float64, kinds: npt.NDArray[np.uint8]
) -> tuple[npt.NDArray[Any], Bool]:
    """Velocities (N + 1, T, 2), and where they are estimated: the ego's, and those of road users that move at 0 m/s."""
    velocity = grid.place(recorded, estimate_velocity(position[-1:], grid.valid[-1:], times)[0])
    is_repaired = np.zeros(grid.valid.shape, np.bool_)
    is_repaired[-1] = True
    is_road_user = np.isin(kinds, list(_GROUPS))
    rows = np.unique(grid.track[~recorded.any(axis=1) & is_road_user[grid.track]])
    estimated = _smooth_velocity(position[rows, :, :2], grid.valid[rows], times)
    is_moving = np.hypot(*np.moveaxis(estimated, -1, 0)) > MOVING
    is_repaired[rows] = grid.valid[rows] & ~velocity[rows].any(axis=-1) & is_moving
    velocity[rows] = np.where(is_repaired[rows][..., None], estimated, velocity[rows])
    return velocity, is_repaired


def _smooth_velocity(path: Float64, valid: Bool, times: Float64) -> Float64:
    """(K, T, 2) differences over ``_REACH`` valid timesteps to both sides, fewer at the ends of a run of them."""
    steps = np.arange(len(times))
    goes_on = valid[:, 1:] & valid[:, :-1]
    edge = np.ones((len(valid), 1), np.bool_)
    first = np.maximum.accumulate(np.where(np.hstack([edge, ~goes_on]), steps, 0), axis=1)
    last = np.minimum.accumulate(np.where(np.hstack([~goes_on, edge]), steps, steps[-1])[:, ::-1], axis=1)[:, ::-1]
    before, after = np.maximum(first, steps - _REACH), np.minimum(last, steps + _REACH)
    move = np.take_along_axis(path, after[..., None], axis=1) - np.take_along_axis(path, before[..., None], axis=1)
    span = (times[after] - times[before])[..., None]
    velocity: Float64 = np.divide(move, span, out=np.zeros_like(move), where=span > 0)
    return velocity
