"""A node on Autoware's topics and services that knows nothing of us drives, by maps of the Lanelet2 export alone."""

from __future__ import annotations

import os
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.lanelet2.writer import Lanelet2Writer
from scenarionet_data.interchange.ros import messages as messages_module
from scenarionet_data.interchange.ros.messages import messages
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_sim.bridges import dds_wire, stacks
from scenarionet_sim.bridges.autoware_topics import TOPICS, RearAxle, VehicleReports, moment_messages
from scenarionet_sim.bridges.autoware_transport import AutowareTransport
from scenarionet_sim.bridges.dds_wire import idl_type
from scenarionet_sim.bridges.link import Link, StackMoment
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.planners.view import View
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake
from tests.ros.autoware_definitions import definitions

pytestmark = pytest.mark.ros

HERE = Path(__file__).parent
POLICY = "autoware:dds"
ROS = messages(2)
STAMP = 12_345_678_901
AHEAD = Other(25.0, 3.5, vx=4.0)
RECORDED = (
    ("scenarionet", "scenarionet/waymo_0"),
    ("scenarionet", "scenarionet/overpass"),
    ("waymo", "waymo/training"),
    ("argoverse2", "argoverse2/motion-forecasting/val"),
    ("interaction", "interaction"),
)
DRIVEN = (
    "scenarionet/v1/waymo_2a1e44d405a6833f",
    "scenarionet/v1/waymo_8a346109094cd5aa",
    "scenarionet/v1/waymo_c403d5992cab9e0",
    "scenarionet/v1/waymo_eb4b91b10ca94ff2",
    "waymo/v1.2/637f20cafde22ff8",
    "argoverse2/v2/0a1e6f0a-1817-4a98-b02e-db8c9327d151",
    "interaction/v1.1/DR_USA_Intersection_MA-000@100",
    "interaction/v1.1/DR_USA_Roundabout_EP-000@100",
    "interaction/v1.1/DR_USA_Roundabout_EP-000@20100",
    "interaction/v1.1/DR_USA_Roundabout_EP-000@120100",
)


@contextmanager
def node(scenario: ScenarioDescription, folder: Path, fault: str = "") -> Iterator[None]:
    """A node with the map of a scenario."""
    (content,) = Lanelet2Writer().write(scenario, "map", Losses()).values()
    path = folder / "map.osm"
    path.write_bytes(content)
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    words = [sys.executable, str(HERE / "stack_autoware.py"), str(path), fault]
    process = subprocess.Popen(words, env=environment | {"CYCLONEDDS_URI": dds_wire.LOOPBACK})
    try:
        yield
    finally:
        process.kill()
        process.wait()


@pytest.fixture
def link(monkeypatch: pytest.MonkeyPatch) -> Link:
    link = stacks.link(stacks.Stack.parse(POLICY))
    monkeypatch.setattr(link, "limit", 4.0)
    monkeypatch.setattr(link, "_unanswered", None)
    return link


def result(lake: Path, run: str) -> dict[str, Any]:
    found = Lake(lake).sql(f"SELECT success, red_light_violations, mean_speed, error FROM results WHERE run = '{run}'")
    return {name: found[name].to_list()[0] for name in found.columns}


@pytest.mark.parametrize("red", [False, True])
def test_a_node_drives_to_the_goal_and_stops_at_a_red_light(tmp_path: Path, link: Link, red: bool) -> None:
    scenario = make_drive("lane", others=(AHEAD,), red=red, num_steps=61)
    write_lake(tmp_path / "lake", [scenario])
    with node(scenario, tmp_path):
        report = evaluate(tmp_path / "lake", policy=POLICY, name="node")
    assert not report.broken
    found = result(tmp_path / "lake", "node")
    assert found["success"] == (not red)
    assert not found["red_light_violations"]


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        ("silent", "did not answer the moment"),
        ("nan", "expected finite numbers"),
        ("unready", "change_to_autonomous was refused with code 1: no route"),
        ("disengaged", "control mode MANUAL"),
    ],
)
def test_a_fault_is_a_sentence(tmp_path: Path, link: Link, fault: str, reason: str) -> None:
    scenario = make_drive("lane")
    write_lake(tmp_path / "lake", [scenario])
    with node(scenario, tmp_path, fault):
        ((_, error),) = evaluate(tmp_path / "lake", policy=POLICY, name="fault").broken
    assert reason in error


def test_in_park_the_vehicle_brakes(tmp_path: Path, link: Link) -> None:
    scenario = make_drive("lane")
    write_lake(tmp_path / "lake", [scenario])
    with node(scenario, tmp_path, "parked"):
        assert not evaluate(tmp_path / "lake", policy=POLICY, name="parked").broken
    found = result(tmp_path / "lake", "parked")
    assert not found["success"]
    assert found["mean_speed"] < 3.0


def test_without_a_node_it_says_so(tmp_path: Path, link: Link, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "limit", 0.5)
    link.transport._states.clear()  # type: ignore[attr-defined] - those of the test before
    write_lake(tmp_path / "lake", [make_drive("lane")])
    ((_, error),) = evaluate(tmp_path / "lake", policy=POLICY, name="none").broken
    assert "/api/operation_mode/change_to_stop is not answered; is it running" in error


@pytest.mark.parametrize("is_ready", [False, True])
def test_a_flood_of_other_messages_ends_at_the_time_limit(
    tmp_path: Path, link: Link, monkeypatch: pytest.MonkeyPatch, is_ready: bool
) -> None:
    """Messages come faster than they are read, and none is a control command."""
    transport = link.transport
    assert isinstance(transport, AutowareTransport)
    gear = ROS.encode(ROS.make("autoware_vehicle_msgs/GearCommand", stamp=ROS.time(0), command=2))
    monkeypatch.setattr(link, "limit", 0.5)
    monkeypatch.setattr(transport._inbox, "take", lambda until: ("control/command/gear_cmd", gear))
    if is_ready:
        monkeypatch.setattr(transport, "begin", lambda moment, until: moment.stamp)
    transport._states.clear()  # those of the test before
    write_lake(tmp_path / "lake", [make_drive("lane")])
    started = time.monotonic()
    ((_, error),) = evaluate(tmp_path / "lake", policy=POLICY, name="flood").broken
    assert ("did not answer the moment" if is_ready else "does not get ready") in error
    assert time.monotonic() - started < 30.0


@pytest.fixture(scope="module")
def view() -> View:
    world = World.from_scenario(make_drive("seen", others=(Other(20.0, 0.5, vx=5.0),), red=True))
    return View(world, Simulation([world], (Replay(),)).state, 0, world.ego)


@pytest.fixture(scope="module")
def found(view: View) -> dict[str, Any]:
    return dict(moment_messages(ROS, StackMoment(view, STAMP, True), VehicleReports()))


@pytest.mark.parametrize("topic", TOPICS)
def test_bytes_are_those_of_cyclonedds(found: dict[str, Any], topic: str) -> None:
    content = ROS.encode(found[topic])
    assert found[topic].__msgtype__ == TOPICS[topic].kind
    kind = idl_type(TOPICS[topic].kind).__idl__
    assert bytes(kind.serialize(kind.deserialize(content), use_version_2=False)) == content


def test_base_link_is_under_the_rear_axle(view: View, found: dict[str, Any]) -> None:
    """0.3 of the length behind the centre of the box."""
    place = found["localization/kinematic_state"].pose.pose.position
    assert (place.x, place.y) == pytest.approx((-0.3 * view.ego.length, 0.0))
    assert found["tf"].transforms[0].transform.translation.x == place.x
    assert found["vehicle/status/velocity_status"].longitudinal_velocity == pytest.approx(10.0)


def test_the_rear_axle_of_a_turning_vehicle_has_no_lateral_speed(view: View) -> None:
    turning = View(view.world, view.state, 0, view.row)
    length = turning.ego.length
    turning.ego.yaw_rate, turning.ego.speed = 0.5, 5.0
    rear = RearAxle.of(turning)
    assert np.hypot(rear.speed, 0.5 * 0.3 * length) == pytest.approx(5.0)
    assert np.tan(rear.angle) == pytest.approx(0.6 * length * 0.5 / rear.speed)


def test_objects_have_their_velocity_and_path(found: dict[str, Any]) -> None:
    (each,) = found["perception/object_recognition/objects"].objects
    assert (each.classification[0].label, each.kinematics.initial_twist_with_covariance.twist.linear.x) == (1, 5.0)
    path = each.kinematics.predicted_paths[0]
    assert [point.position.x for point in path.path[:3]] == pytest.approx([20.0, 22.5, 25.0])
    assert path.time_step.nanosec == 500_000_000


def test_before_it_is_ready_the_scene_stands(view: View) -> None:
    still = dict(moment_messages(ROS, StackMoment(view, STAMP, True, is_ready=False), VehicleReports()))
    assert still["vehicle/status/velocity_status"].longitudinal_velocity == 0.0
    (each,) = still["perception/object_recognition/objects"].objects
    assert each.kinematics.initial_twist_with_covariance.twist.linear.x == 0.0


def test_a_light_has_the_number_of_its_rule_in_the_map(found: dict[str, Any]) -> None:
    (content,) = Lanelet2Writer().write(make_drive("seen", red=True), "map", Losses()).values()
    rules = [
        int(each.get("id", ""))
        for each in ElementTree.fromstring(content).iter("relation")
        if {"k": "subtype", "v": "traffic_light"} in [tag.attrib for tag in each.iter("tag")]
    ]
    groups = found["perception/traffic_light_recognition/traffic_signals"].traffic_light_groups
    assert [group.traffic_light_group_id for group in groups] == rules
    assert [group.elements[0].color for group in groups] == [1]


def test_definitions_are_those_of_the_checkouts() -> None:
    """Of autoware_msgs 1.12.0 and autoware_adapi_msgs 1.9.2, in AUTOWARE_CHECKOUTS with a colon between."""
    given = os.environ.get("AUTOWARE_CHECKOUTS")
    if not given:
        pytest.skip("AUTOWARE_CHECKOUTS is not set: definitions of messages are not compared with Autoware's")
    known = Path(messages_module.__file__).parent / "autoware.txt"
    assert known.read_text("utf-8") == definitions(*map(Path, given.split(":")))


def test_ten_recorded_scenarios_are_driven_to_success(recordings: Path, tmp_path: Path, link: Link) -> None:
    """Each by a node of its own with the map of the scenario, as Autoware is launched."""
    for dataset, folder in RECORDED:
        convert(dataset, recordings / folder, tmp_path / "lake")
    lake, ends = Lake(tmp_path / "lake"), {}
    link.limit = 60.0  # a node reads a map of 5 MB first
    for scenario in lake.loader(DRIVEN):
        name = scenario.id.replace("/", "-").replace("@", "-")
        with node(scenario, tmp_path):
            evaluate(lake.root, (scenario.id,), policy=POLICY, name=name)
        ends[scenario.id] = result(tmp_path / "lake", name)
    assert len(ends) == 10
    assert all(end["success"] for end in ends.values()), ends
