"""The last moments of a simulation, for sensors that show where objects have been."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64

if TYPE_CHECKING:
    from scenarionet_sim.worlds.state import State


@dataclass(eq=False)
class History:
    """K moments of W worlds of N objects, the latest first; a moment before an episode's first has nobody in it.

    Attributes:
        position: (K, W, N, 2) float64 [m].
        heading: (K, W, N) float64 [rad].
        present: (K, W, N) bool.
    """

    position: Float64
    heading: Float64
    present: Bool

    @classmethod
    def empty(cls, num_moments: int, num_worlds: int, num_objects: int) -> History:
        """Nobody at any moment."""
        shape = num_moments, num_worlds, num_objects
        return cls(np.zeros((*shape, 2)), np.zeros(shape), np.zeros(shape, np.bool_))

    def remember(self, state: State) -> None:
        """Add a moment and drop the oldest."""
        for moments, now in zip(
            (self.position, self.heading, self.present), (state.position, state.heading, state.present), strict=True
        ):
            moments[1:] = moments[:-1]
            moments[:1] = now

    def forget(self, slot: int) -> None:
        """A world begins a new episode."""
        self.present[:, slot] = False

    def with_room(self, num_objects: int) -> History:
        """The same for more objects, who have not been there."""
        num_moments, num_worlds, old = self.present.shape
        larger, here = History.empty(num_moments, num_worlds, num_objects), slice(0, old)
        larger.position[:, :, here] = self.position
        larger.heading[:, :, here], larger.present[:, :, here] = self.heading, self.present
        return larger
