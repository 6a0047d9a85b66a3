"""Disturbed conversions: killed jobs, concurrent jobs, vanishing files, unusual names.

The lake either stays as it was or becomes what an undisturbed run would have produced.
"""

from __future__ import annotations

import multiprocessing
import re
import signal
import subprocess
import sys

import pytest

from scenarionet_data import Lake, ScenarioLoader
from scenarionet_data.errors import WorkerLost
from scenarionet_data.storage.files.local import LocalLakeFiles
from tests.fixtures import gate
from tests.fixtures.lakes import content
from tests.fixtures.made import held_raw, raw_of, run, write_raw
from tests.fixtures.waiting import HANGS_AFTER, until

pytestmark = pytest.mark.integration

CONVERT = """
import sys
from scenarionet_data import convert
from scenarionet_data.conversion import committer
from tests.fixtures.made import NAME, MadeOptions
committer._COMMIT_EVERY = float("inf")  # at the end alone, however slow the machine is
if __name__ == "__main__":
    report = convert(NAME, sys.argv[1], sys.argv[2], options=MadeOptions(num_objects=2))
    print(report.converted, report.failed)
"""


def start(raw, root):
    return subprocess.Popen([sys.executable, "-c", CONVERT, str(raw), str(root)], stdout=subprocess.PIPE, text=True)


def test_killed_job_loses_at_most_the_current_shard(tmp_path):
    raw = held_raw(tmp_path / "raw", shards=5, lines=4)
    gate.close(raw, admitted=2)
    job = start(raw, tmp_path / "lake")
    until(lambda: gate.waiting(raw) or job.poll() is not None, "a third shard has begun")
    job.send_signal(signal.SIGKILL)
    job.communicate()
    assert job.returncode == -signal.SIGKILL
    assert len(list(tmp_path.glob("lake/metadata/**/*.parquet"))) == 2
    gate.open_(raw)
    report = run(raw, tmp_path / "lake")
    assert report.adopted == 2
    assert report.converted == 20
    run(raw, tmp_path / "undisturbed")
    assert content(tmp_path / "lake") == content(tmp_path / "undisturbed")


@pytest.mark.long
def test_shard_of_a_killed_worker_is_converted_again(tmp_path):
    raw = raw_of(tmp_path / "raw", 0, 12)

    def kill(done, *_):
        if done == 3:
            multiprocessing.active_children()[0].kill()

    report = run(raw, tmp_path / "lake", workers=2, on_progress=kill)
    assert (report.failed, len(Lake(tmp_path / "lake"))) == ([], 24)
    run(raw, tmp_path / "undisturbed")
    assert content(tmp_path / "lake") == content(tmp_path / "undisturbed")


@pytest.mark.long
def test_shard_that_kills_its_workers_is_reported_and_others_continue(tmp_path):
    raw = write_raw(raw_of(tmp_path / "raw", 0, 6), {"s099": ["99 deadly"]})
    report = run(raw, tmp_path / "lake", workers=2)
    ((shard, reason),) = report.failed
    assert (shard, len(Lake(tmp_path / "lake"))) == ("s099", 12)
    assert (
        reason == "a worker process was killed, usually because the machine ran out of memory, even with no other job "
        "running; give it more memory"
    )


@pytest.mark.long
def test_repeatedly_killed_workers_end_the_run(tmp_path):
    raw = write_raw(tmp_path / "raw", {f"s{k:03d}": [f"{k} deadly"] for k in range(20)})
    with pytest.raises(WorkerLost, match="finished work is kept: run the same command again with fewer workers"):
        run(raw, tmp_path / "lake", workers=2)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["the same recordings", "different recordings"])
def test_two_concurrent_jobs_produce_one_lake(tmp_path, kind):
    first = raw_of(tmp_path / "first", 0, 8)
    second = first if kind == "the same recordings" else raw_of(tmp_path / "second", 50, 8)
    jobs = [start(raw, tmp_path / "lake") for raw in (first, second)]
    outputs = [job.communicate(timeout=HANGS_AFTER)[0] for job in jobs]
    assert [job.returncode for job in jobs] == [0, 0]
    # Both jobs convert the same recordings; the later one converts what is left, or nothing.
    assert all(re.fullmatch(r"\d+ \[\]\n", output) for output in outputs)
    assert sum(int(output.split()[0]) for output in outputs) >= 16
    run(first, tmp_path / "undisturbed")
    run(second, tmp_path / "undisturbed")
    assert content(tmp_path / "lake") == content(tmp_path / "undisturbed")
    ids = Lake(tmp_path / "lake").sql("SELECT scenario_id FROM metadata")["scenario_id"]
    assert ids.n_unique() == len(ids) == len({*first.iterdir(), *second.iterdir()}) * 2


def test_vanished_recordings_fail_without_affecting_others(tmp_path, monkeypatch):
    raw = raw_of(tmp_path / "raw", 0, 2)

    def vanish(done, *_):
        if done:
            (raw / "s000.made").unlink(missing_ok=True)  # the larger one comes first

    report = run(raw, tmp_path / "lake", on_progress=vanish)
    assert report.converted == 2
    ((name, reason),) = report.failed
    assert name == "s000"
    assert "No such file or directory" in reason


def test_symlink_in_lake_path(tmp_path):
    """A lake reached through a symlink is the same lake."""
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "real")
    raw = raw_of(tmp_path / "raw", 0, 1)
    run(raw, tmp_path / "link" / "lake")
    assert run(raw, tmp_path / "real" / "lake").skipped == 1
    assert len(Lake(tmp_path / "link" / "lake")) == 2
    assert LocalLakeFiles(tmp_path / "link" / "lake").root == (tmp_path / "real" / "lake").resolve()


@pytest.mark.parametrize("name", ['it\'s a "lake"', "ü 100% a=b", "[x]*?"])
def test_unusual_folder_names(tmp_path, name):
    raw = raw_of(tmp_path / "raw", 0, 1)
    run(raw, tmp_path / name)
    lake = Lake(tmp_path / name)
    assert len(lake) == 2
    assert lake.sql("SELECT count(*) AS n FROM tracks JOIN metadata USING (scenario_id)")["n"][0] == 4
    assert len(ScenarioLoader(lake)[1].tracks) == 2
