"""Which lanes of a map follow one another, as nuPlan's metrics ask for them.

Source: nuplan-devkit, ``planning/metrics/utils/route_extractor.py`` (definitions).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.roads.roads import Roads

LaneRows = tuple[int, ...]
"""Rows of lanes in ``Roads``."""


@dataclass(frozen=True, eq=False)
class LaneLinks:
    """Which lanes of a map follow one another; answers are remembered, as moments ask for the same lanes.

    Attributes:
        roads: The map.
    """

    roads: Roads
    _after: dict[int, LaneRows] = field(default_factory=dict, init=False, repr=False)
    _before: dict[int, LaneRows] = field(default_factory=dict, init=False, repr=False)

    def after(self, lane: int) -> LaneRows:
        """Lanes that follow a lane."""
        if lane not in self._after:
            self._after[lane] = tuple(self.roads.successors[lane].tolist())
        return self._after[lane]

    def before(self, lane: int) -> LaneRows:
        """Lanes that a lane follows."""
        if lane not in self._before:
            places = np.flatnonzero(self.roads.successors.values == lane)
            self._before[lane] = tuple((np.searchsorted(self.roads.successors.offsets, places, "right") - 1).tolist())
        return self._before[lane]

    @cached_property
    def is_connector(self) -> Bool:
        """(M,) lanes through an intersection, as nuPlan's maps tell them from others."""
        kind: Bool = self.roads.lane_type == MapFeatureType.LANE_SURFACE_UNSTRUCTURE
        return kind

    def at(self, here: frozenset[int]) -> LaneRows:
        """The lanes around a point, or else the connectors."""
        lanes = tuple(sorted(lane for lane in here if not self.is_connector[lane]))
        return lanes or tuple(sorted(here))

    def continued(self, lanes: LaneRows, here: frozenset[int]) -> LaneRows:
        """Those of some lanes around a point, or of the followers of the only one."""
        found = tuple(lane for lane in lanes if lane in here)
        if not found and len(lanes) == 1:
            found = tuple(lane for lane in self.after(lanes[0]) if lane in here)
        return found

    def by_heading(self, lanes: LaneRows, point: Float64, heading: float) -> LaneRows:
        """The same lanes, the one along a heading first."""
        if len(lanes) < 2:
            return lanes
        line, (x, y), direction = self.roads.lanes, point.tolist(), (math.cos(heading), math.sin(heading))
        rows = {lane: (line.offsets[lane], line.offsets[lane + 1]) for lane in lanes}
        return tuple(sorted(lanes, key=lambda lane: -_cosine_along(line.values, *rows[lane], x, y, *direction)))


@kernel(allocates=False)
def _cosine_along(line: Float32, first: int, end: int, x: float, y: float, cos: float, sin: float) -> float:
    """Return the cosine of the angle between a direction and a line at its point nearest to (x, y), or -1.

    Args:
        line, first, end: (P, 2) points [m], and the rows of the line among them.
        x, y: The point [m].
        cos, sin: The direction.
    """
    cosine, best = -1.0, np.inf
    for n in range(first, end - 1):
        x0, y0 = np.float64(line[n, 0]), np.float64(line[n, 1])
        dx, dy = line[n + 1, 0] - x0, line[n + 1, 1] - y0
        square = max(dx * dx + dy * dy, 1e-12)
        share = min(max(((x - x0) * dx + (y - y0) * dy) / square, 0.0), 1.0)
        apart_x, apart_y = x0 + share * dx - x, y0 + share * dy - y
        apart = apart_x * apart_x + apart_y * apart_y
        if apart < best:
            cosine, best = (dx * cos + dy * sin) / math.sqrt(square), apart
    return cosine
