"""Every part of nuPlan's closed-loop score for a rollout, as columns of ``schemas/results.toml``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool
from scenarionet_data.scenario.vocabulary import MapFeatureType
from scenarionet_sim.metrics.comfort import Comfort, are_within_bounds, measure_comforts
from scenarionet_sim.metrics.drive import SurroundingBoxes
from scenarionet_sim.metrics.episodes import DrivenEpisodes, MeasuredColumns, rows_of
from scenarionet_sim.metrics.nuplan.collisions import CollisionKind, EgoCollision, collision_score, find_collisions
from scenarionet_sim.metrics.nuplan.progress import ExpertRoutes
from scenarionet_sim.metrics.nuplan.scoring import (
    closed_loop_score,
    direction_score,
    progress_score,
    speed_limit_score,
    wrong_way_distances,
)
from scenarionet_sim.metrics.nuplan.time_to_collision import BOUND, least_times, time_to_collision
from scenarionet_sim.metrics.overlap import MARGIN, count_overlaps
from scenarionet_sim.metrics.road import is_off_road


def measure_together(group: DrivenEpisodes) -> MeasuredColumns:
    """Return nuPlan's metrics; None where the map lacks what one needs, or the drive is too short for its filter."""
    drives, recorded, roads, lanes = group.drives, group.recorded, group.roads, group.lanes
    if lanes is None:
        is_in_lane = np.ones(len(drives.heading), np.bool_)
        ratios = ExpertRoutes.without_map(recorded).ratios(drives, recorded)
    else:
        is_in_lane = lanes.is_in_lane
        ratios = ExpertRoutes.of(recorded, group.recorded_lanes, lanes.links).ratios(drives, recorded)
    crossing = roads.is_in(drives.axle, roads.polygon_type == MapFeatureType.INTERSECTION)
    collisions, soonest = _contacts(group, is_in_lane, crossing)
    extremes = measure_comforts(drives.acceleration, drives.heading, drives.offsets, drives.dt)
    comforts = dict(zip(Comfort.__dataclass_fields__, extremes.T, strict=True))
    kinds = [Counter(collision.kind for collision in found) for found in collisions]
    fault: MeasuredColumns = dict.fromkeys(("at_fault_collisions", "no_ego_at_fault_collisions"))
    if lanes is not None:
        fault["at_fault_collisions"] = [sum(collision.is_at_fault for collision in found) for found in collisions]
        fault["no_ego_at_fault_collisions"] = [collision_score(found) for found in collisions]
    columns: MeasuredColumns = {
        "progress_ratio": ratios,
        **{f"{kind}_collisions": [found[kind] for found in kinds] for kind in CollisionKind},
        **fault,
        "min_time_to_collision": [0.0 if found else soon for found, soon in zip(collisions, soonest, strict=True)],
        "is_time_to_collision_in_bound": [soon > BOUND for soon in soonest],
        **comforts,
        "is_comfortable": [
            None if np.isnan(jerk) else is_within
            for jerk, is_within in zip(comforts["max_jerk"], are_within_bounds(extremes).tolist(), strict=True)
        ],
        "off_road_time": _off_road_times(group),
        **_along_lanes(group),
    }
    return columns | {"nuplan_score": [_score(row) for row in rows_of(columns, len(group.episodes))]}


def _contacts(group: DrivenEpisodes, is_in_lane: Bool, crossing: Bool) -> tuple[list[list[EgoCollision]], list[float]]:
    """Return the collisions of each episode, and the least times to a collision [s].

    Args:
        group: The episodes.
        is_in_lane, crossing: (S,) see ``time_to_collision``.
    """
    touching = np.empty(len(group.episodes), np.int64)
    count_overlaps(group.drives, group.boxes, touching, MARGIN)
    soonest = least_times(group.drives, group.boxes, ~is_in_lane | crossing).tolist()
    found: list[list[EgoCollision]] = [[] for _ in soonest]
    for number in np.flatnonzero(touching).tolist():
        episode, part = group.episodes[number], group.drives.part(number)
        others = SurroundingBoxes.of(episode.scored, episode.world)
        found[number] = find_collisions(episode.drive, others, is_in_lane[part])
        times = time_to_collision(episode.drive, others, found[number], is_in_lane[part], crossing[part])
        soonest[number] = float(times.min())
    return found, soonest


def _off_road_times(group: DrivenEpisodes) -> Sequence[float | None]:
    """Return times [s] outside the drivable area; None if the map has none, or the recording itself is outside."""
    roads, lanes, drives, recorded = group.roads, group.lanes, group.drives, group.recorded
    if not roads.is_road.any():
        return [None] * len(group.episodes)
    on_road, on_lane = roads.is_on_road(recorded.corners), None if lanes is None else lanes.on_lane
    times: list[float | None] = []
    for number in range(len(group.episodes)):
        known, part = recorded.part(number), drives.part(number)
        time = None
        if on_road[known].all() or not is_off_road(recorded.corners[known], roads).any():
            on_lanes, time = None if on_lane is None else on_lane[part], 0.0
            if on_lanes is None or not on_lanes.all():
                time = float(is_off_road(drives.corners[part], roads, on_lanes).sum() * drives.dt[number])
        times.append(time)
    return times


def _along_lanes(group: DrivenEpisodes) -> MeasuredColumns:
    """Lane changes, driving against the traffic and above the speed limit."""
    lanes, drives = group.lanes, group.drives
    if lanes is None:
        names = "lane_changes", "failed_lane_changes", "wrong_way_distance", "max_overspeed", "speed_limit_compliance"
        return dict.fromkeys(names)
    counts, limit = lanes.num_changes.tolist(), lanes.speed_limit()
    over = np.where(np.isnan(limit), 0.0, np.maximum(drives.speed - limit, 0.0))
    most = np.maximum.reduceat(over, drives.offsets[:-1])
    is_known, compliance = np.logical_or.reduceat(~np.isnan(limit), drives.offsets[:-1]), np.ones(len(most))
    for number in np.flatnonzero(most).tolist():
        too_fast, dt = over[drives.part(number)], group.episodes[number].world.dt
        compliance[number] = speed_limit_score(too_fast, dt * np.arange(len(too_fast), dtype=np.float64))
    return {
        "lane_changes": counts,
        "failed_lane_changes": [
            sum(not each.is_completed for each in lanes.lane_changes(number)) if count else 0
            for number, count in enumerate(counts)
        ],
        "wrong_way_distance": wrong_way_distances(lanes.progress(), drives.offsets, drives.dt),
        "max_overspeed": np.where(is_known, most, np.nan),
        "speed_limit_compliance": np.where(is_known, compliance, np.nan),
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
