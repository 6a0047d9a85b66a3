"""Cluster profiles: names, validation, and the options passed to Dask."""

from __future__ import annotations

import inspect

import pytest

from scenarionet_data.errors import BadParameter, ClusterLost
from scenarionet_pipelines.cluster import open_cluster
from scenarionet_pipelines.cluster import profile as profiles

pytestmark = pytest.mark.integration


def test_scheduler_address_as_profile():
    found = profiles.find("tcp://10.0.0.5:8786")
    assert (found.kind, found.address) == ("scheduler", "tcp://10.0.0.5:8786")


@pytest.mark.parametrize("name", profiles.names())
def test_bundled_profiles_are_documented(name):
    found = profiles.find(name)
    assert found.doc.endswith(".")
    text = (profiles.FOLDER / f"{name}.toml").read_text("utf-8")
    assert "--cluster" in text.split("kind =")[0]


def test_one_bundled_profile_per_kind():
    assert {profiles.find(name).kind for name in profiles.names()} == set(profiles.KINDS)


def test_user_defined_profile(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('kind = "local"\nworkers = 3\n[options]\nmemory_limit = "1GiB"\n')
    found = profiles.find(str(path))
    assert (found.workers, found.options) == (3, {"memory_limit": "1GiB"})


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("kind = ", "Invalid value"),
        ('kind = "cloud"', "expected a kind out of scheduler, local, ssh, slurm, kubernetes, found 'cloud'"),
        ('kind = "local"\nworker = 3', "unknown key 'worker'; a profile has kind,"),
        ('kind = "scheduler"', "expected the scheduler's address"),
    ],
)
def test_invalid_profiles_are_named(text, message):
    with pytest.raises(BadParameter, match=message):
        profiles.parse(text, "mine.toml")


def test_unknown_profile_error_lists_existing_ones():
    with pytest.raises(
        BadParameter, match=r"no cluster 'locall'; did you mean local\? known profiles: existing, .*tcp://HOST"
    ):
        profiles.find("locall")


def test_options_match_dask_classes():
    from distributed import LocalCluster, SSHCluster, Worker

    assert set(profiles.find("ssh").options) <= set(inspect.signature(SSHCluster).parameters)
    takes = {*inspect.signature(LocalCluster).parameters, *inspect.signature(Worker).parameters}
    assert set(profiles.find("local").options) <= takes


@pytest.mark.long
def test_slurm_job_script(tmp_path):
    from dask_jobqueue import SLURMCluster

    here = {"scheduler_options": {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}}
    with SLURMCluster(**profiles.find("slurm").options, **here, log_directory=str(tmp_path)) as cluster:
        script = cluster.job_script()
    assert "#SBATCH --cpus-per-task=16" in script
    assert "#SBATCH --mem=32G" in script
    assert "--nthreads 1 --memory-limit 2.00GiB --nworkers 16" in script


def test_scheduler_with_workers_starts_no_others():
    with pytest.raises(
        BadParameter, match=r"--workers: tcp://127\.0\.0\.1:1 is a running scheduler; start more workers"
    ):
        open_cluster("tcp://127.0.0.1:1", workers=3).__enter__()


def test_unreachable_scheduler(monkeypatch):
    monkeypatch.setattr("scenarionet_pipelines.cluster.opening._CONNECT_WITHIN", 0.3)
    with (
        pytest.raises(ClusterLost, match=r"tcp://127.0.0.1:1: no scheduler answers; start one with `dask scheduler`"),
        open_cluster("tcp://127.0.0.1:1"),
    ):
        pass
