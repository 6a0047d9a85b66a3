"""Every relation of sql/relations on hand-made tracks: the exact steps, and the composition of moments."""

from __future__ import annotations

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter, UnknownRelation
from scenarionet_data.operations.moments import event, relation
from scenarionet_data.query.named_sql import RELATIONS
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType
from tests.fixtures.lakes import write_lake
from tests.fixtures.moments import along, crosswalk, going, lane, moment, shifting, walking

# Boxes: cars 4 m by 2 m, pedestrians 0.5 m by 0.5 m, the box around the ego included; 101 steps of 0.1 s.
STANDING = along(0, 0)
PASSING = moment("passing", STANDING, who=walking(-10, 5, 2))
PULLING_UP = moment("pulling-up", STANDING, car=going(0, 30, lambda t: 2 * np.clip(t, 0, 5)))
BENDING = moment("bending", STANDING, car=going(0, 30, 10, 0.2))
ONCOMING = moment("oncoming", along(0, 0, 10), car=along(100, 3.5, -10), who=walking(50, 20, 0, -2))
SHORT = moment("short", STANDING, car=along(20, 0, -5, seen=slice(10, 31)), gone=along(30, 9, -5, seen=slice(4, 5)))

# A road along x: two lanes beside each other, the right one in two pieces with an intersection (from x = 89.5) after
# them, a lane that leads back, and a bicycle lane. Outlines are 1.75 m beside the centrelines, 0.75 m for bicycles.
ROAD = [
    lane("first", (-20, 0), (50, 0), exit_lanes=["second"], left_neighbors=["left"], right_neighbors=["bicycles"]),
    lane("second", (50, 0), (89.5, 0), entry_lanes=["first"], exit_lanes=["across"], left_neighbors=["left"]),
    lane("across", (89.5, 0), (140, 0), entry_lanes=["second"], is_intersection=True),
    lane("left", (-20, 3.5), (140, 3.5), left_neighbors=["back"], right_neighbors=["first", "second"]),
    lane("back", (140, 7), (-20, 7), left_neighbors=["left"]),
    ("bicycles", MapFeatureType.LANE_BIKE_LANE, {"polyline": [(-20, -3), (30, -3)], "left_neighbors": ["first"]}),
    crosswalk("crossing", 60, -4, 63, 10),
    ("yard", MapFeatureType.DRIVABLE_AREA, {"polygon": [(-10, -9), (30.5, -9), (30.5, -5), (30.5, 9), (-10, 9)]}),
    ("sign", MapFeatureType.STOP_SIGN, {"polyline": [(88, -3)], "controlled_lanes": ["second"]}),
]
DRIVING = moment(
    "driving",
    along(0, 0, 10),
    ROAD,
    lead=along(15, 0, 10),
    oncoming=along(110, 7, -10),
    cyclist=along(0, -3, 2, kind=ObjectType.CYCLIST),
)
CHANGING = moment("changing", along(300, 300), ROAD, car=shifting(20, 0, 10, 3.6, 2, 3))
CROSSING = moment("crossing", STANDING, who=walking(8, -5.05, 0, 1))
SIGNED = moment(
    "signed",
    along(0, 0, 5),
    ROAD,
    post=along(48.2, -3, heading=np.pi, kind=ObjectType.OTHER, source_type="STOP_SIGN"),
)

# The other comes the wrong way, on a lane whose first 20 m a bicycle lane covers as well.
MEETING = moment(
    "meeting", along(0, 0, 5),
    [lane("road", (-20, 0), (100, 0)), ("path", MapFeatureType.LANE_BIKE_LANE, {"polyline": [(-20, 0), (0.2, 0)]})],
    wrong=along(22, 0, -1),
)  # fmt: skip

# Relation, parameters, scenario, and for each object and other the first and last step of the only span at which it
# holds.
CASES = [
    ("has_velocity", {}, PASSING, {("who", None): (0, 100)}),
    ("has_velocity", {"min_velocity": 3.0}, PASSING, {}),
    ("has_velocity", {}, SHORT, {("car", None): (10, 30)}),
    ("has_velocity", {"min_velocity": 5.05}, PULLING_UP, {("car", None): (26, 100)}),  # 2 t
    # x = t^2, so the velocity at step 0 is 0.1 instead of 0, and the accelerations are 1, 1.5, 2, 2 ...; at the end,
    # with x = 24.01, 25, 26, 27, the velocities are 9.8, 9.95, 10 and the accelerations 2, 1.75, 1, 0.25, 0.
    # Medians of seven with the first repeated: 1, 1.5, 2 ... 2, 1.75.
    ("accelerating", {"min_accel": 1.9}, PULLING_UP, {("car", None): (2, 48)}),
    ("accelerating", {"min_accel": -0.1, "max_accel": 0.1}, PASSING, {("who", None): (0, 100)}),
    # 10 m/s on 50 m, with the same ends
    ("has_lateral_acceleration", {"min_accel": 1.9, "max_accel": 2.1}, BENDING, {("car", None): (2, 98)}),
    ("has_lateral_acceleration", {"min_accel": 0.1}, PULLING_UP, {}),
    ("stationary", {}, PASSING, {("ego", None): (0, 100)}),
    ("is_category", {"category": "pedestrian"}, PASSING, {("who", None): (0, 100)}),
    # 3.75 m from side to side; beyond the bumper sqrt(3.75^2 + d^2) = 5 for d = 3.307, from x = -5.557 to 5.557
    (
        "near_objects",
        {"distance_thresh": 5.0},
        PASSING,
        {("ego", "who"): (23, 77), ("who", "ego"): (23, 77)},
    ),
    ("near_objects", {"distance_thresh": 5.0, "min_objects": 2}, PASSING, {}),
    # beside the box while its centre is between x = -2.1 and 2.1
    ("has_objects_in_relative_direction", {"direction": "left", "lateral_thresh": 0.1}, PASSING, {
        ("ego", "who"): (40, 60),
    }),
    ("has_objects_in_relative_direction", {"direction": "right"}, PASSING, {("who", "ego"): (0, 100)}),
    ("has_objects_in_relative_direction", {"direction": "left", "min_number": 2}, PASSING, {}),
    ("has_objects_in_relative_direction", {"direction": "forward", "within_distance": 20.0}, SHORT, {
        ("ego", "car"): (10, 30), ("car", "ego"): (10, 30),
    }),
    ("has_objects_in_relative_direction", {"direction": "backward"}, SHORT, {}),
    # atan2(5, x) <= 45 degrees from x = 5, at step 75; the ego is never ahead of the walker within 45 degrees after -5
    (
        "facing_toward",
        {"within_angle": 45.1},
        PASSING,
        {("ego", "who"): (75, 100), ("who", "ego"): (0, 25)},
    ),
    ("heading_toward", {"angle_threshold": 45.1}, PASSING, {("who", "ego"): (0, 25)}),
    ("heading_in_relative_direction_to", {"direction": "opposite"}, ONCOMING, {
        ("ego", "car"): (0, 100), ("car", "ego"): (0, 100),
    }),
    ("heading_in_relative_direction_to", {"direction": "perpendicular"}, ONCOMING, {
        ("ego", "who"): (0, 100), ("who", "ego"): (0, 100), ("car", "who"): (0, 100), ("who", "car"): (0, 100),
    }),
    ("heading_in_relative_direction_to", {"direction": "same"}, ONCOMING, {}),
    ("turning", {"direction": "left"}, BENDING, {("car", None): (0, 100)}),  # 0.2 rad/s for 10 s
    ("turning", {"direction": "right"}, BENDING, {}),
    ("turning", {}, CHANGING, {}),
    # from y = -5.05 at 1 m/s across the line at the ego's right side, y = -1
    ("being_crossed_by", {}, CROSSING, {("ego", "who"): (0, 100)}),
    ("being_crossed_by", {"lateral_thresh": 2.0}, CROSSING, {("ego", "who"): (0, 70)}),
    ("being_crossed_by", {"in_direction": "counterclockwise"}, CROSSING, {("ego", "who"): (0, 100)}),
    ("being_crossed_by", {"in_direction": "clockwise"}, CROSSING, {}),
    ("being_crossed_by", {"forward_thresh": 5.0}, CROSSING, {}),  # it is 6 m from the box
    ("being_crossed_by", {"direction": "left"}, PASSING, {("ego", "who"): (0, 74)}),
    ("on_road", {}, SIGNED, {("ego", None): (0, 100)}),
    ("on_lane_type", {"lane_type": "BIKE"}, DRIVING, {("cyclist", None): (0, 100)}),
    ("on_lane_type", {"lane_type": "BUS"}, DRIVING, {}),
    ("on_intersection", {}, DRIVING, {("ego", None): (90, 100), ("lead", None): (75, 100)}),
    ("near_intersection", {}, DRIVING, {("ego", None): (85, 100), ("lead", None): (70, 100)}),
    ("in_drivable_area", {}, DRIVING, {
        ("ego", None): (0, 30), ("lead", None): (0, 15), ("oncoming", None): (80, 100), ("cyclist", None): (0, 100),
    }),
    # boxes reach 2 m ahead and behind, so from x = 56.95 to 66.05
    ("at_pedestrian_crossing", {"within_distance": 1.05}, DRIVING, {
        ("ego", None): (57, 66), ("lead", None): (42, 51), ("oncoming", None): (44, 53),
    }),
    ("following", {}, DRIVING, {("ego", "lead"): (0, 100)}),
    ("following", {}, MEETING, {}),  # in front of it, but in the opposite direction
    ("on_lane_type", {}, MEETING, {("ego", None): (0, 100), ("wrong", None): (0, 100)}),  # most of its steps
    ("on_lane_type", {"lane_type": "BIKE"}, MEETING, {}),
    ("in_same_lane", {}, DRIVING, {("ego", "lead"): (0, 100), ("lead", "ego"): (0, 100)}),
    ("on_relative_side_of_road", {"side": "opposite"}, DRIVING, {
        ("ego", "oncoming"): (0, 100), ("lead", "oncoming"): (0, 100), ("cyclist", "oncoming"): (0, 100),
        # the lane across the intersection is beside no other
        ("oncoming", "ego"): (0, 89), ("oncoming", "lead"): (0, 74), ("oncoming", "cyclist"): (0, 100),
    }),
    ("on_relative_side_of_road", {}, CHANGING, {}),
    # it moves to the left from 2 s to 5 s
    ("changing_lanes", {}, CHANGING, {("car", None): (20, 50)}),
    ("changing_lanes", {"direction": "right"}, CHANGING, {}),
    # the sign of the map at (88, -3), on lane "second": 10 m from x = 78.46
    ("at_stop_sign", {}, DRIVING, {("ego", None): (79, 89), ("lead", None): (64, 74)}),
    ("at_stop_sign", {}, SIGNED, {("ego", None): (77, 98)}),  # between x = 38.2 and 49.2, the sign at 48.2 looks at it
]  # fmt: skip


@pytest.fixture(scope="module")
def lake(tmp_path_factory) -> Lake:
    scenarios = [PASSING, PULLING_UP, BENDING, ONCOMING, SHORT, DRIVING, CHANGING, CROSSING, SIGNED, MEETING]
    return write_lake(tmp_path_factory.mktemp("relations"), scenarios)


def spans(lake, scenario, found) -> dict:
    rows = lake.moments(found).filter(scenario_id=scenario.id).to_dicts()
    return {(row["track_id"], row.get("other_id")): (row["first_timestep"], row["last_timestep"]) for row in rows}


@pytest.mark.parametrize(("name", "parameters", "scenario", "expected"), CASES)
def test_relation(lake, name, parameters, scenario, expected):
    assert spans(lake, scenario, relation(name, parameters)) == expected


def test_every_relation_has_a_case():
    assert {case[0] for case in CASES} == set(RELATIONS.names())


def test_types_of_the_source_are_columns(lake):
    for view in ("objects", "states"):
        assert lake.sql(f"SELECT DISTINCT source_type FROM {view} ORDER BY 1").rows() == [("STOP_SIGN",), (None,)]


def test_steps_compose(lake):
    near, pedestrian = (
        relation("near_objects", {"distance_thresh": 5.0}),
        relation("is_category", {"category": "PEDESTRIAN"}),
    )
    assert spans(lake, PASSING, near & pedestrian) == {("who", "ego"): (23, 77)}
    assert spans(lake, PASSING, near & pedestrian.reversed()) == {("ego", "who"): (23, 77)}
    assert spans(lake, PASSING, near & ~pedestrian) == {("ego", "who"): (23, 77)}
    assert spans(lake, PASSING, ~pedestrian & near) == {("ego", "who"): (23, 77)}
    assert spans(lake, PASSING, ~pedestrian) == {("ego", None): (0, 100)}
    assert spans(lake, PASSING, ~~pedestrian) == {("who", None): (0, 100)}
    assert spans(lake, PASSING, near.at_least(1)) == {("ego", None): (23, 77), ("who", None): (23, 77)}
    assert spans(lake, PASSING, near.at_least(2)) == {}
    assert spans(lake, PASSING, near | near.reversed()) == spans(lake, PASSING, near)
    both = lake.moments(~near & pedestrian).filter(scenario_id=PASSING.id)
    assert both.select("first_timestep", "last_timestep").rows() == [(0, 22), (78, 100)]
    with pytest.raises(BadParameter, match="same roles on both sides, found track and other and track"):
        near | pedestrian
    with pytest.raises(BadParameter, match="of a relation of two"):
        pedestrian.at_least(1)


def test_spans_relate(lake):
    """The walker is within 5 m of the ego from 2.3 s to 7.7 s, and beside it from 4.0 s to 6.0 s."""
    near = relation("near_objects", {"distance_thresh": 5.0}).lasting()
    beside = relation("has_objects_in_relative_direction", {"direction": "left", "lateral_thresh": 0.1}).lasting()
    walker_near = relation("is_category", {"category": "PEDESTRIAN"}).lasting()
    ahead = relation("facing_toward", {"within_angle": 45.1}).lasting()  # from 7.5 s
    assert spans(lake, PASSING, near.lasting(5.3)) == {("ego", "who"): (23, 77), ("who", "ego"): (23, 77)}
    assert spans(lake, PASSING, near.lasting(5.5)) == {}
    assert spans(lake, PASSING, beside.during(near)) == {("ego", "who"): (40, 60)}
    assert spans(lake, PASSING, near.during(beside)) == {}
    assert spans(lake, PASSING, beside.before(ahead, within=1.6)) == {("ego", "who"): (40, 100)}
    assert spans(lake, PASSING, ahead.after(beside, within=1.6)) == {("ego", "who"): (40, 100)}
    assert spans(lake, PASSING, beside.before(ahead, within=1.4)) == {}
    assert spans(lake, PASSING, near.overlaps(ahead)) == {("ego", "who"): (75, 77), ("who", "ego"): (23, 25)}
    assert spans(lake, PASSING, near.during(walker_near)) == {("who", "ego"): (23, 77)}
    (row,) = lake.moments(beside.during(near)).filter(scenario_id=PASSING.id).to_dicts()
    assert (row["begins"], row["ends"]) == pytest.approx((4.0, 6.0))


def test_events_are_moments(lake):
    """The closest approach of the walker is at 5.0 s, while it is beside the ego."""
    beside = relation("has_objects_in_relative_direction", {"direction": "right"}).lasting()
    assert spans(lake, PASSING, event("closest_approach", {"max": 6.0}).during(beside)) == {("who", "ego"): (50, 50)}


def test_refusals_name_the_remedy(lake):
    with pytest.raises(UnknownRelation, match="did you mean near_objects"):
        relation("near_object")
    with pytest.raises(BadParameter, match="has no parameter 'thresh'; it has distance_thresh, min_objects"):
        relation("near_objects", {"thresh": 3})
    with pytest.raises(BadParameter, match="number of seconds from 0 on, found -1"):
        relation("stationary").lasting(-1)
    with pytest.raises(Exception, match="wanted forward, backward, left or right, found up"):
        lake.moments(relation("has_objects_in_relative_direction", {"direction": "up"}))
