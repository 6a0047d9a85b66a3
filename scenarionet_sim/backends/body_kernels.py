"""Transfer between the state of a simulation and the rigid bodies of a physics engine."""

from __future__ import annotations

import math

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32
from scenarionet_data.compiled.decorators import kernel
from scenarionet_sim.arrays.log import HEADING, VX, VY, YAW_RATE, X, Y

_BODY = np.array([X, Y, HEADING, VX, VY, YAW_RATE])
"""Columns of ``State.motion`` that a body has, in the order of :func:`read_motion`."""


def find_bodies(motion: Float64, size: Float64, present: Bool, agents: Int32, slack: float, dt: float) -> Int32:
    """Return the agents, followed by every other object within reach of one in the next step.

    Args:
        motion: (W, N, 7).
        size: (W, N, 3) [m].
        present: (W, N).
        agents: (A, 2) world and row.
        slack: Speed an agent may gain during the step [m/s].
        dt: [s].

    Returns:
        (B, 2) int32 world and row: the agents as given, then the others in ascending order.
    """
    near = np.zeros(present.shape, np.bool_)
    mark_near(motion, size, present, agents, slack, dt, near)
    near[agents[:, 0], agents[:, 1]] = False
    worlds, others = near.nonzero()
    found = np.empty((len(agents) + len(worlds), 2), np.int32)
    found[: len(agents)], found[len(agents) :, 0], found[len(agents) :, 1] = agents, worlds, others
    return found


@kernel
def mark_near(
    motion: Float64, size: Float64, present: Bool, agents: Int32, slack: float, dt: float, near: Bool
) -> None:
    """Mark objects in ``near`` (W, N) whose circumscribed circle can meet an agent's within ``dt``."""
    for a in range(len(agents)):
        w, row = agents[a, 0], agents[a, 1]
        reach = 0.5 * math.hypot(size[w, row, 0], size[w, row, 1])
        reach += (math.hypot(motion[w, row, VX], motion[w, row, VY]) + slack) * dt
        for other in range(present.shape[1]):
            if present[w, other]:
                radius = 0.5 * math.hypot(size[w, other, 0], size[w, other, 1])
                limit = reach + radius + math.hypot(motion[w, other, VX], motion[w, other, VY]) * dt
                x = motion[w, other, X] - motion[w, row, X]
                y = motion[w, other, Y] - motion[w, row, Y]
                near[w, other] |= x * x + y * y <= limit * limit


def read_motion(motion: Float64, rows: Int32, num_agents: int, dt: float) -> Float64:
    """Return the initial motion of bodies: agents as they are, all others moved back by ``dt``.

    Args:
        motion: (W, N, 7).
        rows: (B, 2) world and row, the agents first.
        num_agents: Number of agents.
        dt: [s].

    Returns:
        (B, 6) x, y [m], heading [rad], velocity along x and y [m/s], yaw rate [rad/s].
    """
    bodies: Float64 = motion[rows[:, :1], rows[:, 1:], _BODY]
    bodies[num_agents:, :3] -= bodies[num_agents:, 3:] * dt
    return bodies


def write_motion(motion: Float64, agents: Int32, bodies: Float64) -> None:
    """Write the bodies (A, 6) of the agents back into ``motion`` (W, N, 7), with headings wrapped in place."""
    bodies[:, 2] = (bodies[:, 2] + math.pi) % (2.0 * math.pi) - math.pi
    motion[agents[:, :1], agents[:, 1:], _BODY] = bodies
