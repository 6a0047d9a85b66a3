"""``scenarionet runs bridge`` with a stack, with none, and interrupted."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from scenarionet_data import Lake
from tests.fixtures.lakes import write_lake
from tests.fixtures.waiting import HANGS_AFTER
from tests.ros.test_ros2 import SCENARIOS, stack

pytestmark = pytest.mark.ros


@pytest.fixture
def lake(tmp_path: Path) -> Path:
    write_lake(tmp_path / "lake", SCENARIOS)
    return tmp_path / "lake"


def start(*words: object) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "scenarionet_pipelines.cli", "runs", "bridge", *map(str, words)]
    return subprocess.Popen(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def test_one_scenario_in_real_time(lake: Path) -> None:
    scenario = SCENARIOS[0].id
    with stack("dds"):
        running = start("ros2", lake, scenario, "--realtime", "--name", "real", "--json")
        out, err = running.communicate(timeout=HANGS_AFTER)
    assert running.returncode == 0, err
    assert (json.loads(out)["run"], json.loads(out)["scenarios"]) == ("real", 1)
    ends = Lake(lake).sql("SELECT scenario_id, success FROM results WHERE run = 'real'").rows()
    assert ends == [(scenario, True)]


def test_ctrl_c_while_no_stack_answers_ends_at_once_and_leaves_nothing(lake: Path) -> None:
    running = start("ros2", lake, "--wire", "zenoh", "--name", "none")
    process = psutil.Process(running.pid)
    while not any(each.laddr.port == 7447 for each in process.net_connections()):
        time.sleep(0.05)
    children = process.children(recursive=True)
    running.send_signal(signal.SIGINT)
    _, err = running.communicate(timeout=HANGS_AFTER)
    assert running.returncode == 130, err
    assert "Traceback" not in err
    assert psutil.wait_procs(children, timeout=5.0)[1] == []


def test_an_unknown_stack_or_topic_is_a_sentence(lake: Path) -> None:
    for words in (("ros3", lake), ("ros2", lake, "--with", "smell")):
        running = start(*words)
        _, err = running.communicate(timeout=HANGS_AFTER)
        assert running.returncode == 2
        assert "choose from" in err and "Traceback" not in err
