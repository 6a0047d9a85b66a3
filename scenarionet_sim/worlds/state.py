"""Everything that moves, at one moment, in W worlds of N objects: the only truth of a simulation."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, UInt8
from scenarionet_sim.worlds.history import History
from scenarionet_sim.worlds.world import World


@dataclass(eq=False)
class State:
    """W worlds side by side; worlds with fewer than N objects have rows that are never present.

    Row n of world w is row n of that world's log. Rows that are not present hold what they held last.

    Attributes:
        position: (W, N, 2) float64 [m] centre of the box.
        heading: (W, N) float64 [rad] in [-pi, pi).
        velocity: (W, N, 2) float64 [m/s] along the scenario's axes.
        yaw_rate: (W, N) float64 [rad/s].
        z: (W, N) float64 [m] centre of the box.
        present: (W, N) bool.
        arc: (W, N) float64 [m] how far along its own path an object is that does not replay its log; NaN before
            that is known, infinite once it has left at the path's end.
        lateral: (W, N) float64 [m] how far to the left of its path it is.
        size: (W, N, 3) float64 [m] length, width, height.
        object_type: (W, N) uint8 codes of ``ObjectType``.
        timestep: (W,) int32.
        history: The moments before, where somebody wants them remembered.
    """

    position: Float64
    heading: Float64
    velocity: Float64
    yaw_rate: Float64
    z: Float64
    present: Bool
    arc: Float64
    lateral: Float64
    size: Float64
    object_type: UInt8
    timestep: Int32
    history: History | None = None

    @property
    def motion(self) -> tuple[Any, ...]:
        """Position, heading, velocity, yaw rate, height and presence, in the order that kernels take them."""
        return self.position, self.heading, self.velocity, self.yaw_rate, self.z, self.present

    @classmethod
    def empty(cls, num_worlds: int, num_objects: int) -> State:
        """Nothing anywhere."""
        shape = num_worlds, num_objects
        return cls(
            position=np.zeros((*shape, 2)),
            heading=np.zeros(shape),
            velocity=np.zeros((*shape, 2)),
            yaw_rate=np.zeros(shape),
            z=np.zeros(shape),
            present=np.zeros(shape, np.bool_),
            arc=np.zeros(shape),
            lateral=np.zeros(shape),
            size=np.zeros((*shape, 3)),
            object_type=np.zeros(shape, np.uint8),
            timestep=np.zeros(num_worlds, np.int32),
        )

    def begin(self, slot: int, world: World, start: int, is_driven: Bool) -> None:
        """Put a slot at a timestep of a log.

        Args:
            slot: Which.
            world: Its world.
            start: Timestep.
            is_driven: (N,) objects that may be present.
        """
        here = slice(0, world.num_objects)
        self.present[slot] = False
        self.present[slot, here] = world.log_valid[start] & is_driven
        self.position[slot, here], self.z[slot, here] = world.log_position[start], world.log_z[start]
        self.heading[slot, here], self.velocity[slot, here] = world.log_heading[start], world.log_velocity[start]
        self.yaw_rate[slot, here] = world.log_yaw_rate[start]
        self.arc[slot], self.lateral[slot] = np.nan, 0.0
        self.size[slot, here], self.object_type[slot, here] = world.size, world.object_type
        self.timestep[slot] = start

    def take(self, other: State) -> None:
        """Copy a state of as many worlds and at most as many objects."""
        for column in fields(self):
            old = getattr(other, column.name)
            if isinstance(old, np.ndarray):
                getattr(self, column.name)[tuple(map(slice, old.shape))] = old
