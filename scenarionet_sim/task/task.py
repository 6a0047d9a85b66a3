"""What driving well means: the reward, and how an episode ends, as the ScenarioNet paper defines them.

Everything is about A agents at one step, as arrays. Where they are along their reference trajectory (arc length
and lateral distance, the Frenet frame's two numbers) and what they touch is measured elsewhere; here it is judged.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from enum import IntEnum
from functools import cached_property

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.compiled import kernel
from scenarionet_data.arrays.dtypes import Array, Bool, Float32, Float64, Int32, UInt8
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.kernels.minmax import larger, smaller


class Status(IntEnum):
    """How an agent's episode stands."""

    DRIVING = 0
    ARRIVED = 1
    OFF_ROUTE = 2
    TIMED_OUT = 3


DRIVING, ARRIVED, OFF_ROUTE, TIMED_OUT = (int(status) for status in Status)

ROAD_USERS = np.uint32(sum(1 << kind for kind in (ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST)))
"""Bits of the types whose touch is a collision with a vehicle or a human; all others are objects."""

TERMS = ("displacement", "smoothness", "collision", "terminal")
"""Columns of the rewards of :func:`judge`."""


@dataclass(frozen=True)
class Reward:
    """R = c1 R_disp + c2 P_smooth + c3 P_collision + R_term, with the paper's weights for one agent.

    * R_disp = d_t - d_(t-1), the longitudinal progress [m] in the Frenet frame of the reference trajectory.
    * P_smooth = min(0, 1 / v_t - |a[0]|): steering that is too large for the speed v_t [m/s]; 0 below 0.1 m/s.
    * P_collision: of what is touched at this step, the largest penalty, once.
    * R_term: at the last step, by how the episode ended, and then R_disp = 0.

    Attributes:
        displacement, smoothness, collision: c1, c2, c3.
        road_user, object: P_collision for touching each.
        arrived, off_route: R_term for reaching the destination and for leaving the reference trajectory.
        slow: Speed below which P_smooth is 0 [m/s].
    """

    displacement: float = 2.0
    smoothness: float = 1.0
    collision: float = 1.0
    road_user: float = -2.0
    object: float = -0.5
    arrived: float = 10.0
    off_route: float = -5.0
    slow: float = 0.1

    @cached_property
    def numbers(self) -> Float64:
        """(8,) the attributes in their order."""
        return np.array(astuple(self), dtype=np.float64)


@dataclass(frozen=True)
class Termination:
    """When an episode ends.

    Attributes:
        off_route: Distance from the reference trajectory beyond which it is left [m].
        completion: Share of the route beyond which the destination is reached.
        short_route: A route shorter than this [m] is complete from the beginning.
        extra_steps: Steps an episode may last beyond the recording's end.
    """

    off_route: float = 2.5
    completion: float = 0.95
    short_route: float = 2.0
    extra_steps: int = 50

    @cached_property
    def numbers(self) -> Float64:
        """(4,) the attributes in their order."""
        return np.array(astuple(self), dtype=np.float64)


SINGLE_AGENT = (Reward(), Termination())
"""The paper's single-agent task."""

MULTI_AGENT = (
    Reward(displacement=1.0, smoothness=0.0, road_user=-1.0, object=-1.0, off_route=-1.0),
    Termination(off_route=10.0),
)
"""The paper's multi-agent task: R = R_disp + P_collision + R_term."""


@dataclass(eq=False)
class Verdict:
    """What :func:`judge` says about A agents, overwritten at every step.

    Attributes:
        terms: (A, 4) float64 weighted terms of the reward, in the order of ``TERMS``; their sum is the reward.
        status: (A,) uint8 codes of ``Status``.
        completion: (A,) float64 share of the route that is done, 0 to 1.
    """

    terms: Float64
    status: UInt8
    completion: Float64

    @classmethod
    def of(cls, count: int) -> Verdict:
        """For ``count`` agents."""
        return cls(np.zeros((count, len(TERMS))), np.zeros(count, np.uint8), np.zeros(count))


@kernel
def judge(
    agents: Int32,
    arc: Float64,
    arc_before: Float64,
    lateral: Float64,
    velocity: Float64,
    path_arc: Float32,
    path_offsets: Int32,
    timestep: Int32,
    num_steps: Int32,
    steering: Float64,
    hits: npt.NDArray[np.uint32],
    reward: Float64,
    termination: Float64,
    terms: Float64,
    status: UInt8,
    completion: Float64,
) -> None:
    """Write rewards, status and completion of A agents after a step.

    An agent that is both beyond the end of its route and off it has left it: arriving means arriving on the route.

    Args:
        agents: (A, 2) world and row.
        arc, arc_before: (W, N) place along the reference trajectory now and a step ago [m].
        lateral: (W, N) distance from it to the left [m].
        velocity: (W, N, 2) [m/s].
        path_arc, path_offsets: Reference trajectories, see ``WorldBatch``.
        timestep, num_steps: (W,) of the log: now, and how many there are.
        steering: (A,) first number of each action, in [-1, 1].
        hits: (A,) types of object that each agent touches, as bits.
        reward, termination: ``Reward.numbers``, ``Termination.numbers``.
        terms, status, completion: Written; see ``Verdict``.
    """
    c1, c2, c3, p_road_user, p_object, r_arrived, r_off_route, slow = reward
    max_lateral, min_completion, short_route, extra_steps = termination
    for a in range(len(agents)):
        w, n = agents[a, 0], agents[a, 1]
        first, end = path_offsets[w, n], path_offsets[w, n + 1]
        length = path_arc[w, end - 1] if end > first else 0.0
        is_short = length < short_route
        done = 1.0 if is_short else smaller(larger(arc[w, n] / length, 0.0), 1.0)
        state, terminal = DRIVING, 0.0
        if abs(lateral[w, n]) > max_lateral:
            state, terminal = OFF_ROUTE, r_off_route
        elif is_short or done > min_completion:
            state, terminal = ARRIVED, r_arrived
        elif timestep[w] >= num_steps[w] + extra_steps:
            state = TIMED_OUT
        speed = np.hypot(velocity[w, n, 0], velocity[w, n, 1])
        smoothness = smaller(0.0, 1.0 / speed - abs(steering[a])) if speed >= slow else 0.0
        collision = 0.0
        if hits[a] & ROAD_USERS:
            collision = p_road_user
        elif hits[a]:
            collision = p_object
        terms[a, 0] = c1 * (arc[w, n] - arc_before[w, n]) if state == DRIVING else 0.0
        terms[a, 1] = c2 * smoothness
        terms[a, 2] = c3 * collision
        terms[a, 3] = terminal
        status[a] = state
        completion[a] = done


def is_terminated(status: Array) -> Bool:
    """Where an episode has ended by what the agent did: it arrived, or left its route."""
    ended: Bool = (status == Status.ARRIVED) | (status == Status.OFF_ROUTE)
    return ended
