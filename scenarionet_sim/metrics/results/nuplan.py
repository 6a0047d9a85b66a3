"""Every part of nuPlan's closed-loop score for a rollout, as columns of ``schemas/results.toml``."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.metrics.comfort import measure_comfort
from scenarionet_sim.metrics.drive import DrivenEpisode, EgoDrive, SurroundingBoxes
from scenarionet_sim.metrics.lanes import DrivenLanes, driven_route
from scenarionet_sim.metrics.nuplan.collisions import CollisionKind, collision_score, find_collisions
from scenarionet_sim.metrics.nuplan.progress import ExpertRoute
from scenarionet_sim.metrics.nuplan.scoring import (
    closed_loop_score,
    direction_score,
    driving_direction,
    progress_score,
    speed_limit_score,
)
from scenarionet_sim.metrics.nuplan.time_to_collision import BOUND, time_to_collision
from scenarionet_sim.metrics.road import is_off_road
from scenarionet_sim.roads.roads import Roads


def measure(episode: DrivenEpisode) -> dict[str, Any]:
    """Return nuPlan's metrics; None where the map lacks what one needs, or the drive is too short for its filter."""
    if not episode.is_whole:
        return {}
    drive, recorded, world = episode.drive, episode.recorded, episode.world
    others, roads = SurroundingBoxes.of(episode.scored, world), world.roads
    lanes = DrivenLanes.of(drive, roads) if roads.num_lanes else None
    is_in_lane = np.ones(len(drive.time), np.bool_) if lanes is None else lanes.is_in_lane
    collisions = find_collisions(drive, others, is_in_lane)
    knows_lanes, kinds = lanes is not None, Counter(each.kind for each in collisions)
    crossing = roads.is_in(drive.rear_axle, roads.polygon_type == MapFeatureType.INTERSECTION)
    soonest = float(time_to_collision(drive, others, collisions, is_in_lane, crossing).min())
    if lanes is None:
        expert = ExpertRoute.of(None, (), recorded.position)
    else:
        is_recorded = np.array_equal(drive.position, recorded.position)
        route = lanes.route if is_recorded else driven_route(lanes.graph, recorded)
        expert = ExpertRoute.of(lanes.graph, route, recorded.position)
    comfort = measure_comfort(drive.acceleration, drive.heading, drive.dt)
    row = {
        "progress_ratio": expert.ratio(drive.position, recorded.position),
        **{f"{kind}_collisions": kinds[kind] for kind in CollisionKind},
        "at_fault_collisions": sum(each.is_at_fault for each in collisions) if knows_lanes else None,
        "no_ego_at_fault_collisions": collision_score(collisions) if knows_lanes else None,
        "min_time_to_collision": 0.0 if collisions else soonest,
        "is_time_to_collision_in_bound": soonest > BOUND,
        **vars(comfort),
        "is_comfortable": None if math.isnan(comfort.max_jerk) else comfort.is_comfortable,
        "off_road_time": _off_road_time(drive, recorded, roads, lanes),
        **_along_lanes(drive, lanes),
    }
    return row | {"nuplan_score": _score(row)}


def _off_road_time(drive: EgoDrive, recorded: EgoDrive, roads: Roads, lanes: DrivenLanes | None) -> float | None:
    """Return the time [s] outside the drivable area; None if the map has none, or the recording itself is outside."""
    if not roads.is_road.any():
        return None
    off = is_off_road(drive.corners, roads, None if lanes is None else lanes.on_lane)
    is_recorded = np.array_equal(drive.corners, recorded.corners)
    if (off if is_recorded else is_off_road(recorded.corners, roads)).any():
        return None
    return float(off.sum() * drive.dt)


def _along_lanes(drive: EgoDrive, lanes: DrivenLanes | None) -> dict[str, Any]:
    """Lane changes, driving against the traffic and above the speed limit."""
    if lanes is None:
        return dict.fromkeys(
            ("lane_changes", "failed_lane_changes", "wrong_way_distance", "max_overspeed", "speed_limit_compliance")
        )
    changes = lanes.lane_changes()
    _, smallest = driving_direction(lanes.progress(drive.position), drive.dt)
    limit = lanes.speed_limit()
    over = np.where(np.isnan(limit), 0.0, np.maximum(drive.speed - limit, 0.0))
    is_known = not np.isnan(limit).all()
    return {
        "lane_changes": len(changes),
        "failed_lane_changes": sum(not each.is_completed for each in changes),
        "wrong_way_distance": -smallest,
        "max_overspeed": float(over.max()) if is_known else None,
        "speed_limit_compliance": speed_limit_score(over, drive.time) if is_known else None,
    }


def _score(row: dict[str, Any]) -> float | None:
    """The closed-loop score; None where a multiplier is unknown, which would make it another score."""
    if row["off_road_time"] is None or row["wrong_way_distance"] is None:
        return None
    return closed_loop_score(
        {
            "no_ego_at_fault_collisions": row["no_ego_at_fault_collisions"],
            "drivable_area_compliance": float(row["off_road_time"] == 0.0),
            "driving_direction_compliance": direction_score(row["wrong_way_distance"]),
            "ego_is_making_progress": progress_score(row["progress_ratio"]),
            "ego_progress_along_expert_route": row["progress_ratio"],
            "time_to_collision_within_bound": float(row["is_time_to_collision_in_bound"]),
            "speed_limit_compliance": row["speed_limit_compliance"],
            "ego_is_comfortable": None if row["is_comfortable"] is None else float(row["is_comfortable"]),
        }
    )
