"""What an agent knows of itself: how it moves, and where it is on its own path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenarionet_data.geometry import wrap_angle
from scenarionet_sim.kernels.ahead import heading_of_path
from scenarionet_sim.sensors.base import Agents, Array, Sensor, require
from scenarionet_sim.stage import Stage
from scenarionet_sim.state import State

WHEELBASE = 0.6
"""Between the axles, as a share of the length: what a steering angle is derived with."""


@dataclass(frozen=True)
class EgoState(Sensor):
    """Steering, heading, velocity and place relative to the reference path.

    Observes (7,) float32 in [-1, 1], each clipped there:

    0. speed forward / ``max_speed``
    1. speed to the left / ``max_speed``
    2. yaw rate / ``max_yaw_rate``, counter-clockwise
    3. angle of the front wheels of a bicycle that turns as the agent does / (pi / 2); 0 below 0.1 m/s
    4. heading minus the path's / pi; 0 for a path without a direction
    5. distance from the path / ``max_offset``, positive to its left
    6. share of the path's length that is done

    Attributes:
        max_speed: [m/s].
        max_yaw_rate: [rad/s].
        max_offset: [m].
    """

    low: ClassVar[float] = -1.0

    max_speed: float = 40.0
    max_yaw_rate: float = 2.0
    max_offset: float = 10.0

    def __post_init__(self) -> None:
        scales = self.max_speed, self.max_yaw_rate, self.max_offset
        require(min(scales) > 0, f"max_speed, max_yaw_rate and max_offset are above 0, found {scales}")

    @property
    def shape(self) -> tuple[int, ...]:
        """(7,)."""
        return (7,)

    def observe(self, stage: Stage, state: State, agents: Agents, rng: np.random.Generator, out: Array) -> Array:  # noqa: ARG002
        """See the class."""
        world, row = agents.T
        heading, velocity, yaw_rate = (a[world, row] for a in (state.heading, state.velocity, state.yaw_rate))
        cos, sin = np.cos(heading), np.sin(heading)
        forward = cos * velocity[:, 0] + sin * velocity[:, 1]
        path_heading = np.empty(len(agents))
        heading_of_path(agents, state.arc, stage.path_points, stage.path_arc, stage.path_offsets, path_heading)
        out[:, 0] = forward / self.max_speed
        out[:, 1] = (cos * velocity[:, 1] - sin * velocity[:, 0]) / self.max_speed
        out[:, 2] = yaw_rate / self.max_yaw_rate
        out[:, 3] = _steering(forward, yaw_rate, state.size[world, row, 0]) / (np.pi / 2)
        out[:, 4] = np.nan_to_num(wrap_angle(heading - path_heading)) / np.pi
        out[:, 5] = state.lateral[world, row] / self.max_offset
        out[:, 6] = _completion(stage, state, agents)
        return np.clip(out, -1.0, 1.0, out=out)


def _steering(forward: Array, yaw_rate: Array, length: Array) -> Array:
    """(A,) [rad]; a bicycle's yaw rate is speed * tan(angle) / wheelbase."""
    is_moving = np.abs(forward) >= 0.1
    curvature = np.divide(yaw_rate, forward, out=np.zeros_like(forward), where=is_moving)
    angle: Array = np.arctan(WHEELBASE * length * curvature)
    return angle


def _completion(stage: Stage, state: State, agents: Agents) -> Array:
    """(A,) in [0, 1]; 1 for a path without length."""
    world, row = agents.T
    first, end = stage.path_offsets[world, row], stage.path_offsets[world, row + 1]
    last = np.minimum(np.maximum(end - 1, 0), max(stage.path_arc.shape[1] - 1, 0))
    length = np.where(end > first, stage.path_arc[world, last], 0.0).astype(np.float64)
    share = np.divide(state.arc[world, row], length, out=np.ones_like(length), where=length > 0)
    done: Array = np.clip(share, 0.0, 1.0)
    return done
