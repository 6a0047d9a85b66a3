"""What a policy is: it writes the next moment of the objects it drives, from this moment of all."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import Bool, UInt8
from scenarionet_sim.policies.objects import ObjectMask, all_objects
from scenarionet_sim.worlds.state import State
from scenarionet_sim.worlds.world import World
from scenarionet_sim.worlds.world_batch import WorldBatch


@dataclass(frozen=True)
class Policy(ABC):
    """Drives some objects of every world.

    Attributes:
        objects: Which objects it wants.
    """

    objects: ObjectMask = all_objects

    def wants(self, world: World) -> Bool:
        """(N,) the objects it drives, unless a later policy wants them too."""
        return self.objects(world)

    def prepare(self, world: World, driven: Bool) -> World:
        """The world as this policy needs it; ``driven`` (N,) are the objects it drives there."""
        del driven
        return world

    @abstractmethod
    def advance(self, batch: WorldBatch, now: State, then: State, driver: UInt8, me: int, dt: float) -> None:
        """Write the objects that it drives into the next moment.

        Every policy reads the same moment, so the order of policies and objects changes nothing.

        Args:
            batch: The worlds.
            now: This moment.
            then: The next moment; of its arrays, the rows of objects that others drive are not to be touched.
            driver: (W, N) uint8 which policy drives each object.
            me: The number of this one in ``driver``.
            dt: Seconds between the moments.
        """
