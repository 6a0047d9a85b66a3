"""Statistics in a scenario's row of ``metadata``, computed from its arrays when it is encoded.

summary         every statistic, one function a column or a few
gaps            the ego's nearest neighbour, compiled
intersections   whether lanes cross near the ego's path, compiled
"""

from __future__ import annotations

from scenarionet_data.statistics.summary import summarise

__all__ = ["summarise"]
