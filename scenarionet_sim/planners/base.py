"""A planner: it gets a view of the world and returns an action or a trajectory."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Float64
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.errors import BadParameter
from scenarionet_sim.planners.view import View


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Poses of the centre of the vehicle's box in the future.

    Attributes:
        poses: (K, 3) x, y [m], heading [rad], in the frame of the view that it answers.
        times: (K,) seconds from now, rising from 0 or later, to the end of the timestep at least. A trajectory that
            does not begin at 0 begins where the vehicle is: its tracker has no error to correct.

    Raises:
        BadParameter: The shapes do not fit, a number is not finite, or times do not rise.
    """

    poses: Array
    times: Array

    def __post_init__(self) -> None:
        try:
            poses, times = np.asarray(self.poses, np.float64), np.asarray(self.times, np.float64)
        except (TypeError, ValueError) as error:
            raise BadParameter(f"a trajectory of {self.poses!r} at {self.times!r}; expected numbers") from error
        if poses.ndim != 2 or poses.shape[1:] != (3,) or times.shape != (len(poses),) or not len(poses):
            raise BadParameter(
                f"a trajectory of poses {poses.shape} at times {times.shape}; expected (K, 3) x, y, heading at (K,)"
            )
        if not (np.isfinite(poses).all() and np.isfinite(times).all()):
            raise BadParameter("a trajectory has a pose or a time that is not finite; check the planner's arithmetic")
        if times[0] < 0.0 or (np.diff(times) <= 0.0).any():
            raise BadParameter("the times of a trajectory must rise from 0 or later")
        object.__setattr__(self, "poses", poses)
        object.__setattr__(self, "times", times)

    @classmethod
    def every(cls, dt: float, poses: npt.ArrayLike) -> Trajectory:
        """Return poses (K, 3) that are ``dt`` apart, the first of them ``dt`` from now."""
        array = np.asarray(poses, np.float64)
        return cls(array, dt * np.arange(1.0, len(array) + 1))

    def at(self, times: Array) -> Float64:
        """Return poses (..., 3) at times [s], linear in between, and at rest beyond the ends."""
        unwrapped = np.unwrap(self.poses[:, 2])
        x, y, heading = (np.interp(times, self.times, values) for values in (*self.poses[:, :2].T, unwrapped))
        return np.stack([x, y, wrap_angle(heading)], axis=-1)


Action = Sequence[float] | Float64
"""Steering (positive left) and throttle (negative: brake), each in [-1, 1]."""


class Planner(ABC):
    """Drives one vehicle from views of its world; constructed once per episode, without arguments, or by a function.

    A planner is used by name (``sim --policy my_module:MyPlanner``) or as a policy (``Planned(MyPlanner)``).

    Attributes:
        frame: Frame of the view, and of the trajectories that answer it: ``scenario``, or ``ego`` (x forward, y left).
        history: Number of past moments that the view's objects have.
    """

    frame: ClassVar[Literal["scenario", "ego"]] = "scenario"
    history: ClassVar[int] = 0

    def expect(self, view: View) -> None:  # noqa: B027 - most planners need none
        """Take a view that ``act`` gets in the same timestep, once all planners have theirs.

        For planners that ask another process for all vehicles at once; others need nothing here.
        """

    @abstractmethod
    def act(self, view: View) -> Action | Trajectory:
        """Return what to do in the next timestep.

        Args:
            view: The world now; valid until this method returns, as its arrays are those of the simulation.
        """
