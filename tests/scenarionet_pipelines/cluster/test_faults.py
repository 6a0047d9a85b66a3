"""Faults on a cluster, with real schedulers, workers and clients: nothing is lost, nothing is duplicated."""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import subprocess
from pathlib import Path
from typing import Any

import psutil
import pytest

from scenarionet_data import Lake, convert
from tests.fixtures import gate
from tests.fixtures.lakes import content
from tests.fixtures.made import NAME, held_raw, write_raw
from tests.fixtures.waiting import HANGS_AFTER, until
from tests.scenarionet_pipelines.cluster.conftest import Dask, Processes

pytestmark = pytest.mark.long


def start(
    processes: Processes, raw: Path, lake: Path, *words: object, is_quiet: bool = True
) -> tuple[subprocess.Popen[bytes], Path]:
    options = ("--json", *(["--quiet"] if is_quiet else []), *map(str, words))
    return processes.start("scenarionet_pipelines.cli", "convert", NAME, str(raw), str(lake), *options)


def report_of(process: subprocess.Popen[bytes], log: Path, code: int = 0) -> dict[str, Any]:
    """The JSON report that a command prints at its end."""
    process.wait(HANGS_AFTER)
    assert process.returncode == code, log.read_text()
    report: dict[str, Any] = json.loads(log.read_text())
    return report


def finished(lake: Path) -> int:
    return len(list(lake.glob("metadata/**/*.parquet")))


def assert_equals_undisturbed(lake: Path, raw: Path) -> None:
    undisturbed = lake.with_name("undisturbed")
    convert(NAME, str(raw), undisturbed)
    assert content(lake) == content(undisturbed)


# --- workers ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("nanny", ["--nanny", "--no-nanny"])
def test_worker_killed_during_a_shard(dask: Dask, tmp_path, nanny):
    raw, lake = held_raw(tmp_path / "raw", shards=10), tmp_path / "lake"
    gate.close(raw, admitted=2)
    dask.start_worker(nanny)
    dask.start_worker(nanny)
    command = start(dask, raw, lake, "--cluster", dask.address)
    until(lambda: len(gate.waiting(raw)) == 2, "both workers are in the middle of a shard")
    psutil.Process(gate.waiting(raw)[0]).kill()
    gate.open_(raw)
    report = report_of(*command)
    assert (report["converted"], report["shards"], report["failed"]) == (30, 10, [])
    assert sum(share["jobs"] for share in report["workers"].values()) == 10
    assert_equals_undisturbed(lake, raw)


def test_shard_that_kills_its_workers_is_reported_and_the_others_continue(dask: Dask, tmp_path):
    raw, lake = write_raw(held_raw(tmp_path / "raw", shards=10), {"bad": ["99 deadly"]}), tmp_path / "lake"
    dask.start_worker("--nanny")
    dask.start_worker("--nanny")
    report = report_of(*start(dask, raw, lake, "--cluster", dask.address), code=1)
    (failed,) = report["failed"]
    assert failed["shard"] == "bad"
    assert re.match(r"2 workers were lost while running it, usually out of memory", failed["reason"])
    assert (report["converted"], report["shards"]) == (30, 10)
    (raw / "bad.made").unlink()
    assert_equals_undisturbed(lake, raw)


def test_worker_out_of_memory(dask: Dask, tmp_path):
    raw, lake = write_raw(held_raw(tmp_path / "raw", shards=4), {"large": ["99 hungry"]}), tmp_path / "lake"
    dask.start_worker("--nanny", "--memory-limit", "1200MB")
    report = report_of(*start(dask, raw, lake, "--cluster", dask.address), code=1)
    (failed,) = report["failed"]
    assert failed["shard"] == "large"
    assert "give workers more memory" in failed["reason"]
    assert report["converted"] == 12
    assert len(Lake(lake)) == 12


def test_worker_with_a_full_disk(dask: Dask, tmp_path):
    """A file-size limit stands in for a full disk where nothing can be mounted."""
    raw, lake = held_raw(tmp_path / "raw", shards=3), tmp_path / "lake"
    limited = dask.start_worker(
        "--no-nanny", preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
    )
    command, log = start(dask, raw, lake, "--cluster", dask.address)
    assert command.wait(HANGS_AFTER) == 1
    assert "File too large; free some space and run the same command again: finished shards are kept" in log.read_text()
    assert not list(lake.glob("snapshots/*.json"))
    limited.kill()
    dask.start_worker("--no-nanny")
    assert report_of(*start(dask, raw, lake, "--cluster", dask.address))["converted"] == 9
    assert_equals_undisturbed(lake, raw)


def test_corrupt_shard_among_fifty(dask: Dask, tmp_path):
    lines = {f"s{k:02d}": [k] for k in range(49)}
    raw, lake = write_raw(tmp_path / "raw", {**lines, "torn": ["99 corrupt"]}), tmp_path / "lake"
    dask.start_worker("--no-nanny")
    dask.start_worker("--no-nanny")
    report = report_of(*start(dask, raw, lake, "--cluster", dask.address), code=1)
    assert [failed["shard"] for failed in report["failed"]] == ["torn"]
    assert "torn.made: corrupt; copy it again" in report["failed"][0]["reason"]
    assert (report["converted"], report["shards"]) == (49, 49)
    (raw / "torn.made").write_text("99")
    again = report_of(*start(dask, raw, lake, "--cluster", dask.address))
    assert (again["converted"], again["skipped"]) == (1, 49)
    assert_equals_undisturbed(lake, raw)


# --- the scheduler ------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_scheduler_exits(dask: Dask, tmp_path, number):
    raw, lake = held_raw(tmp_path / "raw", shards=10), tmp_path / "lake"
    gate.close(raw, admitted=3)
    dask.start_worker("--no-nanny")
    command, log = start(dask, raw, lake, "--cluster", dask.address, is_quiet=False)
    until(lambda: ": 3 of 10 shards after" in log.read_text(), "the command knows that three shards are finished")
    dask.scheduler.send_signal(number)
    assert command.wait(HANGS_AFTER) == 1
    gate.open_(raw)
    line = log.read_text().splitlines()[-1]
    assert line.startswith(f"error: {dask.address}: the scheduler is gone; finished work is kept: restart it")
    assert len(Lake(lake)) == 9
    dask.start_scheduler()
    dask.start_worker("--no-nanny")
    again = report_of(*start(dask, raw, lake, "--cluster", dask.address))
    assert again["skipped"] + again["adopted"] >= 3
    assert again["skipped"] + again["shards"] == 10
    assert_equals_undisturbed(lake, raw)


def test_no_worker_connects(dask: Dask, tmp_path):
    profile = tmp_path / "mine.toml"
    profile.write_text(f'kind = "scheduler"\naddress = "{dask.address}"\npatience = 1.0\n')
    raw = held_raw(tmp_path / "raw", shards=1)
    command, log = start(dask, raw, tmp_path / "lake", "--cluster", profile)
    assert command.wait(HANGS_AFTER) == 1
    assert "no worker for 1 s; finished work is kept: start workers (`dask worker tcp://" in log.read_text()


# --- the client ---------------------------------------------------------------------------------------


def test_client_killed_between_writing_and_committing(dask: Dask, tmp_path):
    raw, lake = held_raw(tmp_path / "raw", shards=10), tmp_path / "lake"
    gate.close(raw, admitted=3)
    dask.start_worker("--no-nanny")
    command, _ = start(dask, raw, lake, "--cluster", dask.address)
    until(lambda: gate.waiting(raw), "a fourth shard has begun")
    command.kill()
    command.wait()
    gate.open_(raw)
    assert finished(lake) >= 3
    assert not list(lake.glob("snapshots/*.json"))  # written and renamed, but not in any snapshot
    again = report_of(*start(dask, raw, lake, "--cluster", dask.address))
    assert again["adopted"] >= 3
    assert again["shards"] == 10
    assert_equals_undisturbed(lake, raw)


@pytest.mark.parametrize("where", ["local", "existing"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_interrupted_client(processes: Processes, tmp_path, number, where):
    raw, lake = held_raw(tmp_path / "raw", shards=10), tmp_path / "lake"
    gate.close(raw, admitted=3)
    cluster = ["local", "--workers", 2]
    if where == "existing":
        processes = Dask(tmp_path)
        cluster = [processes.start_scheduler()]
        processes.start_worker("--no-nanny")
    command, log = start(processes, raw, lake, "--cluster", *cluster, is_quiet=False)
    until(lambda: ": 3 of 10 shards after" in log.read_text(), "the command knows that three shards are finished")
    started = psutil.Process(command.pid).children(recursive=True)
    if number == signal.SIGINT:
        os.killpg(command.pid, number)  # like a terminal: the signal reaches its workers too
    else:
        command.send_signal(number)
    gate.open_(raw)
    command.wait(HANGS_AFTER)
    *progress, line = log.read_text().splitlines()
    assert command.returncode == 128 + number, line
    assert all(each.startswith(("cluster ", f"convert {NAME}: ")) for each in progress), progress
    assert line.startswith(("interrupted: ", "terminated: "))
    assert "run the same command again to continue" in line
    assert psutil.wait_procs(started, timeout=HANGS_AFTER)[1] == []
    kept = len(Lake(lake))
    assert kept >= 9
    again = report_of(*start(processes, raw, lake, "--workers", 1))
    assert again["skipped"] == kept // 3
    assert_equals_undisturbed(lake, raw)
    processes.end()


@pytest.mark.parametrize("kind", ["the same recordings", "different recordings"])
def test_two_concurrent_clients(dask: Dask, tmp_path, kind):
    raw, lake = held_raw(tmp_path / "raw", shards=10), tmp_path / "lake"
    sources = [raw, raw]
    if kind == "different recordings":
        half = [path for path in sorted(raw.iterdir()) if path.stem >= "s05"]
        sources[1] = write_raw(tmp_path / "second", {path.stem: path.read_text().splitlines() for path in half})
        for path in half:
            path.unlink()
    dask.start_worker("--no-nanny")
    dask.start_worker("--no-nanny")
    commands = [start(dask, source, lake, "--cluster", dask.address) for source in sources]
    reports = [report_of(*command) for command in commands]
    assert all(report["failed"] == [] for report in reports)
    scenarios = Lake(lake).sql("SELECT count(*), count(DISTINCT scenario_id) FROM metadata").row(0)
    assert scenarios == (30, 30)
    held_raw(raw, shards=10)
    assert_equals_undisturbed(lake, raw)
