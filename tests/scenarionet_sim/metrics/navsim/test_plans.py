"""Every rule of NAVSIM's scores on hand-computed plans of 4 s on a straight road."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from scenarionet_sim.metrics.drive import EgoDrive, SurroundingBoxes
from scenarionet_sim.metrics.navsim import (
    PlanParts,
    PlanScene,
    epdms,
    filter_by_human,
    follow_up_weights,
    is_history_comfortable,
    is_plan_comfortable,
    is_two_frame_comfortable,
    measure_plan,
    normalised_progress,
    pdms,
    score_plans,
    two_stage_score,
)
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive

STEPS = 41
TIME = 0.1 * np.arange(STEPS)


def plan(x: np.ndarray, y: np.ndarray | float = 0.0, heading: float = 0.0) -> EgoDrive:
    """A plan of a box of 4.6 m x 1.9 m, with speed and acceleration of its positions."""
    position = np.column_stack((x, np.broadcast_to(y, STEPS))).astype(float)
    velocity = np.gradient(position, 0.1, axis=0)
    speed = np.hypot(*velocity.T)
    acceleration = np.column_stack((np.gradient(speed, 0.1), np.zeros(STEPS)))
    return EgoDrive(TIME, position, np.full(STEPS, heading), speed, acceleration, 4.6, 1.9, 1.4)


def steady(speed: float = 5.0, y: np.ndarray | float = 0.0) -> EgoDrive:
    return plan(speed * TIME, y)


def one(x: float, y: float = 0.0, vx: float = 0.0, kind: ObjectType = ObjectType.VEHICLE) -> SurroundingBoxes:
    position = np.column_stack((x + vx * TIME, np.full(STEPS, y)))[:, None]
    full = np.ones((STEPS, 1))
    speed, size = abs(vx) * full, np.array([[4.0, 1.8]])
    return SurroundingBoxes(position, 0 * full, speed, size, np.array([kind], np.uint8), full.astype(bool))


NOTHING = one(200.0)


@pytest.fixture(scope="module")
def scene() -> PlanScene:
    """Two lanes at y = 0 and 3.5 from x = -50 on; the right one is the route."""
    world = World.from_scenario(make_drive(speed=10.0))
    return PlanScene.of(world, NOTHING, 0, EgoDrive.recorded(world, 0, 0, 40))


def parts(driven: EgoDrive, scene: PlanScene, others: SurroundingBoxes = NOTHING) -> dict[str, float]:
    return measure_plan(driven, replace(scene, others=others))


def test_route_is_what_the_recording_drives(scene):
    assert scene.route.tolist() == [name.startswith("right") for name in scene.roads.lane_ids]
    assert scene.centreline[[0, -1]].tolist() == [[-50.0, 0.0], [270.0, 0.0]]


def test_plan_without_fault(scene):
    found = parts(steady(), scene)
    assert found.pop("progress") == pytest.approx(20.0)
    assert set(found.values()) == {1.0}


@pytest.mark.parametrize(
    ("other", "score"),
    [
        (one(10.0), 0.0),
        (one(10.0, kind=ObjectType.TRAFFIC_CONE), 0.5),
        (one(10.0, kind=ObjectType.PEDESTRIAN), 0.0),
        (one(-6.0, vx=9.0), 1.0),  # it comes from behind
        (one(0.0, 1.8, vx=5.0), 1.0),  # it drives beside the plan, which is in its lane
        (one(10.0, 3.5), 1.0),
    ],
)
def test_collisions_at_fault(scene, other, score):
    assert parts(steady(), scene, other)["no_at_fault_collisions"] == score


def test_touching_sideways_is_at_fault_between_lanes(scene):
    between = steady(y=1.75)
    assert parts(between, scene, one(0.0, 3.5, vx=5.0))["no_at_fault_collisions"] == 0.0
    assert parts(steady(0.0, 1.75), scene, one(0.0, 3.5))["no_at_fault_collisions"] == 1.0, "a standing plan"


def test_drivable_area_has_no_tolerance(scene):
    """The road reaches from y = -1.75 to 5.25, the box from -0.95 to 0.95."""
    assert parts(steady(y=-0.79), scene)["drivable_area_compliance"] == 1.0
    assert parts(steady(y=-0.81), scene)["drivable_area_compliance"] == 0.0


@pytest.mark.parametrize(("speed", "score"), [(1.8, 1.0), (2.2, 0.5), (5.3, 0.5), (5.5, 0.0)])
def test_driving_direction_counts_eleven_moments_off_the_route(scene, speed, score):
    """A window of 1 s has eleven steps: 1.8 m/s are 1.98 m, 2.2 m/s 2.42 m, 5.3 m/s 5.83 m, 5.5 m/s 6.05 m."""
    assert parts(steady(speed, 3.5), scene)["driving_direction_compliance"] == score
    assert parts(steady(speed), scene)["driving_direction_compliance"] == 1.0


def test_intersections_are_no_wrong_way_and_need_no_lane_keeping(scene):
    polygon_type = scene.roads.polygon_type.copy()
    polygon_type[scene.roads.num_lanes - 2 :] = MapFeatureType.INTERSECTION  # the left lanes, as an area
    crossing = replace(scene, roads=replace(scene.roads, polygon_type=polygon_type))
    assert parts(steady(9.0, 3.5), scene)["driving_direction_compliance"] == 0.0
    assert parts(steady(9.0, 3.5), scene)["lane_keeping"] == 0.0
    found = parts(steady(9.0, 3.5), crossing)
    assert (found["driving_direction_compliance"], found["lane_keeping"]) == (1.0, 1.0)


def test_red_lane_of_the_route_must_not_be_touched(scene):
    """The second lane begins at x = 20; the front of the box reaches it after (20 - 2.3) / 5 = 3.54 s."""
    lane = scene.roads.lane_ids.tolist().index("right_b")
    red = np.zeros((STEPS, scene.roads.num_lanes), bool)
    red[:, lane] = True
    assert parts(steady(), replace(scene, is_red=red))["traffic_light_compliance"] == 0.0
    assert parts(steady(4.0), replace(scene, is_red=red))["traffic_light_compliance"] == 1.0, "it stops at 18.3 m"
    red[36:] = False
    assert parts(steady(), replace(scene, is_red=red))["traffic_light_compliance"] == 1.0, "green in time"
    off = replace(scene, is_red=np.ones_like(red), route=np.zeros_like(scene.route))
    assert parts(steady(), off)["traffic_light_compliance"] == 1.0, "not on the route"


def test_progress_is_along_the_centreline_and_not_negative(scene):
    assert parts(plan(5.0 * TIME, 0.1 * TIME), scene)["progress"] == pytest.approx(20.0)
    assert parts(plan(-5.0 * TIME), scene)["progress"] == 0.0


@pytest.mark.parametrize(("gap", "score"), [(4.4, 0.0), (4.6, 1.0)])
def test_time_to_collision_looks_ahead_by_nine_tenths_of_a_second(scene, gap, score):
    """At 5 m/s behind a car of 5 m/s that is replaced by a standing one, 0.9 s are 4.5 m."""
    driven = steady()
    ahead = one(gap + 4.3, vx=5.0)
    stopping = replace(driven, speed=np.full(STEPS, 10.0))
    assert parts(driven, scene, ahead)["time_to_collision_within_bound"] == 1.0
    assert parts(stopping, scene, ahead)["time_to_collision_within_bound"] == score, "it closes in at 5 m/s"
    assert parts(replace(driven, speed=np.zeros(STEPS)), scene, one(4.0))["time_to_collision_within_bound"] == 1.0


def test_a_standing_plan_has_no_time_to_collision(scene):
    assert parts(steady(0.0), scene, one(4.0))["time_to_collision_within_bound"] == 1.0
    assert parts(steady(0.1), scene, one(4.0))["time_to_collision_within_bound"] == 0.0


def test_recorded_boxes_around_a_plan():
    world = World.from_scenario(make_drive(others=(Other(20.0, vx=5.0), Other(9.0, first=30))))
    boxes = SurroundingBoxes.recorded(world, 0, 20, 5)
    assert boxes.position.shape == (6, 1, 2) and boxes.size.tolist() == pytest.approx(np.array([[4.6, 1.9]]))
    assert boxes.position[:, 0, 0].tolist() == pytest.approx([30.0, 30.5, 31.0, 31.5, 32.0, 32.5])


def test_time_to_collision_beside_counts_between_lanes_only(scene):
    beside = one(0.0, 1.8, vx=5.0)
    assert parts(steady(), scene, beside)["time_to_collision_within_bound"] == 1.0
    assert parts(steady(y=1.75), scene, one(0.0, 3.5, vx=5.0))["time_to_collision_within_bound"] == 0.0


@pytest.mark.parametrize(("steps", "score"), [(19, 1.0), (20, 0.0)])
def test_lane_keeping_fails_after_two_seconds_beside_the_centreline(scene, steps, score):
    offset = np.zeros(STEPS)
    offset[5 : 5 + steps] = 0.51
    assert parts(steady(y=offset), scene)["lane_keeping"] == score
    assert parts(steady(y=0.49), scene)["lane_keeping"] == 1.0


def test_comfort_of_a_plan_and_after_its_history():
    assert is_plan_comfortable(steady())
    hard = plan(np.where(TIME < 2.0, 5.0 * TIME, 10.0 + 5.0 * (TIME - 2.0) + 2.0 * (TIME - 2.0) ** 2))
    assert not is_plan_comfortable(hard), "4 m/s²"
    assert is_history_comfortable(steady(), steady())
    braking = replace(steady(), acceleration=np.tile([-4.5, 0.0], (STEPS, 1)))
    assert not is_history_comfortable(braking, steady()), "the jerk between both"


@pytest.mark.parametrize(("difference", "is_comfortable"), [(0.69, True), (0.71, False)])
def test_two_frames_may_differ_by_their_bounds(difference, is_comfortable):
    """A constant difference of accelerations is its root mean square."""
    other = replace(steady(), acceleration=np.tile([difference, 0.0], (STEPS, 1)))
    assert is_two_frame_comfortable(steady(), other, 0.5) is is_comfortable
    turning = replace(steady(), heading=0.15 * TIME)
    assert not is_two_frame_comfortable(steady(), turning, 0.5), "0.15 rad/s"


def test_two_frames_are_compared_where_they_overlap():
    """The plan of the frame before speeds up in its first 0.5 s only, which the new plan does not have."""
    acceleration = np.zeros((STEPS, 2))
    acceleration[:5, 0] = 9.0
    assert is_two_frame_comfortable(steady(), replace(steady(), acceleration=acceleration), 0.5)
    assert not is_two_frame_comfortable(steady(), replace(steady(), acceleration=acceleration[::-1]), 0.5)


GOOD = PlanParts(1, 1, 1, 1, 0.8, 1, 1, 1, 1, 1)


def test_scores_are_weighted_means_times_multipliers():
    assert pdms(GOOD) == pytest.approx((5 * 0.8 + 5 + 2) / 12)
    assert pdms(replace(GOOD, no_at_fault_collisions=0.5, comfort=0)) == pytest.approx(0.5 * 9 / 12)
    assert pdms(replace(GOOD, drivable_area_compliance=0)) == 0.0
    assert pdms(replace(GOOD, driving_direction_compliance=0, lane_keeping=0)) == pdms(GOOD), "not in PDMS"
    assert epdms(GOOD) == pytest.approx((5 * 0.8 + 5 + 2 + 2 + 2) / 16)
    assert epdms(replace(GOOD, lane_keeping=0, extended_comfort=0)) == pytest.approx(11 / 16)
    assert epdms(replace(GOOD, extended_comfort=None)) == pytest.approx(13 / 14)
    assert epdms(replace(GOOD, driving_direction_compliance=0.5)) == pytest.approx(0.5 * 15 / 16)
    assert epdms(replace(GOOD, traffic_light_compliance=0)) == 0.0


def test_parts_in_which_the_human_fails_are_forgiven():
    human = replace(GOOD, driving_direction_compliance=0, lane_keeping=0.0, no_at_fault_collisions=0.5)
    failing = replace(GOOD, driving_direction_compliance=0, lane_keeping=0, no_at_fault_collisions=0.5)
    kept = filter_by_human(failing, human)
    assert (kept.driving_direction_compliance, kept.lane_keeping, kept.no_at_fault_collisions) == (1.0, 1.0, 0.5)
    assert epdms(failing, human) == pytest.approx(0.5 * epdms(GOOD))
    assert epdms(failing) == 0.0
    never = dict.fromkeys(("history_comfort", "extended_comfort", "ego_progress"), 0.0)
    shaken = replace(GOOD, comfort=0.0, **never)
    assert filter_by_human(shaken, shaken) == replace(GOOD, comfort=1.0, **never), "the owner never forgives these"


def test_progress_is_relative_to_the_best_plan_without_violations():
    assert normalised_progress(np.array([10.0, 20.0, 40.0]), np.array([1, 1, 0])).tolist() == [0.5, 1.0, 1.0]
    assert normalised_progress(np.array([1.0, 4.9]), np.ones(2)).tolist() == [1.0, 1.0], "at most 5 m"


def test_plans_compete(scene):
    slow, fast, crashing = score_plans([steady(4.0), steady(8.0), steady(12.0)], replace(scene, others=one(48.0)))
    assert (slow.ego_progress, fast.ego_progress) == (pytest.approx(0.5), 1.0)
    assert crashing.no_at_fault_collisions == 0.0 == epdms(crashing)
    assert pdms(fast) == 1.0 and pdms(slow) == pytest.approx(9.5 / 12)


def test_two_stages():
    weights = follow_up_weights(np.zeros(2), np.array([[0.0, 0.0], [np.sqrt(0.2 * np.log(3.0)), 0.0]]))
    assert weights == pytest.approx([0.75, 0.25]), "exp(-ln 3) is a third"
    assert two_stage_score(0.8, np.array([1.0, 0.0]), weights) == pytest.approx(0.6)
    assert follow_up_weights(np.zeros(2), np.full((4, 2), 50.0)).tolist() == [0.25] * 4, "all are far"
