"""Faults of a lake in an object store: errors, lost responses, killed clients, concurrent clients.

The lake either stays as it was or becomes what an undisturbed run would have produced.
"""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pytest

from scenarionet_data import Lake, ScenarioLoader, convert
from scenarionet_data.errors import LakeError
from scenarionet_data.storage.files.places import open_files
from scenarionet_data.storage.snapshots import snapshot as snapshots
from tests.fixtures.lakes import content, write_shard
from tests.fixtures.made import NAME, MadeOptions, write_raw
from tests.fixtures.scenarios import make_scenario
from tests.fixtures.waiting import HANGS_AFTER, until

pytestmark = pytest.mark.long

CONVERT = """
import sys
from scenarionet_data import convert
from scenarionet_data.conversion import committer
from tests.fixtures.made import NAME, MadeOptions
committer._COMMIT_EVERY = float("inf")  # at the end alone, however slow the machine is
if __name__ == "__main__":
    convert(NAME, sys.argv[1], sys.argv[2], options=MadeOptions(num_objects=2))
"""

COMMIT_MANY = """
import sys
from scenarionet_data.storage.snapshots import commit as commits
from scenarionet_data.storage.files.places import open_files
from tests.fixtures.lakes import write_shard
from tests.fixtures.scenarios import make_scenario, renamed
url, who = sys.argv[1:]
template = make_scenario(1, num_objects=2, num_steps=5, num_lanes=1, num_lights=1)
records = [write_shard(url, [renamed(template, f"{who}{k}")], name=f"{who}{k}") for k in range(8)]
print("ready", flush=True)
sys.stdin.readline()
for record in records:
    commits.commit(open_files(url), [record], who)
"""


def run(raw, root):
    return convert(NAME, str(raw), root, options=MadeOptions(num_objects=2))


@pytest.fixture
def raw(tmp_path):
    return write_raw(tmp_path / "raw", {f"s{k}": [k * 10 + i for i in range(4)] for k in range(5)})


@pytest.fixture
def undisturbed(raw, tmp_path):
    """The lake written by an undisturbed run."""
    run(raw, tmp_path / "undisturbed")
    return content(tmp_path / "undisturbed")


@pytest.mark.parametrize("status", [500, 503])
def test_temporary_errors_are_retried(url, store, raw, undisturbed, status):
    store.set(failures=6, status=status)
    report = run(raw, url)
    assert (report.converted, report.failed) == (20, [])
    assert content(url) == undisturbed
    store.set(failures=4, status=status)
    assert len(list(ScenarioLoader(url))) == 20


def test_permanent_errors_end_the_run_without_partial_data(url, store, raw, undisturbed, monkeypatch):
    monkeypatch.setenv("SCENARIONET_PATIENCE", "1")
    store.set(failures=10_000, status=503, method="PUT", part="/metadata/")
    with pytest.raises(LakeError, match=r"503 .* retried for 1\.\d s .* run the same command again"):
        run(raw, url)
    store.set()
    assert open_files(url).names("snapshots") == []
    report = run(raw, url)
    assert report.converted == 20
    assert content(url) == undisturbed


def test_commit_with_a_lost_response_is_applied_once(url, store, raw, undisturbed):
    """The retry finds that the snapshot already exists and recognises it as this client's own."""
    store.set(failures=1, status=500, method="PUT", part="/snapshots/0", is_lost=True)
    assert run(raw, url).failed == []
    assert snapshots.numbers(open_files(url)) == [1]
    store.set(failures=1, status=500, method="PUT", part="/databases/", is_lost=True)
    assert Lake(url).filter("num_objects > 0", name="all").version == 1
    assert content(url) == undisturbed


def test_only_one_of_several_clients_creates_a_file(url, store):
    files = [open_files(url) for _ in range(8)]
    with ThreadPoolExecutor(len(files)) as threads:
        won = list(threads.map(lambda one: one.publish_new("snapshots/x", b"the same"), files))
    assert sorted(won) == [False] * 7 + [True]


def test_client_killed_during_upload(url, store, raw, undisturbed):
    files, folder = open_files(url), "metadata/dataset=made/version=v1/split=train"
    store.set(method="PUT", part=folder, holds_after=2)
    job = subprocess.Popen([sys.executable, "-c", CONVERT, str(raw), url])
    uploads = lambda: [path for method, path, _ in store.requests() if method == "PUT" and folder in path]  # noqa: E731
    until(lambda: len(uploads()) == 3 or job.poll() is not None, "a third file is being uploaded")
    job.send_signal(signal.SIGKILL)
    assert job.wait() == -signal.SIGKILL
    store.set()
    finished = len(files.names(folder))
    assert finished == 2
    assert files.names("snapshots") == []  # no snapshot shows the upload
    report = run(raw, url)
    assert (report.adopted, report.converted) == (finished, 20)
    assert content(url) == undisturbed


def test_two_clients_commit_at_once(url, store):
    commands = [[sys.executable, "-c", COMMIT_MANY, url, who] for who in ("a", "b")]
    pipe = subprocess.PIPE
    jobs = [subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True) for command in commands]
    assert [job.stdout.readline() for job in jobs] == ["ready\n"] * 2
    for job in jobs:
        job.stdin.write("go\n")
        job.stdin.flush()
    for job in jobs:
        job.communicate(timeout=HANGS_AFTER)
        assert job.returncode == 0
    lake = Lake(url)
    ids = lake.sql("SELECT scenario_id FROM metadata ORDER BY ALL")["scenario_id"].to_list()
    assert ids == sorted(f"made/v1/{who}{k}" for who in "ab" for k in range(8))
    assert lake.snapshot.number == 16


def test_overwritten_upload_is_found(url, store):
    """A file overwritten after its upload fails the checks."""
    from scenarionet_data.storage.integrity.snapshot_checks import verify
    from scenarionet_data.storage.snapshots import commit as commits

    files = open_files(url)
    record = write_shard(url, [make_scenario(1)])
    commits.commit(files, [record], "test")
    files._store.put(record.files[0], b"something else")
    found = [damage.file for damage in verify(files, Lake(url).snapshot)]
    assert found[0] == record.files[0]
    assert json.loads(snapshots.read(files).to_bytes())["number"] == 1
