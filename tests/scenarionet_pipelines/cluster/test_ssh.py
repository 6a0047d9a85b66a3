"""Workers reached by ssh: a real ssh server on this machine."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from scenarionet_data import Lake
from scenarionet_pipelines.cluster import profile as profiles
from tests.fixtures.made import write_raw
from tests.fixtures.waiting import HANGS_AFTER, until
from tests.scenarionet_pipelines.cluster.conftest import Processes
from tests.scenarionet_pipelines.cluster.test_faults import assert_equals_undisturbed, report_of, start

pytestmark = pytest.mark.long


@pytest.fixture
def profile(processes: Processes, tmp_path: Path) -> Path:
    """The bundled profile, for one worker on this machine, behind a running ssh server."""
    _, log = processes.start("tests.fixtures.ssh_server")
    until(lambda: "ready" in log.read_text(), "the ssh server is ready")
    _, port, kind, key = log.read_text().split()
    hosts, mine = tmp_path / "known_hosts", tmp_path / "mine.toml"
    hosts.write_text(f"[127.0.0.1]:{port} {kind} {key}\n")
    told = f'port = {port}\nusername = "me"\nknown_hosts = "{hosts}"\n'
    text = (profiles.FOLDER / "ssh.toml").read_text("utf-8")
    for old, new in (
        ("n_workers = 4", "n_workers = 1"),
        (":8797", "127.0.0.1:0"),
        ("localhost", "127.0.0.1"),
        ("[options.connect_options]\n", f"[options.connect_options]\n{told}"),
    ):
        text = text.replace(old, new)
    mine.write_text(text)
    return mine


def test_convert_by_ssh(processes: Processes, profile: Path, tmp_path):
    raw, lake = write_raw(tmp_path / "raw", {f"s{k}": [k] for k in range(4)}), tmp_path / "lake"
    report = report_of(*start(processes, raw, lake, "--cluster", profile))
    assert (report["converted"], report["failed"]) == (4, [])
    assert len(report["workers"]) == 1
    assert len(Lake(lake)) == 4
    assert_equals_undisturbed(lake, raw)


def test_machine_without_the_package(processes: Processes, profile: Path, tmp_path):
    pythons = f'remote_python = ["{sys.executable}", "/nowhere/python"]'
    profile.write_text(profile.read_text().replace("# remote_python", f"{pythons}\n# remote_python"))
    command, log = start(processes, write_raw(tmp_path / "raw", {"a": [1]}), tmp_path / "lake", "--cluster", profile)
    assert command.wait(HANGS_AFTER) == 1
    (line,) = log.read_text().splitlines()
    assert line == "error: the ssh cluster does not start: Worker failed to start; see its profile"


def test_unreachable_machine(processes: Processes, tmp_path):
    profile = tmp_path / "mine.toml"
    profile.write_text(
        'kind = "ssh"\n[options]\nhosts = ["127.0.0.1", "127.0.0.1"]\n[options.connect_options]\nport = 1\n'
    )
    raw = write_raw(tmp_path / "raw", {"a": [1]})
    command, log = start(processes, raw, tmp_path / "lake", "--cluster", profile)
    assert command.wait(HANGS_AFTER) == 1
    (line,) = log.read_text().splitlines()
    assert line.startswith("error: the ssh cluster does not start: ")
    assert line.endswith("; see its profile")
