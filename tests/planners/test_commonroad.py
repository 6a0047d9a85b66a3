"""The scene as CommonRoad's objects, and planners of the package index that drive in it."""

from __future__ import annotations

import base64
import hashlib
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest
from commonroad.scenario.obstacle import ObstacleType
from commonroad_dc import pycrcc

from scenarionet_data import Lake
from scenarionet_data.storage import evaluation_runs
from scenarionet_sim.bridges.commonroad.planners import braking
from scenarionet_sim.bridges.commonroad.scene import CommonRoadScene
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.planners.view import View
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

pytestmark = pytest.mark.planners

POLICIES = ("commonroad:reactive", "commonroad:frenetix")


def seen(**options: object) -> View:
    """The first moment of a drive."""
    world = World.from_scenario(make_drive("seen", **options))  # type: ignore[arg-type]
    return View(world, Simulation([world], (Replay(),)).state, 0, world.ego)


def hits(scene: CommonRoadScene, x: float, y: float, step: int = 0) -> bool:
    """Whether the ego's box at a place collides at a timestep."""
    found: bool = scene.checker.time_slice(step).collide(pycrcc.RectOBB(2.3, 0.95, 0.0, x, y))
    return found


def test_lanes_are_lanelets_with_their_outlines_and_successors():
    scene = CommonRoadScene(seen(), 30)
    lanelets = scene.scenario.lanelet_network.lanelets
    lengths = [each.distance[-1] for each in lanelets]
    for lanelet, length in zip(lanelets, lengths, strict=True):
        assert lanelet.polygon.shapely_object.area == pytest.approx(3.5 * length, rel=1e-3)
        np.testing.assert_allclose(lanelet.left_vertices[:, 1] - lanelet.right_vertices[:, 1], 3.5, atol=1e-3)
        np.testing.assert_allclose(lanelet.center_vertices[:, 0], lanelet.left_vertices[:, 0], atol=1e-3)
    assert [each.successor for each in lanelets] == [[2], [], [4], []]
    assert [each.predecessor for each in lanelets] == [[], [1], [], [3]]


def test_obstacles_go_on_with_their_velocity_and_stop_where_a_light_is_red():
    view = seen(others=(Other(30.0, 3.5, vx=6.0), Other(20.0, 3.5), Other(500.0, 3.5)), red=True)
    scene = CommonRoadScene(view, 30)
    (moving,) = scene.scenario.dynamic_obstacles
    assert moving.obstacle_type == ObstacleType.CAR and moving.obstacle_shape.length == pytest.approx(4.6)
    np.testing.assert_allclose(moving.state_at_time(10).position, [36.0, 3.5], atol=1e-4)
    standing, light = sorted(scene.scenario.static_obstacles, key=lambda each: each.obstacle_id)
    np.testing.assert_allclose(standing.initial_state.position, [20.0, 3.5], atol=1e-4)
    np.testing.assert_allclose(light.initial_state.position, [20.25, 0.0], atol=1e-4)
    assert [hits(scene, x, 3.5, 20) for x in (30.0, 42.0, 20.0)] == [False, True, True]
    assert [hits(scene, x, 0.0) for x in (17.6, 17.8)] == [False, True]


def test_the_edge_of_the_road_is_where_lanes_and_route_end():
    scene = CommonRoadScene(seen(), 30)
    assert [hits(scene, 10.0, y) for y in (0.0, 3.5, 1.75, 4.5, -1.0)] == [False, False, False, True, True]
    assert CommonRoadScene(seen(has_map=False), 30).edge is None


def test_the_problem_is_the_vehicle_now_and_the_end_of_its_route():
    scene = CommonRoadScene(seen(), 30)
    start, goal = scene.problem.initial_state, scene.problem.goal.state_list[0]
    assert (*start.position, start.velocity, start.time_step) == pytest.approx((0.0, 0.0, 10.0, 0))
    np.testing.assert_allclose(goal.position.center, [40.0, 0.0], atol=1e-4)
    assert goal.time_step.start == goal.time_step.end == 40
    np.testing.assert_allclose(scene.reference[[0, 10]], [[-10.0, 0.0], [0.0, 0.0]], atol=1e-4)


def test_braking_is_at_six_metres_per_square_second():
    drive = braking(seen())
    np.testing.assert_allclose(drive.poses[[0, 10, -1], 0], [0.0, 10.0 - 3.0, 100.0 / 12.0], atol=1e-4)


@pytest.mark.parametrize("policy", POLICIES)
def test_they_drive_to_the_end_and_stop_behind_what_stands(tmp_path: Path, policy: str):
    drives = [
        make_drive("free", others=(Other(30.0, 3.5, vx=6.0),)),
        make_drive("blocked", num_steps=61, others=(Other(35.0), Other(35.0, 3.5))),
        make_drive("red", num_steps=61, red=True),
    ]
    write_lake(tmp_path / "lake", drives)
    evaluate(tmp_path / "lake", policy=policy, name="run")
    lake = Lake(tmp_path / "lake")
    rows = {row["scenario_id"].split("/")[-1]: row for row in lake.sql("SELECT * FROM results").to_dicts()}
    assert {name: row["error"] for name, row in rows.items()} == dict.fromkeys(("free", "blocked", "red"))
    assert rows["free"]["success"] and rows["free"]["cost"] == rows["red"]["red_light_violations"] == 0
    blocked = rows["blocked"]
    assert not blocked["success"] and (blocked["first_collision"] or 9.0) > 5.0  # 3 s at the speed that it begins with
    assert all(row["route_completion"] > 0.3 for row in rows.values())
    assert "commonroad-io 2024.3" in evaluation_runs.describe(lake.files, "run")["code"]


@pytest.mark.parametrize("package", ["commonroad-reactive-planner", "frenetix", "commonroad-drivability-checker"])
def test_their_files_are_those_of_the_package_index(package: str):
    files = [each for each in metadata.files(package) or () if each.hash]
    assert len(files) > 10
    for file in files:
        digest = hashlib.sha256(file.read_binary()).digest()
        assert base64.urlsafe_b64encode(digest).rstrip(b"=").decode() == file.hash.value, file
