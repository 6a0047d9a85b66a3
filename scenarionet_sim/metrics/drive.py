"""What metrics look at: the motion of one vehicle, or of many on one map, and the boxes around it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64, IntP, UInt8
from scenarionet_data.compiled.decorators import device_function, kernel
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.metrics.comfort import body_acceleration
from scenarionet_sim.rollouts.rollout import Rollout
from scenarionet_sim.worlds.world import World

AXLES = Drive().wheelbase
"""Distance between the axles, as a share of the length."""


class Drives(NamedTuple):
    """Motion of B vehicles over S moments in total, one drive after another, in any fixed frame.

    Attributes:
        offsets: (B + 1,) first moment of each drive.
        dt: (B,) mean time between its moments [s].
        box: (B, 3) length and width of the box, and distance from its centre back to the rear axle [m].
        centre: (S, 1, 2) of the box [m].
        heading: (S,) [rad].
        speed: (S,) magnitude of the velocity [m/s].
        acceleration: (S, 2) along and across the heading [m/s²].
        corners: (S, 4, 2) of the box [m]: front left, rear left, rear right, front right.
        axle: (S, 2) the rear one [m].
    """

    offsets: Int64
    dt: Float64
    box: Float64
    centre: Float64
    heading: Float64
    speed: Float64
    acceleration: Float64
    corners: Float64
    axle: Float64

    @classmethod
    def room(cls, counts: Int64, dt: Sequence[float], box: Float64) -> Drives:
        """Return room for drives of some numbers of moments (B,)."""
        offsets = np.append(0, np.cumsum(counts))
        total = int(offsets[-1])
        mean = np.array([mean_step(count, step) for count, step in zip(counts.tolist(), dt, strict=True)])
        (heading, speed), (acceleration, axle) = np.empty((2, total)), np.empty((2, total, 2))
        return cls(
            offsets, mean, box, np.empty((total, 1, 2)), heading, speed, acceleration, np.empty((total, 4, 2)), axle
        )

    def part(self, drive: int) -> slice:
        """Return the moments of a drive."""
        return slice(int(self.offsets[drive]), int(self.offsets[drive + 1]))


@lru_cache
def mean_step(num_moments: int, dt: float) -> float:
    """Return the mean time [s] between moments at the multiples of one."""
    return float(np.diff(dt * np.arange(num_moments, dtype=np.float64)).mean()) if num_moments > 1 else dt


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
            rear=0.5 * AXLES * length,
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

    @property
    def drives(self) -> Drives:
        """The same as the only one of its kind."""
        offsets, box = np.array([0, len(self.time)]), np.array([[self.length, self.width, self.rear]])
        dt = np.array([self.dt if len(self.time) > 1 else 0.0])
        heading, centre = np.ascontiguousarray(self.heading), self.position.reshape(-1, 1, 2)
        return Drives(offsets, dt, box, centre, heading, self.speed, self.acceleration, self.corners, self.rear_axle)

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
    for t in range(len(heading)):
        place_box_at(position[t, 0], position[t, 1], heading[t], box, corners[t], axle[t])


@device_function
def place_box_at(
    x: float, y: float, heading: float, box: tuple[float, float, float], corners: Float64, axle: Float64
) -> None:
    """Write corners (4, 2) and rear axle (2,) of a box; see :func:`place_box`."""
    length, width, rear = box
    cos, sin = math.cos(heading), math.sin(heading)
    for k in range(4):
        along = 0.5 * length if k in (0, 3) else -0.5 * length
        across = 0.5 * width if k < 2 else -0.5 * width
        corners[k, 0] = x + cos * along - sin * across
        corners[k, 1] = y + sin * along + cos * across
    axle[0], axle[1] = x - rear * cos, y - rear * sin


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
    def num_moments(self) -> int:
        """Number of moments of the time of the recording; 0 if the vehicle's motion is not known in all of them.

        It moves at least a step and is present all the time: no motion is known across a gap.
        """
        rollout = self.rollout
        states = rollout.position, rollout.velocity, rollout.heading
        return count_moments(*states, rollout.present, rollout.agent, rollout.num_scored + 1)

    @property
    def is_whole(self) -> bool:
        """Whether the vehicle's motion is known at all moments."""
        return self.num_moments > 0

    @cached_property
    def drive(self) -> EgoDrive:
        """The scored drive of the vehicle, if it is whole."""
        return EgoDrive.of(self.scored, self.world)

    @cached_property
    def recorded(self) -> EgoDrive:
        """The recording of the vehicle over the same time."""
        return EgoDrive.recorded(self.world, self.scored.agent, self.scored.start, self.scored.num_scored)


@kernel(allocates=False)
def count_moments(position: Float64, velocity: Float64, heading: Float64, present: Bool, agent: int, most: int) -> int:
    """Return the number of moments up to an object's last one, at all of which its motion is known; else 0."""
    count, is_gap = 0, False
    for t in range(min(most, len(present))):
        if not present[t, agent]:
            is_gap = True
            continue
        if is_gap:
            return 0
        size = abs(position[t, agent, 0]) + abs(position[t, agent, 1]) + abs(heading[t, agent])
        if not np.isfinite(size + abs(velocity[t, agent, 0]) + abs(velocity[t, agent, 1])):
            return 0
        count += 1
    return count if count > 1 else 0


class MovingBoxes(NamedTuple):
    """Boxes of all objects of B episodes, moment by moment of each episode.

    Attributes:
        first: (B,) row of the first object at the first moment of each episode.
        counts: (B,) number of its objects.
        agents: (B,) which of them is evaluated.
        first_size: (B,) row of its first object in ``size``.
        position, velocity: (R, 2) [m, m/s].
        heading: (R,) [rad].
        present: (R,) observed.
        size: (K, 2) length and width [m].
    """

    first: Int64
    counts: Int64
    agents: Int64
    first_size: Int64
    position: Float64
    velocity: Float64
    heading: Float64
    present: Bool
    size: Float64


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
