"""A real rosmaster, and a process with Debian's rospy and messages alone, which drives a recorded scene to success.

Needs packages of Debian, which ROS1 may name the root of: python3-rospy, python3-rosmaster, python3-nav-msgs and
python3-geometry-msgs.
"""

from __future__ import annotations

import os
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from scenarionet_data import Lake, convert
from scenarionet_data.errors import SourceError
from scenarionet_data.interchange.ros.messages import messages
from scenarionet_sim.bridges import stacks
from scenarionet_sim.bridges.ros_topics import ANSWERS, topics
from scenarionet_sim.bridges.rospy_wire import DEBIAN
from scenarionet_sim.evaluation.evaluation import evaluate
from tests.fixtures.drives import make_drive
from tests.fixtures.lakes import write_lake
from tests.fixtures.waiting import HANGS_AFTER

pytestmark = [pytest.mark.ros, pytest.mark.filterwarnings("ignore")]  # rospy's threads call what is deprecated

HERE = Path(__file__).parent
ROOTS = [f"{root}{DEBIAN}" for root in ("", os.environ.get("ROS1", "")) if Path(f"{root}{DEBIAN}").is_dir()]
PACKAGES = "rospy", "rosmaster", "nav_msgs"
DRIVES = [make_drive(f"d{k}", speed=8.0 + k) for k in range(2)]


@pytest.fixture(scope="module", autouse=True)
def installed() -> None:
    lacking = [name for name in PACKAGES if not any(Path(root, name).is_dir() for root in ROOTS)]
    if lacking:
        pytest.skip(f"ROS 1 is not tested: apt-get install {' '.join(f'python3-{name}' for name in lacking)}")


@pytest.fixture(scope="module")
def master(installed: None) -> Iterator[None]:
    """A master on a free port."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_MASTER_URI", f"http://127.0.0.1:{port}")
        patch.setenv("ROS_IP", "127.0.0.1")
        process = start("-c", f"import rosmaster; rosmaster.rosmaster_main(['rosmaster', '--core', '-p', '{port}'])")
        end = time.monotonic() + HANGS_AFTER
        while not is_open(port):
            assert process.poll() is None and time.monotonic() < end
            time.sleep(0.1)
        yield
        stacks.link(stacks.Stack.parse("ros1:tcp")).transport.close()  # while there is a master to tell
        process.kill()
        process.wait()


def is_open(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def start(*words: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen(["/usr/bin/python3", *words], env=os.environ | {"PYTHONPATH": os.pathsep.join(ROOTS)})


def test_a_rospy_process_drives_to_success(master: None, tmp_path: Path) -> None:
    write_lake(tmp_path / "lake", DRIVES)
    check(tmp_path / "lake", {drive.id for drive in DRIVES})


def test_a_rospy_process_drives_recorded_scene_0061_to_success(master: None, recordings: Path, tmp_path: Path) -> None:
    convert("scenarionet", recordings / "scenarionet" / "nuscenes_0", tmp_path / "lake")
    check(tmp_path / "lake", {"scenarionet/v1/nuscenes_scene-0061"})


def check(lake: Path, ids: set[str]) -> None:
    stack = start(str(HERE / "stack_rospy.py"))
    try:
        report = evaluate(lake, tuple(sorted(ids)), policy="ros1:tcp", name="rospy")
    finally:
        stack.kill()
        stack.wait()
    assert not report.broken
    driven = Lake(lake).sql("SELECT scenario_id FROM results WHERE run = 'rospy' AND success")["scenario_id"].to_list()
    assert set(driven) == ids


@pytest.mark.parametrize("kind", [*topics(1, ()).values(), *(topic.kind for topic in ANSWERS.values())])
def test_sums_of_types_are_those_of_debians_messages(kind: str) -> None:
    """Those that are installed."""
    package, _, name = kind.split("/")
    if not any(Path(root, package).is_dir() for root in ROOTS):
        pytest.skip(f"python3-{package.replace('_', '-')} is not installed")
    code = f"from {package}.msg import {name}; print({name}._md5sum)"
    done = subprocess.run(
        ["/usr/bin/python3", "-c", code],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(ROOTS)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert messages(1).store.generate_msgdef(kind, ros_version=1)[1] == done.stdout.strip()


def test_without_a_master_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_MASTER_URI", "http://127.0.0.1:1")
    with pytest.raises(SourceError, match="start `rosmaster --core`"):
        stacks.TRANSPORTS["ros1:tcp"](())
