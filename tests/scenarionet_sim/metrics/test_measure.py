"""All metrics on drives with known results."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.schema import tables
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.drivers.by_name import resolve_drivers
from scenarionet_sim.metrics import results
from scenarionet_sim.metrics.drive import DrivenEpisode
from scenarionet_sim.metrics.measure import measure, measure_all, metrics
from scenarionet_sim.rollouts.batch import RolloutBatch, RolloutJob
from scenarionet_sim.rollouts.rollout import Rollout
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive


def drive(scenario: ScenarioDescription, policy: str = "replay") -> tuple[Rollout, World]:
    world = World.from_scenario(scenario)
    ((_, rollout),) = RolloutBatch(resolve_drivers(policy), Kinematic()).run([RolloutJob(0, world)])
    assert isinstance(rollout, Rollout)
    return rollout, world


def measured(scenario: ScenarioDescription, policy: str = "replay") -> dict:
    return measure(*drive(scenario, policy))


def test_row_matches_the_schema():
    row = measured(make_drive(others=(Other(20.0, vx=5.0),), red=True))
    columns = {column.name for column in tables.load("results").columns}
    assert set(row) == columns - {"run", "scenario_id", "track_id", "error", "rollout", "is_reactive"}


def test_empty_straight_road():
    row = measured(make_drive(speed=10.0, num_steps=41))
    assert row["status"] == "success" and row["success"] and not row["out_of_road"] and not row["timeout"]
    assert row["steps"] == 40, "to the end of the recording"
    assert row["outcome_time"] == pytest.approx(3.9), "39 m of 40 m are more than 95 %"
    assert row["route_completion"] == pytest.approx(1.0)
    assert row["progress_ratio"] == 1.0
    assert row["nuplan_score"] == 1.0
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
    assert row["min_time_to_collision"] == 0.0 and not row["is_time_to_collision_in_bound"]
    assert (row["active_front_collisions"], row["at_fault_collisions"], row["nuplan_score"]) == (1, 1, 0.0)
    assert row["overlap_steps"] > 1


def test_hit_from_behind_is_not_at_fault():
    row = measured(make_drive(speed=5.0, others=(Other(-15.0, vx=10.0),)))
    assert (row["cost"], row["active_rear_collisions"], row["at_fault_collisions"]) == (1, 1, 0)
    assert row["no_ego_at_fault_collisions"] == row["nuplan_score"] == 1.0
    assert row["min_time_to_collision"] == 0.0 and row["is_time_to_collision_in_bound"]


def test_gap_in_the_ego_leaves_motion_unknown():
    row = measured(make_drive(hidden=slice(10, 20)))
    assert row["success"] and row["average_displacement"] == 0.0
    assert row.get("nuplan_score") is None and row.get("is_comfortable") is None


def test_speeding_and_missing_parts():
    scenario = make_drive(speed=10.0)
    scenario.map.speed_limit[:] = 9.0
    row = measured(scenario)
    assert row["max_overspeed"] == pytest.approx(1.0)
    assert row["speed_limit_compliance"] == pytest.approx(1.0 - 41 * 0.1 / (2.23 * 4.0), abs=1e-5)
    assert row["nuplan_score"] == pytest.approx((12.0 + 4.0 * row["speed_limit_compliance"]) / 16.0)


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
    row = measure(replace(rollout, position=rollout.position[::-1]), world)
    assert row["wrong_way_distance"] == pytest.approx(10.0, abs=1.1) and row["nuplan_score"] == 0.0
    beside = measure(replace(rollout, position=rollout.position - np.array([0.0, 9.0])), world)
    assert beside["off_road_time"] == pytest.approx(4.1)
    assert beside["average_displacement"] == pytest.approx(9.0)
    assert beside["offroad_steps"] == 41 and beside["off_route_offset"] == beside["wrong_way_offset"] > 8.9


def test_scenario_without_a_map():
    row = measured(make_drive(has_map=False))
    assert row["success"]
    names = "off_road_time", "wrong_way_distance", "nuplan_score", "no_ego_at_fault_collisions", "offroad_steps"
    assert [row[name] for name in (*names, "off_route_offset")] == [None] * 6
    assert row["progression"] == row["progress_ratio"] == 1.0


def test_stationary_ego():
    row = measured(make_drive(speed=0.0))
    assert row["success"] and row["route_completion"] == 1.0 and row["outcome_time"] == pytest.approx(0.1)
    assert row["is_comfortable"] and row["nuplan_score"] == 1.0


def test_recording_of_a_single_moment():
    row = measured(make_drive(num_steps=3, hidden=slice(1, 3)))
    assert row["success"] and row["average_displacement"] == 0.0
    assert row.get("nuplan_score") is None


def test_a_driver_that_arrives_early_waits_and_is_scored_to_the_end_of_its_episode():
    """IDM drives at 5 m/s or more where the recording takes 10 s for 30 m."""
    rollout, world = drive(make_drive(speed=3.0, num_steps=101), "idm")
    scored = rollout.scored()
    assert scored.num_steps == rollout.num_scored == 100 and scored.present[:, scored.agent].all()
    assert np.hypot(*scored.velocity[-20:, scored.agent].T).max() == 0.0
    assert measure(rollout, world)["mean_speed"] == pytest.approx(3.0, abs=0.05)


def test_episodes_measured_together_have_the_rows_of_each_alone():
    """On one map, and one on another: of several lengths, with a collision, speeding, a gap, and off the lanes."""
    scenarios = [
        make_drive(speed=8.0, num_steps=41),
        make_drive(others=(Other(20.0, vx=5.0), Other(-40.0, vx=3.0))),
        make_drive(speed=12.0, num_steps=41, others=(Other(-90.0, vx=9.0), Other(40.0, vx=6.0))),
        make_drive(speed=22.0, num_steps=31, others=(Other(90.0, vx=21.0),)),
        make_drive(hidden=slice(10, 20)),
        make_drive(speed=5.0, others=(Other(-15.0, vx=10.0),), red=True),
        make_drive(speed=10.0, num_steps=12),
    ]
    beside = replace(scenarios[0], tracks=replace(scenarios[0].tracks, position=scenarios[0].tracks.position + 3.0))
    on_one_map = [replace(scenario, map=scenarios[0].map) for scenario in (*scenarios, beside)]
    driven = [DrivenEpisode(*drive(scenario)) for scenario in (*on_one_map, scenarios[1])]
    assert len({id(episode.world.roads) for episode in driven}) == 2
    alone = [measure(episode.rollout, episode.world) for episode in driven]
    assert measure_all(driven) == alone
    assert len({repr(row) for row in alone}) == len(driven) - 1, "all differ on one map"


def test_a_metric_is_one_file(tmp_path, monkeypatch):
    text = "def measure(episode):\n    return {'moments': len(episode.scored.position), 'ratio': float('nan')}\n"
    (tmp_path / "moments.py").write_text(text)
    monkeypatch.setattr(results, "__path__", [*results.__path__, str(tmp_path)])
    metrics.cache_clear()
    row = measured(make_drive(num_steps=11))
    metrics.cache_clear()
    assert row["moments"] == 11 and row["ratio"] is None and row["success"]


def test_metrics_have_an_owner_and_scores_a_direction():
    table = tables.load("results")
    keys = {"run", "scenario_id", "track_id", "error", "rollout", "steps"}
    assert {each.name for each in (*table.columns, *table.derived) if not each.owner} == keys
    neutral = {"status", "lane_changes", "outcome_time", "mean_speed", "is_reactive"}
    assert {each.name for each in (*table.columns, *table.derived) if each.owner and not each.better} == neutral
    assert {each.better for each in table.columns} == {"", "higher", "lower"}


def test_the_road_is_unknown_where_the_recording_itself_is_off_it():
    scenario = make_drive()
    scenario.tracks.position[..., 1] += 9.0
    rollout, world = drive(scenario)
    for position in (rollout.position, rollout.position - np.array([0.0, 9.0])):
        row = measure(replace(rollout, position=position), world)
        assert row["off_road_time"] is None and row["nuplan_score"] is None
        assert row["is_comfortable"] is not None
