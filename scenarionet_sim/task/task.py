"""The driving task of the ScenarioNet paper: reward and termination."""

from __future__ import annotations

from dataclasses import astuple, dataclass
from enum import IntEnum

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

    Attributes:
        displacement, smoothness, collision: c1, c2, c3.
        road_user, object: P_collision for touching a road user, or another object.
        arrived, off_route: R_term for reaching the destination, and for leaving the reference trajectory.
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


def task_parameters(reward: Reward, termination: Termination) -> Float64:
    """Return (12,) the attributes of both, in their order, as ``task.scoring_kernels.score`` takes them."""
    return np.array([*astuple(reward), *astuple(termination)], dtype=np.float64)
