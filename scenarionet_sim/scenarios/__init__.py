"""Which scenarios of a lake are played, in which order, and how they come into memory ahead of their episodes."""

from scenarionet_sim.scenarios.sampling import Curriculum
from scenarionet_sim.scenarios.selection import Scenarios

__all__ = ["Curriculum", "Scenarios"]
