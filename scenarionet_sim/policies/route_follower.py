"""Reactive traffic that continues along the lanes of the map when its recorded path ends."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import Bool
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.worlds.routes import continued
from scenarionet_sim.worlds.world import World


@dataclass(frozen=True)
class RouteFollower(Idm):
    """Like :class:`Idm`, but a path that ends on a lane continues along that lane and its successors.

    At a split it takes the lane that turns least. Without a map, or off all lanes, it behaves like Idm.

    Attributes:
        beyond: Length of the continuation [m].
    """

    beyond: float = 200.0

    def prepare(self, world: World, driven: Bool) -> World:
        """Return the world with extended paths."""
        return continued(super().prepare(world, driven), driven, self.beyond)
