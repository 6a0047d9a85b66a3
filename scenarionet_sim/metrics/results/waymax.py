"""Waymax's metrics for a rollout, as columns of ``schemas/results.toml``."""

from __future__ import annotations

import numpy as np

from scenarionet_sim.metrics.episodes import DrivenEpisodes, MeasuredColumns
from scenarionet_sim.metrics.overlap import count_overlaps
from scenarionet_sim.metrics.waymax.kinematics import count_infeasible
from scenarionet_sim.metrics.waymax.roadgraph import RoadEdges, is_offroad
from scenarionet_sim.metrics.waymax.routes import Routes, off_route, wrong_way


def measure_together(group: DrivenEpisodes) -> MeasuredColumns:
    """Return Waymax's metrics; None where the map lacks what one needs."""
    drives, has_lanes, edges = group.drives, group.lanes is not None, group.roads.once(RoadEdges.of)
    routes, first = Routes.of(group.recorded, group.recorded_lanes, group.roads), drives.offsets[:-1]
    distances = routes.distances(drives)
    overlapping, infeasible = np.empty((2, len(first)), np.int64)
    count_overlaps(drives, group.boxes, overlapping, 0.0)
    count_infeasible(drives, group.boxes, np.array([each.rollout.dt for each in group.episodes]), infeasible)
    off_road = (
        np.add.reduceat(is_offroad(drives.corners, edges), first, dtype=np.int64) if len(edges.position) else None
    )
    return {
        "overlap_steps": overlapping,
        "offroad_steps": off_road,
        "wrong_way_offset": np.maximum.reduceat(wrong_way(distances), first) if has_lanes else None,
        "off_route_offset": np.maximum.reduceat(off_route(distances), first) if has_lanes else None,
        "progression": routes.progression(drives, group.recorded),
        "infeasible_steps": infeasible,
    }
