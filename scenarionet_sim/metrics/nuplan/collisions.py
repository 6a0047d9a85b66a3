"""Collisions of the ego, their kind and whether it is at fault: nuPlan's ``no_ego_at_fault_collisions``.

Source: nuplan-devkit, ``planning/metrics/evaluation_metrics/common/no_ego_at_fault_collisions.py`` (definitions). An
object collides once. The ego is at fault when it hits an object that stands, when its front bumper hits a moving one,
and when it touches one sideways while not within one lane.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Bool
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.metrics.drive import EgoDrive, SurroundingBoxes
from scenarionet_sim.metrics.overlap import MARGIN, keep_overlaps

STOPPED = 0.05
"""Speed up to which a vehicle stands [m/s]."""

AHEAD, BEHIND = math.cos(math.radians(30.0)), math.cos(math.radians(150.0))
"""Cosine of the angle at the rear axle between the heading and an object that is ahead, or behind."""


class CollisionKind(StrEnum):
    """Kinds of collisions, in the order in which they are decided."""

    STOPPED_EGO = "stopped_ego"
    STOPPED_TRACK = "stopped_track"
    ACTIVE_REAR = "active_rear"
    ACTIVE_FRONT = "active_front"
    ACTIVE_LATERAL = "active_lateral"


class CollisionGroup(StrEnum):
    """Groups of objects with a limit of their own."""

    ROAD_USER = "vulnerable_road_user"
    VEHICLE = "vehicle"
    OBJECT = "object"


_ALLOWED = {CollisionGroup.ROAD_USER: 0, CollisionGroup.VEHICLE: 0, CollisionGroup.OBJECT: 1}
_GROUPS = {
    ObjectType.PEDESTRIAN: CollisionGroup.ROAD_USER,
    ObjectType.CYCLIST: CollisionGroup.ROAD_USER,
    ObjectType.VEHICLE: CollisionGroup.VEHICLE,
}


@dataclass(frozen=True)
class EgoCollision:
    """The first contact with an object.

    Attributes:
        step: Moment of the drive.
        track: Row of the object.
        kind: How they touch.
        group: What it is.
        is_at_fault: Whether the ego is at fault.
        energy: Change of the ego's velocity if both masses are equal [m/s].
    """

    step: int
    track: int
    kind: CollisionKind
    group: CollisionGroup
    is_at_fault: bool
    energy: float


def find_collisions(ego: EgoDrive, others: SurroundingBoxes, is_in_lane: Bool) -> list[EgoCollision]:
    """Find all collisions, in order of time.

    Args:
        ego: The drive.
        others: The objects around it.
        is_in_lane: (T,) whether the box is within one lane, or within lanes that follow one another.
    """
    found: list[EgoCollision] = []
    collided = np.zeros(len(others.size), np.bool_)
    may_touch = others.present.copy()
    box_size = np.array([ego.length, ego.width]) + MARGIN
    keep_overlaps(ego.position, ego.heading, box_size, others.position, others.heading, others.size + MARGIN, may_touch)
    for step, track in np.argwhere(may_touch).tolist():
        if collided[track]:
            continue
        box = box_outline(ego.position[step], ego.heading[step], ego.length, ego.width)
        outline = shapely.Polygon(
            box_outline(others.position[step, track], others.heading[step, track], *others.size[track])
        )
        if not shapely.Polygon(box).intersects(outline):
            continue
        collided[track] = True
        away = others.position[step, track] - ego.rear_axle[step]
        along = away @ [math.cos(ego.heading[step]), math.sin(ego.heading[step])] / max(math.hypot(*away), 1e-9)
        if ego.speed[step] <= STOPPED:
            kind = CollisionKind.STOPPED_EGO
        elif others.speed[step, track] <= STOPPED:
            kind = CollisionKind.STOPPED_TRACK
        elif along < BEHIND:
            kind = CollisionKind.ACTIVE_REAR
        else:
            touches_front = shapely.LineString(box[[0, 3]]).intersects(outline)
            kind = CollisionKind.ACTIVE_FRONT if touches_front else CollisionKind.ACTIVE_LATERAL
        is_at_fault = kind in (CollisionKind.ACTIVE_FRONT, CollisionKind.STOPPED_TRACK) or (
            kind is CollisionKind.ACTIVE_LATERAL and not is_in_lane[step]
        )
        group = _GROUPS.get(ObjectType(others.object_type[track]), CollisionGroup.OBJECT)
        own, other = ego.speed[step], others.speed[step, track]
        turn = ego.heading[step] - others.heading[step, track]
        energy = 0.5 * math.sqrt(max(own**2 + other**2 - 2.0 * own * other * math.cos(turn), 0.0))
        found.append(EgoCollision(step, track, kind, group, is_at_fault, energy))
    return found


def collision_score(collisions: Iterable[EgoCollision]) -> float:
    """NuPlan's score: 1 without a collision at fault, 0.5 with one static object, else 0."""
    score = 1.0
    at_fault = [each.group for each in collisions if each.is_at_fault]
    for group, allowed in _ALLOWED.items():
        score *= max(0.0, 1.0 - at_fault.count(group) / (allowed + 1))
    return score


def box_outline(position: np.ndarray, heading: float, length: float, width: float) -> np.ndarray:
    """(4, 2) corners: front left, rear left, rear right, front right."""
    cos, sin = math.cos(heading), math.sin(heading)
    corners = 0.5 * np.array([[length, width], [-length, width], [-length, -width], [length, -width]])
    turned: np.ndarray = position + corners @ np.array([[cos, sin], [-sin, cos]])
    return turned
