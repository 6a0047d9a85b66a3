"""Workers of a Dask cluster do jobs as everybody does: the same results, the same errors."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from scenarionet_data import convert
from scenarionet_data.errors import LakeError, WorkerLost
from scenarionet_data.execution.executors import Pool, run_here
from scenarionet_pipelines.cluster import open_cluster
from scenarionet_pipelines.cluster.dask_executor import Crew
from tests.fixtures.lakes import content
from tests.fixtures.made import NAME, MadeOptions, write_raw

THREADS = """
kind = "local"
workers = 2
[options]
processes = false
dashboard_address = "127.0.0.1:0"
memory_limit = 0
"""


@pytest.fixture(scope="module")
def crew(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Crew]:
    """Two workers within this process: quick to start; workers that are processes are in ``test_faults``."""
    path = tmp_path_factory.mktemp("profile") / "threads.toml"
    path.write_text(THREADS)
    with open_cluster(str(path)) as opened:
        yield opened


def half(number: int) -> int:
    if number == 13:
        raise LakeError("thirteen")
    if number == 17:
        raise MemoryError
    return number // 2


def test_what_each_job_returned(crew):
    assert crew.workers == 2
    assert sorted(crew(range(12), half)) == sorted(map(half, range(12)))
    assert list(crew([], half)) == []


def test_what_a_job_raises_ends_the_run(crew):
    with pytest.raises(LakeError, match="thirteen"):
        list(crew([1, 13], half))


@pytest.mark.parametrize("who", ["here", "crew"])
def test_a_job_without_memory_is_lost_and_the_others_go_on(crew, who):
    run = {"here": run_here, "crew": crew}[who]
    found = set(run([2, 17, 4], half, lambda job, why: f"{job}: {why}"))
    assert {1, 2} < found
    (reason,) = (each for each in found if isinstance(each, str))
    assert reason.startswith("17: it needs more memory than")
    with pytest.raises(WorkerLost, match="it needs more memory than"):
        list(run([2, 17, 4], half))


def test_jobs_are_read_as_they_are_needed(crew):
    taken = 0

    def jobs():
        nonlocal taken
        for number in range(1000):
            taken += 1
            yield 2 * number

    results = crew(jobs(), half)
    assert next(results) < 10
    results.close()
    assert taken <= 8


def test_the_same_lake_whoever_converts(crew, tmp_path):
    raw = write_raw(tmp_path / "raw", {f"s{k}": [10 * k, f"{10 * k + 1} invalid"] for k in range(4)})
    runs = {"here": run_here, "crew": crew}
    reports = {
        name: convert(NAME, str(raw), tmp_path / name, options=MadeOptions(num_objects=2), run=run)
        for name, run in runs.items()
    }
    assert content(tmp_path / "here") == content(tmp_path / "crew")
    for report in reports.values():
        assert (report.converted, report.quarantined) == (4, 4)
        assert sum(share.jobs for share in report.workers.values()) == 4
        assert sum(share.counts["bytes"] for share in report.workers.values()) == report.size


@pytest.mark.long
def test_the_same_lake_from_processes(tmp_path):
    raw = str(write_raw(tmp_path / "raw", {f"s{k}": [10 * k, f"{10 * k + 1} invalid"] for k in range(8)}))
    with open_cluster("local", workers=2) as workers:
        for name, run in {"here": run_here, "pool": Pool(2), "dask": workers}.items():
            report = convert(NAME, raw, tmp_path / name, options=MadeOptions(num_objects=2), run=run)
            assert len(report.workers) == (1 if name == "here" else 2)
    assert content(tmp_path / "here") == content(tmp_path / "pool") == content(tmp_path / "dask")
