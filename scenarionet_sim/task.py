"""What driving well means: the reward, and how an episode ends, as the ScenarioNet paper defines them.

Everything is about A agents at one step, as arrays. Where they are along their reference trajectory (arc length
and distance, the Frenet frame's two numbers) and what they touch is measured elsewhere; here it is judged.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.procedural.jit import entry

Float64 = npt.NDArray[np.float64]


class Status(IntEnum):
    """How an agent's episode stands."""

    DRIVING = 0
    ARRIVED = 1
    OFF_ROUTE = 2
    TIMED_OUT = 3


class Contact(IntEnum):
    """What an agent touches, the worst of it."""

    NOTHING = 0
    OBJECT = 1  # a cone, a barrier, anything else that is placed and not alive
    ROAD_USER = 2  # a vehicle, a pedestrian, a cyclist


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
class Ending:
    """When an episode ends.

    Attributes:
        off_route: Distance from the reference trajectory beyond which it is left [m].
        completion: Share of the route beyond which the destination is reached.
        short_route: A route shorter than this [m] is complete from the beginning.
        extra_steps: Steps an episode may take beyond the recording's.
    """

    off_route: float = 2.5
    completion: float = 0.95
    short_route: float = 2.0
    extra_steps: int = 50

    @cached_property
    def numbers(self) -> Float64:
        """(4,) the attributes in their order."""
        return np.array(astuple(self), dtype=np.float64)


SINGLE_AGENT = (Reward(), Ending())
"""The paper's single-agent task."""

MULTI_AGENT = (
    Reward(displacement=1.0, smoothness=0.0, road_user=-1.0, object=-1.0, off_route=-1.0),
    Ending(off_route=10.0),
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
    status: npt.NDArray[np.uint8]
    completion: Float64

    @classmethod
    def of(cls, count: int) -> Verdict:
        """For ``count`` agents."""
        return cls(np.zeros((count, len(TERMS))), np.zeros(count, np.uint8), np.zeros(count))


@entry
def judge(
    arc: Float64,
    arc_before: Float64,
    offset: Float64,
    length: Float64,
    speed: Float64,
    steering: Float64,
    contact: npt.NDArray[np.uint8],
    steps: npt.NDArray[np.int64],
    recorded: npt.NDArray[np.int64],
    reward: Float64,
    ending: Float64,
    terms: Float64,
    status: npt.NDArray[np.uint8],
    completion: Float64,
) -> None:
    """Write rewards, status and completion of A agents after a step.

    An agent that is both beyond the end of its route and off it has left it: arriving means arriving on the route.

    Args:
        arc, arc_before: (A,) longitudinal position on the reference trajectory now and a step ago [m].
        offset: (A,) distance from the reference trajectory [m].
        length: (A,) of the reference trajectory [m].
        speed: (A,) [m/s].
        steering: (A,) first number of the action, in [-1, 1].
        contact: (A,) codes of ``Contact``.
        steps: (A,) steps since the agent began, this one included.
        recorded: (A,) timesteps of the recording.
        reward, ending: ``Reward.numbers``, ``Ending.numbers``.
        terms, status, completion: Written; see ``Verdict``.
    """
    c1, c2, c3, p_road_user, p_object, r_arrived, r_off_route, slow = reward
    max_offset, min_completion, short_route, extra_steps = ending
    for agent in range(arc.shape[0]):
        is_short = length[agent] < short_route
        done = 1.0 if is_short else min(max(arc[agent] / length[agent], 0.0), 1.0)
        completion[agent] = done
        displacement, terminal = arc[agent] - arc_before[agent], 0.0
        state = 0
        if offset[agent] > max_offset:
            state, terminal = 2, r_off_route
        elif is_short or done > min_completion:
            state, terminal = 1, r_arrived
        elif steps[agent] >= recorded[agent] + extra_steps:
            state = 3
        smoothness = 0.0
        if speed[agent] >= slow:
            smoothness = min(0.0, 1.0 / speed[agent] - abs(steering[agent]))
        collision = 0.0
        if contact[agent] == 2:
            collision = p_road_user
        elif contact[agent] == 1:
            collision = p_object
        terms[agent, 0] = c1 * displacement if state == 0 else 0.0
        terms[agent, 1] = c2 * smoothness
        terms[agent, 2] = c3 * collision
        terms[agent, 3] = terminal
        status[agent] = state


def is_terminated(status: npt.NDArray[Any]) -> npt.NDArray[np.bool_]:
    """Where an episode has ended by what the agent did: it arrived, or left its route."""
    ended: npt.NDArray[np.bool_] = (status == Status.ARRIVED) | (status == Status.OFF_ROUTE)
    return ended
