"""A Dask cluster gives the same results and the same errors as any other executor."""

from __future__ import annotations

import threading
from collections.abc import Iterator

import pytest
from distributed import Client, LocalCluster

from scenarionet_data import convert
from scenarionet_data.errors import LakeError, WorkerLost
from scenarionet_data.execution.executors import ProcessExecutor, run_serially
from scenarionet_pipelines.cluster import open_cluster
from scenarionet_pipelines.cluster.dask_executor import DaskExecutor
from tests.fixtures import gate
from tests.fixtures.lakes import content
from tests.fixtures.made import NAME, MadeOptions, write_raw
from tests.fixtures.waiting import until

pytestmark = pytest.mark.integration

THREADS = """
kind = "local"
workers = 2
[options]
processes = false
dashboard_address = "127.0.0.1:0"
memory_limit = 0
"""


@pytest.fixture(scope="module")
def dask_executor(tmp_path_factory: pytest.TempPathFactory) -> Iterator[DaskExecutor]:
    """Two workers in this process, for speed; ``test_faults`` uses worker processes."""
    path = tmp_path_factory.mktemp("profile") / "threads.toml"
    path.write_text(THREADS)
    with open_cluster(str(path)) as opened:
        yield opened


@pytest.mark.long
def test_dashboard_is_named_if_there_is_one(dask_executor):
    assert dask_executor.dashboard.endswith("/status")
    with LocalCluster(n_workers=0, processes=False, dashboard_address=None) as without, Client(without) as client:
        assert DaskExecutor(client).dashboard is None


def half(number: int) -> int:
    if number == 13:
        raise LakeError("thirteen")
    if number == 17:
        raise MemoryError
    return number // 2


def test_every_job_returns_its_result(dask_executor):
    assert dask_executor.workers == 2
    assert sorted(dask_executor(range(12), half)) == sorted(map(half, range(12)))
    assert list(dask_executor([], half)) == []


def test_exception_in_a_job_ends_the_run(dask_executor):
    with pytest.raises(LakeError, match="thirteen"):
        list(dask_executor([1, 13], half))


@pytest.mark.parametrize("name", ["serial", "dask"])
def test_job_out_of_memory_is_lost_and_the_others_continue(dask_executor, name):
    executor = {"serial": run_serially, "dask": dask_executor}[name]
    found = set(executor([2, 17, 4], half, lambda job, reason: f"{job}: {reason}"))
    assert {1, 2} < found
    (reason,) = (each for each in found if isinstance(each, str))
    assert reason.startswith("17: it needs more memory than")
    with pytest.raises(WorkerLost, match="it needs more memory than"):
        list(executor([2, 17, 4], half))


def test_jobs_are_read_lazily(dask_executor, monkeypatch):
    monkeypatch.setattr(
        "scenarionet_pipelines.cluster.dask_executor._AHEAD", 0.0
    )  # independent of a previously measured rate
    taken = 0

    def jobs():
        nonlocal taken
        for number in range(1000):
            taken += 1
            yield 2 * number

    results = dask_executor(jobs(), half)
    assert next(results) < 10
    results.close()
    assert taken <= 8


def test_every_executor_writes_the_same_lake(dask_executor, tmp_path):
    raw = write_raw(tmp_path / "raw", {f"s{k}": [10 * k, f"{10 * k + 1} invalid"] for k in range(4)})
    executors = {"serial": run_serially, "dask": dask_executor}
    reports = {
        name: convert(NAME, str(raw), tmp_path / name, options=MadeOptions(num_objects=2), executor=executor)
        for name, executor in executors.items()
    }
    assert content(tmp_path / "serial") == content(tmp_path / "dask")
    for report in reports.values():
        assert (report.converted, report.quarantined) == (4, 4)
        assert sum(stats.jobs for stats in report.workers.values()) == 4
        assert sum(stats.counts["bytes"] for stats in report.workers.values()) == report.size


@pytest.mark.long
def test_processes_and_dask_write_the_same_lake(tmp_path):
    raw = write_raw(tmp_path / "raw", {f"s{k}": [f"{10 * k} held", f"{10 * k + 1} invalid"] for k in range(8)})

    def open_when_both_wait() -> None:
        until(lambda: len(gate.waiting(raw)) == 2, "both workers have begun a shard")
        gate.open_(raw)

    with open_cluster("local", workers=2) as workers:
        for name, executor in {"serial": run_serially, "pool": ProcessExecutor(2), "dask": workers}.items():
            beside = threading.Thread(target=open_when_both_wait)
            if name != "serial":
                gate.close(raw, admitted=0)
                beside.start()
            report = convert(NAME, str(raw), tmp_path / name, options=MadeOptions(num_objects=2), executor=executor)
            assert len(report.workers) == (1 if name == "serial" else 2)
    assert content(tmp_path / "serial") == content(tmp_path / "pool") == content(tmp_path / "dask")
