"""Collisions of every kind, fault, energy and the time to collision, with hand-computed values."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_sim.metrics.nuplan import (
    CollisionGroup,
    CollisionKind,
    EgoCollision,
    EgoDrive,
    SurroundingBoxes,
    collision_score,
    find_collisions,
    time_to_collision,
)

LENGTH, WIDTH = 5.0, 2.0


def ego(speed: float, steps: int = 1) -> EgoDrive:
    """Along +x from the origin, a moment every 0.1 s."""
    time = 0.1 * np.arange(steps)
    position = np.column_stack((speed * time, np.zeros(steps)))
    constant = np.full(steps, float(speed))
    return EgoDrive(time, position, np.zeros(steps), constant, np.zeros((steps, 2)), LENGTH, WIDTH, 1.5)


def one(x: float, y: float, heading: float, speed: float, kind: ObjectType = ObjectType.VEHICLE, steps: int = 1):
    """One object of 4 m x 2 m that moves along its heading."""
    time = 0.1 * np.arange(steps)
    way = speed * time
    position = np.column_stack((x + way * math.cos(heading), y + way * math.sin(heading)))[:, None]
    full = np.full((steps, 1), 1.0)
    size, present = np.array([[4.0, 2.0]]), full.astype(bool)
    return SurroundingBoxes(position, heading * full, speed * full, size, np.array([kind], np.uint8), present)


@pytest.mark.parametrize(
    ("own", "other", "kind", "in_lane_fault", "between_fault"),
    [
        (0.0, (4.0, 0.0, 0.0, 3.0), CollisionKind.STOPPED_EGO, False, False),
        (5.0, (4.0, 0.0, 0.0, 0.0), CollisionKind.STOPPED_TRACK, True, True),
        (5.0, (-4.0, 0.0, 0.0, 9.0), CollisionKind.ACTIVE_REAR, False, False),
        (5.0, (4.0, 0.0, math.pi, 3.0), CollisionKind.ACTIVE_FRONT, True, True),
        (5.0, (0.0, 1.9, 0.0, 4.0), CollisionKind.ACTIVE_LATERAL, False, True),
    ],
)
def test_kinds(own: float, other: tuple[float, ...], kind: CollisionKind, in_lane_fault: bool, between_fault: bool):
    for is_in_lane, is_at_fault in ((True, in_lane_fault), (False, between_fault)):
        (found,) = find_collisions(ego(own), one(*other), np.array([is_in_lane]))
        assert (found.kind, found.is_at_fault) == (kind, is_at_fault)


def test_energy_is_half_the_change_of_velocity():
    (head_on,) = find_collisions(ego(5.0), one(4.0, 0.0, math.pi, 3.0), np.array([True]))
    assert head_on.energy == pytest.approx(4.0)
    (same_way,) = find_collisions(ego(5.0), one(0.0, 1.9, 0.0, 4.0), np.array([True]))
    assert same_way.energy == pytest.approx(0.5)


def test_an_object_collides_once_and_not_from_afar():
    found = find_collisions(ego(10.0, 20), one(10.0, 0.0, 0.0, 0.0, steps=20), np.ones(20, bool))
    assert [each.step for each in found] == [6], "the gap of 5.5 m closes at 1 m a moment"
    assert not find_collisions(ego(10.0, 5), one(10.0, 0.0, 0.0, 0.0, steps=5), np.ones(5, bool))


@pytest.mark.parametrize(
    ("groups", "score"),
    [
        ([], 1.0),
        ([CollisionGroup.OBJECT], 0.5),
        ([CollisionGroup.OBJECT] * 2, 0.0),
        ([CollisionGroup.VEHICLE], 0.0),
        ([CollisionGroup.ROAD_USER], 0.0),
    ],
)
def test_score(groups: list[CollisionGroup], score: float):
    kind = CollisionKind.ACTIVE_FRONT
    assert collision_score(EgoCollision(0, k, kind, group, True, 1.0) for k, group in enumerate(groups)) == score
    assert collision_score(EgoCollision(0, k, kind, group, False, 1.0) for k, group in enumerate(groups)) == 1.0


@pytest.mark.parametrize(
    ("kind", "group"), [(ObjectType.CYCLIST, "vulnerable_road_user"), (ObjectType.TRAFFIC_CONE, "object")]
)
def test_groups(kind: ObjectType, group: str):
    (found,) = find_collisions(ego(5.0), one(4.0, 0.0, 0.0, 0.0, kind), np.array([True]))
    assert found.group == group


def times(own: EgoDrive, others: SurroundingBoxes, *, in_lane: bool = True, crossing: bool = False) -> list[float]:
    lanes = np.full(len(own.time), in_lane)
    collisions = find_collisions(own, others, lanes)
    return time_to_collision(own, others, collisions, lanes, np.full(len(own.time), crossing)).tolist()


def test_time_to_a_standing_object_ahead():
    assert times(ego(10.0), one(10.0, 0.0, 0.0, 0.0)) == pytest.approx([0.6])
    assert times(ego(10.0), one(10.0, 0.0, 0.0, 9.0)) == [math.inf]
    assert times(ego(0.004), one(4.6, 0.0, math.pi, 9.0)) == [math.inf], "a standing vehicle has none"


def test_objects_beside_count_between_lanes_and_in_intersections():
    crossing = one(3.0, 6.0, -math.pi / 2, 5.0)
    assert times(ego(1.0), crossing) == [math.inf]
    assert times(ego(1.0), crossing, in_lane=False) == times(ego(1.0), crossing, crossing=True) != [math.inf]


def test_it_is_zero_in_a_collision_at_fault_and_forgets_the_object():
    found = times(ego(10.0, 12), one(10.0, 0.0, 0.0, 0.0, steps=12))
    assert found[5:] == [pytest.approx(0.1), 0.0, *[math.inf] * 5]
