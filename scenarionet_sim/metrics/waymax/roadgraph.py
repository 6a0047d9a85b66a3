"""Off-road driving: Waymax's ``offroad`` (definition).

A corner is off the road if the point of a road edge nearest to it has the corner on its right: edges have the road on
their left, as in the Waymo Open Motion Dataset.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32, Int64
from scenarionet_data.compiled.decorators import kernel
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.metrics.waymax.nearest import PointSet
from scenarionet_sim.roads.roads import Roads

EDGES = (MapFeatureType.ROAD_EDGE_BOUNDARY, MapFeatureType.ROAD_EDGE_MEDIAN)
"""Types of edges that have the road on their left; those of other types are outlines of sidewalks and the like."""

SPACING = 0.5
"""Distance between the points of an edge [m]."""

Z_STRETCH = 2.0
"""Factor on differences of height, so that an edge on another level is far."""

_STRETCH = np.array([1.0, 1.0, Z_STRETCH])

_IS_EDGE: Bool = np.isin(np.arange(256), EDGES)
"""(256,) whether a code of ``MapFeatureType`` is in EDGES."""


@dataclass(frozen=True, eq=False)
class RoadEdges:
    """Points of road edges.

    Attributes:
        position: (P, 3) [m], edge by edge.
        direction: (P, 2) unit vectors along the edge.
        edge: (P,) which edge each belongs to.
    """

    position: Float64
    direction: Float64
    edge: Int32

    @classmethod
    def of(cls, roads: Roads) -> RoadEdges:
        """Points every half metre, as in the owner's data, along the edges of a map; without heights."""
        kept = np.flatnonzero(_IS_EDGE[roads.segment_type])
        start, end = roads.segments[kept, :2].astype(np.float64), roads.segments[kept, 2:].astype(np.float64)
        edge, step = roads.segment_feature[kept], end - start
        length = np.hypot(*step.T)
        count = np.maximum(np.ceil(length / SPACING), 1.0).astype(np.int64)
        count += np.diff(edge, append=-1) != 0  # the end of an edge is a point, too
        total = int(count.sum())
        edges = cls(np.zeros((total, 3)), np.empty((total, 2)), np.empty(total, np.int32))
        _sample(start, step, np.maximum(length, 1e-9), edge, count, edges.position, edges.direction, edges.edge)
        return edges

    @cached_property
    def _stretched(self) -> PointSet:
        return PointSet.of(_STRETCH * self.position)

    def signed_distance(self, points: Float64) -> Float64:
        """Distance (Q,) in the plane to the nearest point of an edge [m], positive off the road.

        Args:
            points: (Q, 3) [m].
        """
        nearest, _ = self._stretched.nearest(_STRETCH * points)
        before = np.maximum(nearest - 1, 0)
        away = points[:, :2] - self.position[nearest, :2]
        side, side_before = _cross(away, self.direction[nearest]), _cross(away, self.direction[before])
        is_joined = self.edge[nearest] == self.edge[before]
        sign = np.sign(np.where(is_joined & (side_before < side), side_before, side))
        found: Float64 = np.hypot(*away.T) * sign
        return found


@kernel(allocates=False)
def _sample(
    start: Float64, step: Float64, length: Float64, edge: Int32, count: Int64, position: Float64, direction: Float64,
    owner: Int32,
) -> None:  # fmt: skip
    """Write ``count`` points along each segment, its direction and its edge."""
    row = 0
    for s in range(len(start)):
        for n in range(count[s]):
            share = min(n * SPACING / length[s], 1.0)
            for axis in range(2):
                position[row, axis] = start[s, axis] + share * step[s, axis]
                direction[row, axis] = step[s, axis] / length[s]
            owner[row] = edge[s]
            row += 1


def is_offroad(corners: Float64, edges: RoadEdges) -> Bool:
    """Return the moments (T,) at which a corner is off the road.

    Args:
        corners: (T, 4, 2) [m].
        edges: Without heights.
    """
    flat = corners.reshape(-1, 2)
    distance = edges.signed_distance(np.column_stack((flat, np.zeros(len(flat)))))
    off: Bool = np.any(distance.reshape(corners.shape[:2]) > 0.0, axis=1)
    return off


def _cross(first: Float64, second: Float64) -> Float64:
    return first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
