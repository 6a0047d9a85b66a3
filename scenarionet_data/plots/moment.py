"""What moves, at one moment of one scene: from its recording, or from a simulation."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import Bool, Float64


@dataclass(frozen=True, eq=False)
class Moment:
    """N objects of a scene, row by row.

    Attributes:
        timestep: Since the recording's beginning; past its end the lights show what they showed last.
        position: (N, 2) float64 [m].
        heading: (N,) float64 [rad].
        present: (N,) bool.
    """

    timestep: int
    position: Float64
    heading: Float64
    present: Bool
