"""Protocol of backends: vehicle dynamics that move the agents, and only those, by one control step.

A backend is a frozen, picklable specification; live resources (a physics client, scratch memory) belong to its
session. A session reads poses and velocities of the agents from the state of the simulation and writes them back.
All other objects have already been moved by their policies and are obstacles.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.settings import check_settings

if TYPE_CHECKING:
    from scenarionet_sim.worlds.state import State
    from scenarionet_sim.worlds.world_batch import WorldBatch


CONTROL_STEP = 0.1
"""Seconds from one action to the next."""

SUBSTEPS = 5
"""Physics steps per control step: 0.02 s each, as in MetaDrive."""


@dataclass(frozen=True)
class Drive:
    """Capabilities of a driven vehicle; of the defaults, the first five are the same for every backend.

    Attributes:
        max_steer: Angle of the front wheels at steering 1 [rad].
        acceleration: Acceleration at full throttle [m/s²].
        braking: Deceleration at full brake [m/s²].
        max_speed: Speed above which the engine does not accelerate [m/s].
        wheelbase: Distance between the axles, as a share of the length; both axles at equal distance from the centre.
        steering_rate: Largest change of the front wheels' angle [rad/s]; ``Kinematic`` alone, as the rest.
        drag: Deceleration by the air per square of the speed [1/m].
        rolling: Deceleration by rolling resistance and engine brake [m/s²].
        reverse: Largest speed backwards [m/s], which the brake leads to from standstill; 0 without a reverse gear.
    """

    max_steer: float = math.radians(40.0)
    acceleration: float = 4.0
    braking: float = 8.0
    max_speed: float = 40.0
    wheelbase: float = 0.6
    steering_rate: float = math.radians(45.0)
    drag: float = 0.0
    rolling: float = 0.0
    reverse: float = 0.0

    def __post_init__(self) -> None:
        check_settings(self)


class Session(Protocol):
    """Live part of a backend, for the W worlds of a batch."""

    def reset(self, world: int, state: State) -> None:
        """Begin a new episode in a slot, possibly of another scenario.

        Args:
            world: The slot.
            state: State at the beginning of the episode.
        """
        ...

    def drive(self, state: State, agents: Int32, actions: Float64, dt: float) -> None:
        """Move the agents by one control step, in place.

        Args:
            state: Rows of agents hold their current state, all other rows their state after the step.
            agents: (A, 2) int32 world and row of each agent.
            actions: (A, 2) float64 steering (positive to the left) and throttle (negative: brake), as
                :func:`checked_actions` returns them.
            dt: Length of the control step [s].
        """
        ...

    def close(self) -> None:
        """Release resources; idempotent."""
        ...


@runtime_checkable
class Backend(Protocol):
    """Vehicle dynamics: hashable, picklable, compared by value."""

    def open(self, batch: WorldBatch) -> Session:
        """Open a session for the worlds of a batch.

        Raises:
            MissingDependency: A package that the backend needs is not installed.
        """
        ...


def as_numbers(actions: npt.ArrayLike) -> Float64:
    """Return actions as float64, in the memory of the caller where they are.

    Raises:
        BadParameter: They are no numbers, or of different lengths.
    """
    try:
        return np.asarray(actions, np.float64, order="C")
    except (OverflowError, TypeError, ValueError) as error:
        raise BadParameter(f"actions: expected steering and throttle of each agent, found {actions!r}") from error


def checked_actions(actions: npt.ArrayLike) -> Float64:
    """Return actions as (A, 2) float64, clipped to [-1, 1].

    Raises:
        BadParameter: An action is no pair of finite numbers.
    """
    given = as_numbers(actions)
    if given.size % 2:
        raise BadParameter(f"actions: expected steering and throttle of each agent, found {actions!r}")
    rows = given.reshape(-1, 2)
    if not np.isfinite(rows).all():
        raise BadParameter(f"an action is not finite: {rows[~np.isfinite(rows).all(axis=1)][0].tolist()}")
    return rows.clip(-1.0, 1.0)
