"""Driving tasks, reward and termination: those of the ScenarioNet paper, and a careful one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import astuple, dataclass
from enum import IntEnum
from types import MappingProxyType

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.scenario.settings import check_settings


class Status(IntEnum):
    """Status of an agent's episode."""

    DRIVING = 0
    ARRIVED = 1
    OFF_ROUTE = 2
    TIMED_OUT = 3


DRIVING, ARRIVED, OFF_ROUTE, TIMED_OUT = (int(status) for status in Status)


@dataclass(frozen=True)
class Reward:
    """R = c1 R_disp + c2 P_smooth + c3 P_collision + R_term, with the paper's weights for one agent.

    * R_disp = d_t - d_(t-1), the longitudinal progress [m] in the Frenet frame of the reference trajectory.
    * P_smooth = min(0, 1 / v_t - |a[0]|): penalty for steering that is too large at speed v_t [m/s]; 0 below 0.1 m/s.
    * P_collision: the largest penalty of all objects touched in this step, once.
    * R_term: at the last step, depending on how the episode ended; R_disp is 0 then.

    The paper has neither a limit of speed nor comfort; with ``speeding`` and ``harshness`` they are part of P_smooth.

    Attributes:
        displacement, smoothness, collision: c1, c2, c3.
        road_user, object: P_collision for touching a road user, or another object.
        arrived, off_route: R_term for reaching the destination, and for leaving the reference trajectory.
        slow: Speed below which the paper's P_smooth is 0 [m/s].
        speeding: For each m/s above the agent's highest recorded speed, which stands for a limit, in each step.
        harshness: For each m/s² of a change of speed beyond ``harsh`` [m/s²], in each step.
    """

    displacement: float = 2.0
    smoothness: float = 1.0
    collision: float = 1.0
    road_user: float = -2.0
    object: float = -0.5
    arrived: float = 10.0
    off_route: float = -5.0
    slow: float = 0.1
    speeding: float = 0.0
    harshness: float = 0.0
    harsh: float = 3.0

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class Termination:
    """Conditions that end an episode.

    Attributes:
        off_route: Largest distance from the reference trajectory [m].
        completion: Share of the route at which the destination is reached.
        short_route: Length below which a route is complete from the beginning [m].
        extra_steps: Steps after the end of the recording before the episode is truncated.
    """

    off_route: float = 2.5
    completion: float = 0.95
    short_route: float = 2.0
    extra_steps: int = 50

    def __post_init__(self) -> None:
        check_settings(self)


SINGLE_AGENT = (Reward(), Termination())
"""The paper's single-agent task."""

MULTI_AGENT = (
    Reward(displacement=1.0, smoothness=0.0, road_user=-1.0, object=-1.0, off_route=-1.0),
    Termination(off_route=10.0),
)
"""The paper's multi-agent task: R = R_disp + P_collision + R_term."""


CAREFUL = (Reward(road_user=-20.0, object=-10.0, speeding=-1.0, harshness=-0.5), Termination())
"""One agent for whom a step in contact with a road user costs as much as 10 m, and who keeps the limit softly."""

TASKS: Mapping[str, tuple[Reward, Termination]] = MappingProxyType({"paper": SINGLE_AGENT, "careful": CAREFUL})
"""Tasks of one agent that learners' settings name."""


def task_parameters(reward: Reward, termination: Termination, dt: float) -> Float64:
    """Return (16,) the attributes of both, in their order, and the timestep [s], as ``scoring_kernels.score`` takes."""
    return np.array([*astuple(reward), *astuple(termination), dt], dtype=np.float64)
