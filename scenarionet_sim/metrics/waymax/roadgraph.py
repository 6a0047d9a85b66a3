"""Off-road driving: Waymax's ``offroad`` (definition).

A corner is off the road if the point of a road edge nearest to it has the corner on its right: edges have the road on
their left, as in the Waymo Open Motion Dataset.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Bool, Float64, Int32
from scenarionet_data.scenario.vocabulary import is_road_edge
from scenarionet_sim.roads.roads import Roads

Z_STRETCH = 2.0
"""Factor on differences of height, so that an edge on another level is far."""


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
        """The starts of a map's segments of edges, and the end of the last one of each edge; without heights."""
        kept = np.flatnonzero(is_road_edge(roads.segment_type))
        start, end = roads.segments[kept, :2].astype(np.float64), roads.segments[kept, 2:].astype(np.float64)
        edge = roads.segment_feature[kept]
        step = end - start
        direction = step / np.maximum(np.hypot(*step.T), 1e-9)[:, None]
        last = np.flatnonzero(np.diff(edge, append=-1) != 0)
        position = np.insert(start, last + 1, end[last], axis=0)
        return cls(
            np.column_stack((position, np.zeros(len(position)))),
            np.insert(direction, last + 1, direction[last], axis=0),
            np.insert(edge, last + 1, edge[last]),
        )

    @cached_property
    def _tree(self) -> shapely.STRtree:
        return shapely.STRtree(shapely.points(self.position[:, :2]))

    def signed_distance(self, points: Float64) -> Float64:
        """Distance (Q,) in the plane to the nearest point of an edge [m], positive off the road.

        Args:
            points: (Q, 3) [m].
        """
        nearest = self._nearest(points)
        before = np.maximum(nearest - 1, 0)
        away = points[:, :2] - self.position[nearest, :2]
        side, side_before = _cross(away, self.direction[nearest]), _cross(away, self.direction[before])
        is_joined = self.edge[nearest] == self.edge[before]
        sign = np.sign(np.where(is_joined & (side_before < side), side_before, side))
        found: Float64 = np.hypot(*away.T) * sign
        return found

    def _nearest(self, points: Float64) -> Int32:
        """Row (Q,) of the nearest point, heights stretched."""
        if not self.position[:, 2].any() and not points[:, 2].any():
            _, found = self._tree.query_nearest(shapely.points(points[:, :2]), all_matches=False)
            return np.asarray(found, np.int32)
        stretch = [1.0, 1.0, Z_STRETCH]
        apart = [np.square((self.position - point) * stretch).sum(axis=1).argmin() for point in points]
        return np.array(apart, np.int32)


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
    found: Float64 = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return found
