"""What metrics look at: the motion of one vehicle, and the boxes around it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, IntP, UInt8
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.metrics.comfort import body_acceleration
from scenarionet_sim.rollouts.rollout import Rollout
from scenarionet_sim.worlds.world import World

_AXLES = Drive().wheelbase
"""Distance between the axles, as a share of the length."""


@dataclass(frozen=True, eq=False)
class EgoDrive:
    """Motion of the evaluated vehicle over T moments, in any fixed frame.

    Attributes:
        time: (T,) [s], increasing.
        position: (T, 2) [m] centre of the box.
        heading: (T,) [rad].
        speed: (T,) [m/s] magnitude of the velocity.
        acceleration: (T, 2) [m/s²] along and across the heading.
        length, width: Of the box [m].
        rear: Distance from the centre back to the rear axle [m].
    """

    time: Float64
    position: Float64
    heading: Float64
    speed: Float64
    acceleration: Float64
    length: float
    width: float
    rear: float

    @classmethod
    def of(cls, rollout: Rollout, world: World) -> EgoDrive:
        """The evaluated vehicle of a rollout; accelerations are central differences of its velocity."""
        agent = rollout.agent
        states = rollout.position[:, agent], rollout.heading[:, agent], rollout.velocity[:, agent]
        return cls._from_states(world, agent, *states)

    @classmethod
    def recorded(cls, world: World, agent: int, start: int, num_steps: int) -> EgoDrive:
        """The recording of a vehicle, without the timesteps at which it is not valid.

        Args:
            world: The scenario.
            agent: Row of the vehicle.
            start: First timestep.
            num_steps: Timesteps after it.
        """
        steps = np.arange(start, min(start + num_steps + 1, world.num_steps))
        steps = steps[world.log_valid[steps, agent]]
        logs = world.log_position, world.log_heading, world.log_velocity
        return cls._from_states(world, agent, *(log[steps, agent].astype(np.float64) for log in logs))

    @classmethod
    def _from_states(cls, world: World, agent: int, position: Float64, heading: Float64, velocity: Float64) -> EgoDrive:
        length, width = world.size[agent, :2].astype(np.float64).tolist()
        return cls(
            time=world.dt * np.arange(len(heading), dtype=np.float64),
            position=np.ascontiguousarray(position),
            heading=np.ascontiguousarray(heading),
            speed=np.hypot(velocity[:, 0], velocity[:, 1]),
            acceleration=body_acceleration(velocity, heading, world.dt),
            length=length,
            width=width,
            rear=0.5 * _AXLES * length,
        )

    @cached_property
    def dt(self) -> float:
        """Mean time between two moments [s]."""
        return float(np.diff(self.time).mean())

    @property
    def rear_axle(self) -> Float64:
        """(T, 2) positions of the rear axle [m]."""
        return self._box[1]

    @property
    def corners(self) -> Float64:
        """(T, 4, 2) corners of the box [m]: front left, rear left, rear right, front right."""
        return self._box[0]

    @cached_property
    def _box(self) -> tuple[Float64, Float64]:
        """Corners (T, 4, 2) and rear axle (T, 2) [m]."""
        corners, axle = np.empty((len(self.heading), 4, 2)), np.empty((len(self.heading), 2))
        place_box(self.position, self.heading, (self.length, self.width, self.rear), corners, axle)
        return corners, axle


@kernel(allocates=False)
def place_box(
    position: Float64, heading: Float64, box: tuple[float, float, float], corners: Float64, axle: Float64
) -> None:
    """Write corners and rear axle of a box, given by length, width, and distance from the axle to the centre [m]."""
    length, width, rear = box
    for t in range(len(heading)):
        cos, sin = math.cos(heading[t]), math.sin(heading[t])
        for k in range(4):
            along = 0.5 * length if k in (0, 3) else -0.5 * length
            across = 0.5 * width if k < 2 else -0.5 * width
            corners[t, k, 0] = position[t, 0] + cos * along - sin * across
            corners[t, k, 1] = position[t, 1] + sin * along + cos * across
        axle[t, 0], axle[t, 1] = position[t, 0] - rear * cos, position[t, 1] - rear * sin


@dataclass(frozen=True, eq=False)
class DrivenEpisode:
    """A rollout in its scenario.

    Attributes:
        rollout: The whole episode, to its outcome.
        world: The scenario.
    """

    rollout: Rollout
    world: World

    @cached_property
    def scored(self) -> Rollout:
        """The time of the recording."""
        return self.rollout.scored()

    @cached_property
    def is_whole(self) -> bool:
        """Whether the vehicle moves at least a step and is present all the time: no motion is known across a gap."""
        scored, agent = self.scored, self.scored.agent
        states = scored.position[:, agent], scored.velocity[:, agent], scored.heading[:, agent]
        is_present = bool(scored.present[:, agent].all())
        return scored.num_steps > 0 and is_present and all(np.isfinite(state).all() for state in states)

    @cached_property
    def drive(self) -> EgoDrive:
        """The scored drive of the vehicle, if it is whole."""
        return EgoDrive.of(self.scored, self.world)

    @cached_property
    def recorded(self) -> EgoDrive:
        """The recording of the vehicle over the same time."""
        return EgoDrive.recorded(self.world, self.scored.agent, self.scored.start, self.scored.num_scored)


@dataclass(frozen=True, eq=False)
class SurroundingBoxes:
    """Boxes of N objects over the T moments of a drive.

    Attributes:
        position: (T, N, 2) [m] centres.
        heading: (T, N) [rad].
        speed: (T, N) [m/s]; 0 for static objects.
        size: (N, 2) [m] length and width.
        object_type: (N,) codes of ``ObjectType``.
        present: (T, N) observed.
    """

    position: Float64
    heading: Float64
    speed: Float64
    size: Float64
    object_type: UInt8
    present: Bool

    @classmethod
    def of(cls, rollout: Rollout, world: World) -> SurroundingBoxes:
        """Every object of a rollout that is ever present, except the evaluated vehicle."""
        seen = np.flatnonzero(rollout.present.any(axis=0))
        rows = seen[seen != rollout.agent]
        shape = len(rollout.position), len(rows)
        (heading, speed), position, present = np.empty((2, *shape)), np.empty((*shape, 2)), np.empty(shape, np.bool_)
        states = rollout.position, rollout.heading, rollout.velocity
        _take_boxes(states, rollout.present, rows, (position, heading, speed), present)
        return cls(position, heading, speed, world.size[rows, :2].astype(np.float64), world.object_type[rows], present)

    @classmethod
    def recorded(cls, world: World, agent: int, start: int, num_steps: int) -> SurroundingBoxes:
        """The recording of every object except a vehicle that is ever valid in these timesteps.

        Args:
            world: The scenario.
            agent: Row of the vehicle.
            start: First timestep.
            num_steps: Timesteps after it; beyond the recording objects keep their last state.
        """
        steps = np.minimum(start + np.arange(num_steps + 1), world.num_steps - 1)
        seen = np.flatnonzero(world.log_valid[steps].any(axis=0))
        rows = np.ix_(steps, seen[seen != agent])
        velocity = world.log_velocity[rows].astype(np.float64)
        return cls(
            position=world.log_position[rows].astype(np.float64),
            heading=world.log_heading[rows].astype(np.float64),
            speed=np.hypot(velocity[..., 0], velocity[..., 1]),
            size=world.size[rows[1][0], :2].astype(np.float64),
            object_type=world.object_type[rows[1][0]],
            present=world.log_valid[rows],
        )


@kernel(allocates=False)
def _take_boxes(
    states: tuple[Float64, Float64, Float64],
    presences: Bool,
    rows: IntP,
    taken: tuple[Float64, Float64, Float64],
    present: Bool,
) -> None:
    """Write the states (T, N) of some objects, with speeds instead of velocities."""
    (positions, headings, velocities), (position, heading, speed) = states, taken
    for t in range(len(heading)):
        for n in range(len(rows)):
            row = rows[n]
            position[t, n, 0], position[t, n, 1] = positions[t, row, 0], positions[t, row, 1]
            heading[t, n], present[t, n] = headings[t, row], presences[t, row]
            speed[t, n] = math.hypot(velocities[t, row, 0], velocities[t, row, 1])
