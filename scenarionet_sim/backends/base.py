"""What a backend is: it moves the vehicles that are driven, and only those, by one control step.

A backend is a frozen specification that pickles; what lives (a physics engine's client, scratch memory) is its
session. The state of the simulation is the one truth: a session reads poses and velocities of the agents from it
and writes them back. Everything else in the state has been moved by policies before, and is what agents run into.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Float64, Int32
from scenarionet_data.errors import BadParameter

if TYPE_CHECKING:
    from scenarionet_sim.worlds.state import State
    from scenarionet_sim.worlds.world_batch import WorldBatch


CONTROL_STEP = 0.1
"""Seconds from one action to the next."""

SUBSTEPS = 5
"""Physics steps in a control step: 0.02 s each, as in MetaDrive."""


@dataclass(frozen=True)
class Drive:
    """What a driven vehicle is capable of; the same for every backend.

    Attributes:
        max_steer: Angle of the front wheels at steering 1 [rad].
        acceleration: At full throttle [m/s²].
        braking: At full brake [m/s²].
        max_speed: The engine adds nothing beyond it [m/s].
        wheelbase: Between the axles, as a share of the vehicle's length; the axles are as far from its centre.
    """

    max_steer: float = math.radians(40.0)
    acceleration: float = 4.0
    braking: float = 8.0
    max_speed: float = 40.0
    wheelbase: float = 0.6


class Session(Protocol):
    """The live part of a backend, over the W worlds of a batch."""

    def reset(self, world: int, state: State) -> None:
        """Forget a world's past: it begins a new episode, perhaps of another scenario.

        Args:
            world: Its slot.
            state: As it is at the beginning of the episode.
        """
        ...

    def drive(self, state: State, agents: Int32, actions: Float64, dt: float) -> None:
        """Move the agents by one control step, in place.

        Args:
            state: The agents' rows as they are now; every other row already at its pose after the step.
            agents: (A, 2) int32 world and row of each agent.
            actions: (A, 2) float64 steering (positive to the left) and throttle (negative: brake, never
                reverse), as :func:`checked_actions` returns them.
            dt: Length of the control step [s].
        """
        ...

    def close(self) -> None:
        """Give back what the session holds; closing twice does nothing."""
        ...


@runtime_checkable
class Backend(Protocol):
    """A way to move driven vehicles: hashable, picklable, compared by value."""

    def open(self, batch: WorldBatch) -> Session:
        """A session over the worlds of a batch.

        Raises:
            MissingDependency: A package that only this backend needs is not installed.
        """
        ...


def checked_actions(actions: npt.ArrayLike) -> Float64:
    """Actions within [-1, 1], as an array (A, 2) of float64; what lies outside is clipped.

    Raises:
        BadParameter: One is not a number.
    """
    clipped: Float64 = np.minimum(np.maximum(np.asarray(actions, np.float64).reshape(-1, 2), -1.0), 1.0)
    if math.isnan(clipped.sum()):
        raise BadParameter(f"an action is not a number: {clipped[np.isnan(clipped).any(axis=1)][0].tolist()}")
    return clipped
