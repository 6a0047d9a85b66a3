"""Selection, order and prefetching of the scenarios that an environment plays."""

from scenarionet_sim.scenarios.sampling import Curriculum
from scenarionet_sim.scenarios.selection import Scenarios

__all__ = ["Curriculum", "Scenarios"]
