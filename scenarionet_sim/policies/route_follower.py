"""Traffic that goes on when its recorded path ends: along the lanes of the map."""

from __future__ import annotations

from dataclasses import dataclass

from scenarionet_data.arrays.dtypes import Bool
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.worlds.routes import continued
from scenarionet_sim.worlds.world import World


@dataclass(frozen=True)
class RouteFollower(Idm):
    """Like :class:`Idm`, but a path that ends on a lane goes on along it and the lanes that follow.

    Where lanes part it takes the one that turns least. Without a map, or beside every lane, it is Idm.

    Attributes:
        beyond: How far paths go on [m].
    """

    beyond: float = 200.0

    def prepare(self, world: World, driven: Bool) -> World:
        """The world with longer paths for its objects."""
        return continued(world, driven, self.beyond)
