"""All metrics of a rollout, as a row of ``schemas/results.toml``."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightColor, MapFeatureType
from scenarionet_sim.backends.base import Drive
from scenarionet_sim.evaluation.rollout import Rollout
from scenarionet_sim.metrics.collisions import count_collisions
from scenarionet_sim.metrics.comfort import body_acceleration, measure_comfort
from scenarionet_sim.metrics.feasibility import is_infeasible
from scenarionet_sim.metrics.progress import displacement, mean_speed, progress_ratio
from scenarionet_sim.metrics.road import ON_LANE, is_off_road, lane_progress, runs_red_light, wrong_way
from scenarionet_sim.metrics.time_to_collision import time_to_collision
from scenarionet_sim.worlds.world import World

_CORNERS = np.array([[0.5, 0.5], [0.5, -0.5], [-0.5, -0.5], [-0.5, 0.5]])


def measure(rollout: Rollout, world: World) -> dict[str, Any]:
    """Return the metrics of a rollout; None where the scenario lacks what a metric needs, such as a map or lights."""
    agent = rollout.agent
    corners = _corners(rollout, world)
    row = {
        "status": rollout.end,
        "steps": rollout.num_steps,
        "success": rollout.end == "success",
        "out_of_road": rollout.end == "out_of_road",
        "timeout": rollout.end == "timeout",
        "route_completion": rollout.completion,
        "mean_speed": mean_speed(rollout.velocity[:, agent]),
        **_collisions(rollout, world),
        **_motion(rollout),
        **_beside_the_log(rollout, world),
        "min_time_to_collision": _time_to_collision(rollout, world, corners),
        **_rules(rollout, world, corners),
    }
    return {name: _plain(value) for name, value in row.items()}


def _plain(value: Any) -> Any:
    """Replace NaN and infinity by None."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _collisions(rollout: Rollout, world: World) -> dict[str, Any]:
    found = count_collisions(rollout.contacts, world.object_type)
    return {
        "collided_vehicles": found.vehicles,
        "collided_humans": found.humans,
        "collided_objects": found.objects,
        "cost": found.cost,
        "first_collision": None if found.first is None else found.first * rollout.dt,
    }


def _motion(rollout: Rollout) -> dict[str, Any]:
    """Comfort and infeasible steps."""
    heading, velocity = rollout.heading[:, rollout.agent], rollout.velocity[:, rollout.agent]
    comfort = measure_comfort(body_acceleration(velocity, heading, rollout.dt), heading, rollout.dt)
    speed = velocity[:, 0] * np.cos(heading) + velocity[:, 1] * np.sin(heading)
    is_known = not math.isnan(comfort.max_jerk)
    return {
        **asdict(comfort),
        "is_comfortable": comfort.is_comfortable if is_known else None,
        "infeasible_steps": int(is_infeasible(speed, heading, rollout.dt).sum()),
    }


def _beside_the_log(rollout: Rollout, world: World) -> dict[str, Any]:
    """Distance from the recording, and progress relative to it."""
    recorded = world.log_position[rollout.start :, rollout.agent].astype(np.float64)
    valid = world.log_valid[rollout.start :, rollout.agent]
    average, final = displacement(rollout.position[:, rollout.agent], recorded, valid)
    length = float(world.paths.length()[rollout.agent])
    return {
        "average_displacement": average,
        "final_displacement": final,
        "progress_ratio": progress_ratio(rollout.progress, length),
    }


def _time_to_collision(rollout: Rollout, world: World, corners: Float64) -> float:
    agent = rollout.agent
    touched = np.logical_or.accumulate(rollout.contacts, axis=0)
    soonest = time_to_collision(
        np.ascontiguousarray(rollout.position),
        np.ascontiguousarray(rollout.heading),
        np.ascontiguousarray(rollout.velocity),
        world.size.astype(np.float64),
        rollout.present,
        touched,
        _is_between_lanes(corners, rollout, world),
        agent,
        0.5 * Drive().wheelbase * float(world.size[agent, 0]),
    )
    return float(soonest.min())


def _is_between_lanes(corners: Float64, rollout: Rollout, world: World) -> Bool:
    """Return moments (T,) with corners in different lanes, or the centre in an intersection."""
    roads = world.roads
    if not roads.num_lanes:
        return np.zeros(len(corners), np.bool_)
    lanes = roads.lane_at(corners)
    differ: Bool = (lanes != lanes[:, :1]).any(axis=1)
    crossing = roads.polygon_type == MapFeatureType.INTERSECTION
    return differ | roads.is_in(rollout.position[:, rollout.agent], crossing)


def _rules(rollout: Rollout, world: World, corners: Float64) -> dict[str, Any]:
    """Off-road time, wrong-way distance and red-light violations; None without a map or lights."""
    roads, position = world.roads, np.ascontiguousarray(rollout.position[:, rollout.agent])
    off_road = wrong = red = None
    if roads.is_road.any():
        off_road = float(is_off_road(corners, roads).sum() * rollout.dt)
    if roads.num_lanes:
        progress = lane_progress(position, roads.lanes.values, roads.lanes.offsets, ON_LANE)
        wrong = wrong_way(progress, rollout.dt)[0]
    stop, direction, is_red = _lights(rollout, world)
    if len(stop):
        red = int(runs_red_light(position, stop, direction, is_red).sum())
    return {"off_road_time": off_road, "wrong_way_distance": wrong, "red_light_violations": red}


def _lights(rollout: Rollout, world: World) -> tuple[Float64, Float64, Bool]:
    """Return stop points, lane directions and red phases of the lights whose lane is in the map."""
    rows = np.flatnonzero((world.light_lane >= 0) & np.isfinite(world.light_stop).all(axis=1))
    rows = rows[world.roads.lanes.lengths[world.light_lane[rows]] > 1]
    steps = np.minimum(rollout.start + np.arange(rollout.num_steps + 1), world.num_steps - 1)  # the last state stays
    is_red: Bool = LIGHT_COLORS[world.light_state[rows][:, steps]] == LightColor.RED
    stop = world.light_stop[rows].astype(np.float64)
    lanes = (world.roads.lanes[lane].astype(np.float64) for lane in world.light_lane[rows])
    direction = [_direction(lane, point) for lane, point in zip(lanes, stop, strict=True)]
    return stop, np.array(direction).reshape(-1, 2), is_red


def _direction(line: Float64, point: Float64) -> Float64:
    """(2,) direction of a line at its point nearest to a given one."""
    along = np.diff(line, axis=0)
    square = np.maximum((along**2).sum(axis=1), 1e-12)
    share = np.clip(((point - line[:-1]) * along).sum(axis=1) / square, 0.0, 1.0)
    nearest = np.argmin(((line[:-1] + share[:, None] * along - point) ** 2).sum(axis=1))
    unit: Float64 = along[nearest] / np.sqrt(square[nearest])
    return unit


def _corners(rollout: Rollout, world: World) -> Float64:
    """(T, 4, 2) corners of the agent's box [m]."""
    heading = rollout.heading[:, rollout.agent]
    cos, sin = np.cos(heading), np.sin(heading)
    x, y = (_CORNERS * world.size[rollout.agent, :2].astype(np.float64)).T
    turned = np.stack((np.outer(cos, x) - np.outer(sin, y), np.outer(sin, x) + np.outer(cos, y)), axis=-1)
    corners: Float64 = rollout.position[:, rollout.agent, None] + turned
    return corners
