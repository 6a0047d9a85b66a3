"""All metrics on drives with known results."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.schema import tables
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.evaluation.drivers import resolve_drivers
from scenarionet_sim.evaluation.environment_cache import EnvironmentCache
from scenarionet_sim.evaluation.rollout import Rollout, roll_out
from scenarionet_sim.metrics.measure import measure
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive


def drive(scenario: ScenarioDescription, policy: str = "replay") -> tuple[Rollout, World]:
    world, who = World.from_scenario(scenario), resolve_drivers(policy)
    with EnvironmentCache(who.policies, Kinematic()) as environments:
        return roll_out(environments.environment_for(world), world, who.driver, np.random.default_rng(0)), world


def measured(scenario: ScenarioDescription, policy: str = "replay") -> dict:
    return measure(*drive(scenario, policy))


def test_row_matches_the_schema():
    row = measured(make_drive(others=(Other(20.0, vx=5.0),), red=True))
    columns = {column.name for column in tables.load("results").columns}
    assert set(row) == columns - {"run", "scenario_id", "track_id", "error"}


def test_empty_straight_road():
    row = measured(make_drive(speed=10.0, num_steps=41))
    assert row["status"] == "success" and row["success"] and not row["out_of_road"] and not row["timeout"]
    assert row["steps"] == 39, "39 m of 40 m are more than 95 %"
    assert row["route_completion"] == pytest.approx(0.975)
    assert row["mean_speed"] == pytest.approx(10.0)
    assert row["average_displacement"] == row["final_displacement"] == 0.0
    assert row["cost"] == row["infeasible_steps"] == 0
    assert row["is_comfortable"] is True
    assert row["off_road_time"] == row["wrong_way_distance"] == 0.0
    assert row["min_time_to_collision"] is None and row["first_collision"] is None
    assert row["red_light_violations"] is None, "there is no light"


def test_slower_car_ahead():
    """15.4 m between the bumpers at 5 m/s: contact after 3.08 s."""
    row = measured(make_drive(others=(Other(20.0, vx=5.0),)))
    assert (row["collided_vehicles"], row["collided_humans"], row["collided_objects"], row["cost"]) == (1, 0, 0, 1)
    assert row["first_collision"] == pytest.approx(3.1)
    assert row["min_time_to_collision"] == pytest.approx(0.1)


def test_idm_keeps_behind_slower_car():
    row = measured(make_drive(others=(Other(20.0, vx=5.0),)), "idm")
    assert row["cost"] == 0
    assert row["mean_speed"] < 10.0 and row["average_displacement"] > 1.0


@pytest.mark.parametrize(
    ("kind", "column"),
    [(ObjectType.PEDESTRIAN, "collided_humans"), (ObjectType.TRAFFIC_CONE, "collided_objects")],
)
def test_collided_objects(kind, column):
    row = measured(make_drive(others=(Other(20.0, type=kind),)))
    assert row[column] == row["cost"] == 1


def test_red_light():
    assert measured(make_drive(red=True))["red_light_violations"] == 1
    assert measured(make_drive(red=True), "idm")["red_light_violations"] == 0


def test_wrong_way_and_off_road():
    """A rollout whose positions are modified."""
    rollout, world = drive(make_drive())
    assert measure(replace(rollout, position=rollout.position[::-1]), world)["wrong_way_distance"] == pytest.approx(
        10.0
    )
    beside = measure(replace(rollout, position=rollout.position - np.array([0.0, 9.0])), world)
    assert beside["off_road_time"] == pytest.approx(4.0)
    assert beside["average_displacement"] == pytest.approx(9.0)


def test_scenario_without_a_map():
    row = measured(make_drive(has_map=False))
    assert row["success"]
    assert row["off_road_time"] is None and row["wrong_way_distance"] is None


def test_stationary_ego():
    row = measured(make_drive(speed=0.0))
    assert row["success"] and row["route_completion"] == 1.0 and row["steps"] == 1
    assert row["is_comfortable"] is None and row["max_jerk"] is None
