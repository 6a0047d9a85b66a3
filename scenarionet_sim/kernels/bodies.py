"""Between the state of a simulation and the bodies of a physics engine: which, whence, and back."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.compiled import device_function, kernel
from scenarionet_data.arrays.dtypes import Bool, Float64, Int32


@kernel
def find_bodies(
    position: Float64, velocity: Float64, size: Float64, present: Bool, agents: Int32, slack: float, dt: float
) -> Int32:
    """The agents, and after them every other object whose circle can meet an agent's within ``dt``.

    Args:
        position: (W, N, 2) [m].
        velocity: (W, N, 2) [m/s].
        size: (W, N, 3) [m].
        present: (W, N).
        agents: (A, 2) world and row.
        slack: Speed [m/s] that an agent may gain beyond what it has.
        dt: [s].

    Returns:
        (B, 2) int32 world and row: the agents as given, then the others, rising.
    """
    driven = np.zeros(present.shape, np.bool_)
    near = np.zeros(present.shape, np.bool_)
    for a in range(len(agents)):
        driven[agents[a, 0], agents[a, 1]] = True
    for a in range(len(agents)):
        world, row = agents[a, 0], agents[a, 1]
        reach = _radius(size, world, row) + (_speed(velocity, world, row) + slack) * dt
        for other in range(present.shape[1]):
            if not present[world, other] or driven[world, other]:
                continue
            limit = reach + _radius(size, world, other) + _speed(velocity, world, other) * dt
            x = position[world, other, 0] - position[world, row, 0]
            y = position[world, other, 1] - position[world, row, 1]
            near[world, other] |= x * x + y * y <= limit * limit
    return _listed(agents, near)


@device_function
def _radius(size: Float64, world: int, row: int) -> float:
    return 0.5 * math.hypot(size[world, row, 0], size[world, row, 1])


@device_function
def _speed(velocity: Float64, world: int, row: int) -> float:
    return math.hypot(velocity[world, row, 0], velocity[world, row, 1])


@device_function(allocates=True)
def _listed(agents: Int32, near: Bool) -> Int32:
    listed = np.empty((len(agents) + near.sum(), 2), np.int32)
    listed[: len(agents)] = agents
    count = len(agents)
    for world in range(near.shape[0]):
        for row in range(near.shape[1]):
            if near[world, row]:
                listed[count, 0], listed[count, 1] = world, row
                count += 1
    return listed


@kernel
def read_motion(
    position: Float64, heading: Float64, velocity: Float64, yaw_rate: Float64, rows: Int32, num_agents: int, dt: float
) -> Float64:
    """Where bodies start: agents where they are, the others where their motion had them ``dt`` earlier.

    Args:
        position, velocity: (W, N, 2).
        heading, yaw_rate: (W, N).
        rows: (B, 2) world and row, the agents first.
        num_agents: How many agents there are.
        dt: [s].

    Returns:
        (B, 6) x, y [m], heading [rad], velocity along x and y [m/s], yaw rate [rad/s].
    """
    motion = np.empty((len(rows), 6))
    for b in range(len(rows)):
        world, row = rows[b, 0], rows[b, 1]
        before = dt if b >= num_agents else 0.0
        motion[b, 0] = position[world, row, 0] - velocity[world, row, 0] * before
        motion[b, 1] = position[world, row, 1] - velocity[world, row, 1] * before
        motion[b, 2] = heading[world, row] - yaw_rate[world, row] * before
        motion[b, 3], motion[b, 4] = velocity[world, row, 0], velocity[world, row, 1]
        motion[b, 5] = yaw_rate[world, row]
    return motion


@kernel
def write_motion(
    position: Float64, heading: Float64, velocity: Float64, yaw_rate: Float64, agents: Int32, motion: Float64
) -> None:
    """Write what :func:`read_motion` returns back into the rows of the agents; headings into [-pi, pi)."""
    for a in range(len(agents)):
        world, row = agents[a, 0], agents[a, 1]
        position[world, row, 0], position[world, row, 1] = motion[a, 0], motion[a, 1]
        heading[world, row] = (motion[a, 2] + math.pi) % (2.0 * math.pi) - math.pi
        velocity[world, row, 0], velocity[world, row, 1] = motion[a, 3], motion[a, 4]
        yaw_rate[world, row] = motion[a, 5]
