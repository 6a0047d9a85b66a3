"""What nuPlan's metrics look at: the motion of one vehicle, and the boxes around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, UInt8


@dataclass(frozen=True, eq=False)
class EgoDrive:
    """Motion of the evaluated vehicle over T moments, in any fixed frame.

    Attributes:
        time: (T,) [s], increasing.
        position: (T, 2) [m] centre of the box.
        heading: (T,) [rad].
        speed: (T,) [m/s] magnitude of the velocity.
        acceleration: (T, 2) [m/s²] along and across the heading.
        length, width: Of the box [m].
        rear: Distance from the centre back to the rear axle [m].
    """

    time: Float64
    position: Float64
    heading: Float64
    speed: Float64
    acceleration: Float64
    length: float
    width: float
    rear: float

    @property
    def dt(self) -> float:
        """Mean time between two moments [s]."""
        return float(np.diff(self.time).mean())

    @property
    def rear_axle(self) -> Float64:
        """(T, 2) positions of the rear axle [m]."""
        axis = np.column_stack((np.cos(self.heading), np.sin(self.heading)))
        found: Float64 = self.position - self.rear * axis
        return found


@dataclass(frozen=True, eq=False)
class SurroundingBoxes:
    """Boxes of N objects over the T moments of a drive.

    Attributes:
        position: (T, N, 2) [m] centres.
        heading: (T, N) [rad].
        speed: (T, N) [m/s]; 0 for static objects.
        size: (N, 2) [m] length and width.
        object_type: (N,) codes of ``ObjectType``.
        present: (T, N) observed.
    """

    position: Float64
    heading: Float64
    speed: Float64
    size: Float64
    object_type: UInt8
    present: Bool
