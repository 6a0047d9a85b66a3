"""Workers on machines that one reaches by ssh: a real server, on this machine."""

from __future__ import annotations

import pytest

from pipelines.cluster import profile as profiles
from scenarionet_data import Lake
from tests.fixtures.made import write_raw
from tests.pipelines.cluster.conftest import Processes, until
from tests.pipelines.cluster.test_faults import assert_equals_undisturbed, report_of, start

pytestmark = pytest.mark.long


def test_convert_by_ssh(processes: Processes, tmp_path):
    _, log = processes.start("tests.fixtures.ssh_server")
    until(lambda: "ready" in log.read_text(), "ssh server")
    _, port, kind, key = log.read_text().split()
    hosts = tmp_path / "known_hosts"
    hosts.write_text(f"[127.0.0.1]:{port} {kind} {key}\n")
    text = (profiles.FOLDER / "ssh.toml").read_text("utf-8")
    mine = (
        text.replace("n_workers = 4", "n_workers = 1").replace(":8797", "127.0.0.1:0").replace("localhost", "127.0.0.1")
    )
    told = f'port = {port}\nusername = "me"\nknown_hosts = "{hosts}"\n'
    profile = tmp_path / "mine.toml"
    profile.write_text(mine.replace("[options.connect_options]\n", f"[options.connect_options]\n{told}"))
    raw, lake = write_raw(tmp_path / "raw", {f"s{k}": [k] for k in range(4)}), tmp_path / "lake"
    report = report_of(*start(processes, raw, lake, "--cluster", profile))
    assert (report["converted"], report["failed"]) == (4, [])
    assert len(report["workers"]) == 1
    assert len(Lake(lake)) == 4
    assert_equals_undisturbed(lake, raw)


def test_a_machine_that_does_not_answer(processes: Processes, tmp_path):
    profile = tmp_path / "mine.toml"
    profile.write_text(
        'kind = "ssh"\n[options]\nhosts = ["127.0.0.1", "127.0.0.1"]\n[options.connect_options]\nport = 1\n'
    )
    raw = write_raw(tmp_path / "raw", {"a": [1]})
    command, log = start(processes, raw, tmp_path / "lake", "--cluster", profile)
    assert command.wait(60) == 1
    (line,) = log.read_text().splitlines()
    assert line.startswith("error: the cluster of kind ssh does not start: ")
    assert line.endswith("; see its profile")
