"""Criticality: how near two objects are to a collision, by every measure that has a closed form."""

from scenarionet_data.criticality.registry import MEASURES
from scenarionet_data.criticality.scene import Assumptions
from scenarionet_data.criticality.table import LEFT_OUT, criticality, measure_moments

__all__ = ["LEFT_OUT", "MEASURES", "Assumptions", "criticality", "measure_moments"]
