"""The state of a simulation: everything that moves in W worlds of N objects, at one moment and at past ones."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, UInt8
from scenarionet_sim.arrays.log import HEADING, VX, YAW_RATE, Z
from scenarionet_sim.arrays.structures import StateArrays


class History(NamedTuple):
    """The last K moments, latest first, for sensors that show past positions.

    Attributes:
        position: (K, W, N, 2) float64 [m].
        heading: (K, W, N) float64 [rad].
        present: (K, W, N) bool; False before the first moment of an episode.
    """

    position: Float64
    heading: Float64
    present: Bool

    @classmethod
    def empty(cls, num_moments: int, num_worlds: int, num_objects: int) -> History:
        """Return a history without any object."""
        shape = num_moments, num_worlds, num_objects
        return cls(np.zeros((*shape, 2)), np.zeros(shape), np.zeros(shape, np.bool_))

    def push(self, state: State) -> None:
        """Insert a moment and drop the oldest."""
        for moments, now in zip(self, (state.position, state.heading, state.present), strict=True):
            moments[1:] = moments[:-1]
            moments[:1] = now

    def resized(self, num_objects: int) -> History:
        """Return a copy with room for more objects."""
        num_moments, num_worlds, old = self.present.shape
        larger = History.empty(num_moments, num_worlds, num_objects)
        for values, moments in zip(larger, self, strict=True):
            values[:, :, :old] = moments
        return larger


@dataclass(eq=False)
class State:
    """State of W worlds; worlds with fewer than N objects have padding rows that are never present.

    Row n of world w is row n of that world's log. Values of absent rows are undefined. Frame: the scenario's.

    Attributes:
        motion: (W, N, 7) float64 x, y, z [m] of the box's centre, heading [rad] in [-pi, pi), velocity x, y [m/s],
            yaw rate [rad/s]; columns as in ``arrays.log``. ``position``, ``heading`` and so on are views of it.
        route: (W, N, 2) float64 [m] arc length along the object's own path (NaN until it is known, infinite once
            the object has left at the end of the path), and lateral offset to its left.
        present: (W, N) bool.
        size: (W, N, 3) float64 [m] length, width, height.
        object_type: (W, N) uint8 codes of ``ObjectType``.
        timestep: (W,) int32.
        history: Past moments, if the simulation keeps any.
        moment: The arrays as kernels take them.
    """

    motion: Float64
    route: Float64
    present: Bool
    size: Float64
    object_type: UInt8
    timestep: Int32
    history: History | None = None
    moment: StateArrays = field(init=False, repr=False)

    def __post_init__(self) -> None:
        self.moment = StateArrays(self.motion, self.route, self.present, self.size, self.object_type, self.timestep)

    @property
    def position(self) -> Float64:
        """(W, N, 2) view [m]."""
        return self.motion[..., :2]

    @property
    def z(self) -> Float64:
        """(W, N) view [m]."""
        return self.motion[..., Z]

    @property
    def heading(self) -> Float64:
        """(W, N) view [rad]."""
        return self.motion[..., HEADING]

    @property
    def velocity(self) -> Float64:
        """(W, N, 2) view [m/s]."""
        return self.motion[..., VX : VX + 2]

    @property
    def yaw_rate(self) -> Float64:
        """(W, N) view [rad/s]."""
        return self.motion[..., YAW_RATE]

    @property
    def arc(self) -> Float64:
        """(W, N) view [m]."""
        return self.route[..., 0]

    @property
    def lateral(self) -> Float64:
        """(W, N) view [m]."""
        return self.route[..., 1]

    @classmethod
    def empty(cls, num_worlds: int, num_objects: int) -> State:
        """Return a state without any object."""
        shape = num_worlds, num_objects
        return cls(
            motion=np.zeros((*shape, 7)),
            route=np.zeros((*shape, 2)),
            present=np.zeros(shape, np.bool_),
            size=np.zeros((*shape, 3)),
            object_type=np.zeros(shape, np.uint8),
            timestep=np.zeros(num_worlds, np.int32),
        )

    def sharing(self, other: State) -> State:
        """Return this state with the sizes and types of the same objects, and the history, of another one."""
        return replace(self, size=other.size, object_type=other.object_type, history=other.history)

    def resized(self, num_objects: int) -> State:
        """Return a copy with room for more objects; its history is shared with no other state."""
        larger = State.empty(len(self.timestep), num_objects)
        for column in fields(self):
            old = getattr(self, column.name)
            if isinstance(old, np.ndarray):
                getattr(larger, column.name)[tuple(map(slice, old.shape))] = old
        if self.history is not None:
            larger.history = self.history.resized(num_objects)
        return larger
