"""Processes that know nothing of us drive over DDS and zenoh, with the results of the same policy in this one."""

from __future__ import annotations

import math
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import SourceError
from scenarionet_data.interchange.ros.messages import messages
from scenarionet_sim.bridges import dds_wire, stacks
from scenarionet_sim.bridges.commands import Steer, drive
from scenarionet_sim.bridges.link import Link
from scenarionet_sim.bridges.ros_topics import ANSWERS
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.planners.base import Action, Planner, Trajectory
from scenarionet_sim.planners.view import View
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake
from tests.ros.pursuit import Pursuit

pytestmark = pytest.mark.ros

HERE = Path(__file__).parent
SCENARIOS = [make_drive(f"d{k}", speed=8.0 + k, others=(Other(25.0, 3.5, vx=4.0),)) for k in range(2)]


class PursuitHere(Planner):
    """The stacks' driver in this process."""

    def __init__(self) -> None:
        self.driver, self.route = Pursuit(), None

    def act(self, view: View) -> Action | Trajectory:
        ego = view.ego
        if self.route is None:
            self.route = view.route.centreline.tolist()
        heading = 2.0 * math.atan2(math.sin(ego.heading / 2.0), math.cos(ego.heading / 2.0))
        steering, speed = map(float, np.float32(self.driver.command(ego.x, ego.y, heading, ego.speed, self.route)))
        return drive(Steer(steering, speed), view)


@contextmanager
def stack(wire: str, fault: str = "") -> Iterator[subprocess.Popen[bytes]]:
    """A stack that runs."""
    kind = ANSWERS["ackermann_cmd"].kind
    words = [sys.executable, str(HERE / f"stack_{wire}.py"), fault]
    if wire == "zenoh":
        words.append(
            f"0/ackermann_cmd/ackermann_msgs::msg::dds_::AckermannDriveStamped_/{messages(2).store.hash_rihs01(kind)}"
        )
    environment = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}
    process = subprocess.Popen(words, env=environment | {"CYCLONEDDS_URI": dds_wire.LOOPBACK})
    try:
        yield process
    finally:
        process.kill()
        process.wait()


def link_of(wire: str) -> Link:
    """The link of this process."""
    return stacks.link(stacks.Stack.parse(f"ros2:{wire}"))


@pytest.fixture(scope="module")
def lake(tmp_path_factory: pytest.TempPathFactory) -> Lake:
    root = tmp_path_factory.mktemp("ros")
    write_lake(root / "lake", SCENARIOS)
    return Lake(root / "lake")


def columns(lake: Lake, run: str) -> list[tuple[object, ...]]:
    query = "SELECT scenario_id, {} FROM {} WHERE run = '{}' ORDER BY scenario_id"
    driven = Lake(lake.root).sql(query.format("* EXCLUDE (run, scenario_id)", "rollouts", run)).rows()
    assert len(driven) == 2 * len(SCENARIOS)  # the ego and the other vehicle
    return driven


@pytest.mark.parametrize("wire", ["dds", "zenoh"])
def test_a_stack_drives_to_success_bit_for_bit_as_the_same_policy_here(lake: Lake, wire: str) -> None:
    here = f"{__name__}:PursuitHere"
    with stack(wire):
        report = evaluate(lake, policy=f"ros2:{wire}", name=wire)
    assert not report.broken
    evaluate(lake, policy=here, name=f"{wire}-here")
    assert columns(lake, wire) == columns(lake, f"{wire}-here")
    ends = Lake(lake.root).sql(f"SELECT success FROM results WHERE run = '{wire}'")["success"].to_list()
    assert ends == [True] * len(SCENARIOS)


def test_pictures_and_scans_of_every_moment_reach_a_stack(lake: Lake) -> None:
    """It answers only moments of which it has both."""
    link_of("zenoh").transport.close()  # it has the port
    stacks.link.cache_clear()
    policy = "ros2:zenoh+camera+lidar"
    with stack("zenoh", "sensors"):
        assert not evaluate(lake, policy=policy, name="sensors").broken
    stacks.link(stacks.Stack.parse(policy)).transport.close()
    stacks.link.cache_clear()
    ends = Lake(lake.root).sql("SELECT success FROM results WHERE run = 'sensors'")["success"].to_list()
    assert ends == [True] * len(SCENARIOS)


@pytest.mark.parametrize(
    ("wire", "fault", "reason"),
    [
        ("dds", "silent", "is it running?"),
        ("dds", "domain", "is it running?"),
        ("dds", "dies", "did not answer"),
        ("dds", "old", "messages had other stamps"),
        ("dds", "nan", "expected finite numbers"),
        ("zenoh", "hash", "is it running?"),
        ("zenoh", "half", "are no ackermann_msgs/msg/AckermannDriveStamped"),
    ],
)
def test_a_fault_is_a_sentence_and_the_run_goes_on(
    lake: Lake, monkeypatch: pytest.MonkeyPatch, wire: str, fault: str, reason: str
) -> None:
    link = link_of(wire)
    monkeypatch.setattr(link, "limit", 1.5 if "running" in reason else 6.0)
    monkeypatch.setattr(link, "stamp", 0)
    monkeypatch.setattr(link, "_unanswered", None)
    with stack(wire, fault):
        report = evaluate(lake, policy=f"ros2:{wire}", name=f"fault-{fault}")
    assert len(report.broken) == len(SCENARIOS)
    assert all(reason in error for _, error in report.broken), report.broken


def test_a_flood_of_old_answers_hides_no_new_one(lake: Lake) -> None:
    with stack("dds", "flood"):
        assert not evaluate(lake, policy="ros2:dds", name="flood").broken


def test_a_taken_port_is_a_sentence() -> None:
    link_of("zenoh")
    with pytest.raises(SourceError, match="end the router that runs there"):
        stacks.TRANSPORTS["ros2:zenoh"](())
