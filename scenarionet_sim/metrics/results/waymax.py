"""Waymax's metrics for a rollout, as columns of ``schemas/results.toml``."""

from __future__ import annotations

from typing import Any

import numpy as np

from scenarionet_sim.metrics.drive import DrivenEpisode
from scenarionet_sim.metrics.waymax.kinematics import is_infeasible
from scenarionet_sim.metrics.waymax.overlap import overlaps
from scenarionet_sim.metrics.waymax.roadgraph import RoadEdges, is_offroad
from scenarionet_sim.metrics.waymax.routes import RouteDistances, Routes, off_route, progression, wrong_way


def measure(episode: DrivenEpisode) -> dict[str, Any]:
    """Return Waymax's metrics; None where the map lacks what one needs."""
    if not episode.is_whole:
        return {}
    rollout, drive, recorded, world = episode.scored, episode.drive, episode.recorded, episode.world
    agent, edges = rollout.agent, world.roads.once(RoadEdges.of)
    routes, has_lanes = Routes.of(recorded, world.roads), world.roads.num_lanes > 0
    distances = RouteDistances.of(drive.position, routes)
    touches = overlaps(rollout.position, rollout.heading, world.size[:, :2].astype(np.float64), rollout.present, agent)
    return {
        "overlap_steps": int(touches.sum()),
        "offroad_steps": int(is_offroad(drive.corners, edges).sum()) if len(edges.position) else None,
        "wrong_way_offset": float(wrong_way(distances).max()) if has_lanes else None,
        "off_route_offset": float(off_route(distances).max()) if has_lanes else None,
        "progression": progression(drive.position[-1], recorded.position[0], recorded.position[-1], routes),
        "infeasible_steps": int(is_infeasible(rollout.velocity[:, agent], drive.heading, rollout.dt).sum()),
    }
