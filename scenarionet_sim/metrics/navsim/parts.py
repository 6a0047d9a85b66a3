"""The rules that a plan is scored by, one function each.

Source: navsim, ``planner/pdm_planner/scoring/pdm_scorer.py`` and ``pdm_scorer_utils.py`` (definitions).
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.metrics.drive import EgoDrive, SurroundingBoxes
from scenarionet_sim.metrics.navsim.scene import PlanAreas, PlanScene
from scenarionet_sim.metrics.nuplan.collisions import AHEAD, BEHIND, STOPPED, box_outline
from scenarionet_sim.metrics.nuplan.scoring import direction_score

LOOK_AHEAD = (0, 3, 6, 9)
"""Poses ahead at which a plan's boxes, moved on at constant velocity, must touch nothing."""

MAX_OFFSET, MAX_OFFSET_TIME = 0.5, 2.0
"""Distance from the centreline [m], and for how long without a break it may be exceeded [s]."""

_STANDING = 5e-3  # [m/s]
_DIRECTION_WINDOW = 1.0  # [s]
_AGENTS = (ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST)


def measure_plan(plan: EgoDrive, scene: PlanScene) -> dict[str, float]:
    """Return the parts of a plan that depend on its surroundings, by the names of ``PlanParts``; progress in metres."""
    areas = PlanAreas.of(plan, scene)
    touching = _touching(plan.corners, scene.others)
    return {
        "no_at_fault_collisions": no_at_fault_collisions(plan, scene.others, touching, areas),
        "drivable_area_compliance": float(not areas.is_off_road.any()),
        "driving_direction_compliance": driving_direction(plan, areas),
        "traffic_light_compliance": traffic_lights(plan, scene),
        "progress": progress(plan, scene.centreline),
        "time_to_collision_within_bound": time_to_collision(plan, scene.others, areas),
        "lane_keeping": lane_keeping(plan, scene.centreline, areas),
    }


def no_at_fault_collisions(plan: EgoDrive, others: SurroundingBoxes, touching: Bool, areas: PlanAreas) -> float:
    """0 if the plan hits a road user by its fault, 0.5 if only other objects, else 1.

    Fault is that of nuPlan. An object that is touched without fault is forgotten; one that stood when it was first
    seen counts as standing.

    Args:
        plan: The plan.
        others: The objects.
        touching: (T, N) objects that the box touches.
        areas: Where the plan drives.
    """
    score, forgotten = 1.0, set()
    first_speed = others.speed[np.argmax(others.present, axis=0), np.arange(len(others.size))]
    for step, track in np.argwhere(touching).tolist():
        if track in forgotten:
            continue
        is_at_fault = plan.speed[step] > STOPPED
        if is_at_fault and first_speed[track] > STOPPED:
            is_behind = _along(plan, step, others.position[step, track]) < BEHIND
            bumper = shapely.LineString(plan.corners[step][[0, 3]])
            is_between = areas.is_between_lanes[step] or areas.is_off_road[step]
            is_at_fault = not is_behind and (is_between or bumper.intersects(_outline(others, step, track)))
        if is_at_fault:
            score = min(score, 0.0 if others.object_type[track] in _AGENTS else 0.5)
        else:
            forgotten.add(track)
    return score


def driving_direction(plan: EgoDrive, areas: PlanAreas) -> float:
    """1, 0.5 or 0 by the way driven within a second outside of intersections with the centre off the route's lanes."""
    way = np.append(0.0, np.hypot(*np.diff(plan.position, axis=0).T))
    way[~areas.is_off_route | areas.is_crossing] = 0.0
    window = int(_DIRECTION_WINDOW / plan.dt + 1e-6)
    within = [way[max(0, step - window) : step + 1].sum() for step in range(len(way))]
    return direction_score(float(max(within)))


def traffic_lights(plan: EgoDrive, scene: PlanScene) -> float:
    """0 if the box ever touches a lane of the route while its light is red, else 1."""
    on_route = scene.is_red & scene.route
    boxes = shapely.polygons(plan.corners)
    for lane in np.flatnonzero(on_route.any(axis=0)).tolist():
        outline = shapely.Polygon(scene.roads.polygons[lane])
        if (shapely.intersects(boxes, outline) & on_route[:, lane]).any():
            return 0.0
    return 1.0


def progress(plan: EgoDrive, centreline: Float64) -> float:
    """Way along the centreline [m], at least 0."""
    ends = shapely.points(plan.position[[0, -1]])
    first, last = shapely.line_locate_point(shapely.LineString(centreline), ends) if len(centreline) > 1 else (0.0, 0.0)
    return max(float(last - first), 0.0)


def time_to_collision(plan: EgoDrive, others: SurroundingBoxes, areas: PlanAreas) -> float:
    """0 if the box, moved on by up to 0.9 s at constant velocity, touches an object that counts, else 1.

    Objects ahead count; those beside count, too, while the vehicle is between lanes, off the road or in an
    intersection. Others that are touched are forgotten, and so is a plan while it stands.
    """
    velocity = plan.speed[:, None] * np.column_stack((np.cos(plan.heading), np.sin(plan.heading)))
    count, forgotten = len(plan.time), set()
    sees_beside = areas.is_between_lanes | areas.is_off_road | areas.rear_is_crossing
    moved = {ahead: plan.corners + 0.1 * ahead * velocity[:, None] for ahead in LOOK_AHEAD}
    touching = {}
    for ahead in LOOK_AHEAD:
        later = np.minimum(np.arange(count) + ahead, count - 1)
        present = others.present[later] & (np.arange(count) + ahead < count)[:, None]
        states = others.position[later], others.heading[later], others.speed[later]
        touching[ahead] = _touching(moved[ahead], SurroundingBoxes(*states, others.size, others.object_type, present))
    for step in range(count - LOOK_AHEAD[-1]):
        if plan.speed[step] < _STANDING:
            continue
        limit = BEHIND if sees_beside[step] else AHEAD
        for ahead in LOOK_AHEAD:
            for track in np.flatnonzero(touching[ahead][step]).tolist():
                if track in forgotten:
                    continue
                if _along(plan, step, others.position[step + ahead, track]) > limit:
                    return 0.0
                forgotten.add(track)
    return 1.0


def lane_keeping(plan: EgoDrive, centreline: Float64, areas: PlanAreas) -> float:
    """0 if the centre is more than 0.5 m from the centreline for 2 s, leaving out intersections, else 1."""
    if len(centreline) < 2:
        return 1.0
    away = shapely.distance(shapely.points(plan.position), shapely.LineString(centreline))
    longest = math.ceil(MAX_OFFSET_TIME / plan.dt - 1e-6)
    steps = 0
    for offset in away[~areas.is_crossing].tolist():
        steps = steps + 1 if offset > MAX_OFFSET else 0
        if steps >= longest:
            return 0.0
    return 1.0


def _along(plan: EgoDrive, step: int, position: Float64) -> float:
    """Cosine of the angle at the rear axle between the heading and a position."""
    x, y = map(float, position - plan.rear_axle[step])
    cos, sin = math.cos(plan.heading[step]), math.sin(plan.heading[step])
    return (cos * x + sin * y) / max(math.hypot(x, y), 1e-9)


def _outline(others: SurroundingBoxes, step: int, track: int) -> shapely.Polygon:
    return shapely.Polygon(box_outline(others.position[step, track], others.heading[step, track], *others.size[track]))


def _touching(corners: Float64, others: SurroundingBoxes) -> Bool:
    """Objects (T, N) that the boxes of the same moments touch."""
    touching = np.zeros(others.present.shape, np.bool_)
    centre = corners.mean(axis=1)
    reach = np.hypot(*(corners[:, 0] - centre).T)[:, None] + 0.5 * np.hypot(*others.size.T)
    near = others.present & (np.linalg.norm(others.position - centre[:, None], axis=-1) <= reach)
    for step, track in np.argwhere(near).tolist():
        touching[step, track] = shapely.Polygon(corners[step]).intersects(_outline(others, step, track))
    return touching
