"""Verbs other than convert with ``--cluster`` give the same results as without."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from scenarionet_data import Lake
from scenarionet_data.execution.executors import worker_name
from tests.fixtures.lakes import content
from tests.scenarionet_pipelines.cluster.conftest import Dask
from tests.scenarionet_pipelines.cluster.test_dask_executor import THREADS
from tests.scenarionet_pipelines.conftest import run

pytestmark = pytest.mark.integration


@pytest.fixture
def threads(tmp_path: Path) -> Path:
    """A cluster within this process."""
    path = tmp_path / "threads.toml"
    path.write_text(THREADS)
    return path


def pickles(folder: Path) -> dict[str, str]:
    """Content of each file, with sets sorted: their order differs between processes."""
    return {path.name: repr(_plain(pickle.loads(path.read_bytes()))) for path in folder.iterdir()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, set):
        return sorted(value)
    return value.tolist() if isinstance(value, np.ndarray) else value


def test_convert_on_a_local_cluster(tmp_path, as_json):
    """Two worker processes, as users start them by name."""
    found = as_json("convert", "pg", "0:6", tmp_path / "far", "--cluster", "local", "--workers", 2, "--quiet")
    assert found["converted"] == 6 and worker_name() not in found["workers"]
    as_json("convert", "pg", "0:6", tmp_path / "near", "--quiet")
    assert content(tmp_path / "far") == content(tmp_path / "near")


@pytest.mark.long
def test_check(lake, threads, as_json):
    for words in ((), ("--scorecard",)):
        found = as_json("maintain", "check", lake, *words, "--cluster", threads, "--quiet")
        (share,) = found.pop("workers").values()
        assert share["jobs"] == len(found["checks"])
        assert found == as_json("maintain", "check", lake, *words)


@pytest.mark.long
def test_check_of_a_database(lake, threads, as_json):
    Lake(lake).filter("true", name="all")
    found = as_json("maintain", "check", lake, "all", "--cluster", threads, "--quiet")
    del found["workers"]
    assert found == as_json("maintain", "check", lake, "all")


def test_export(lake, threads, tmp_path, monkeypatch, as_json):
    monkeypatch.setattr("scenarionet_data.export.pickling.PART", 4)
    Lake(lake).filter("true", name="all")
    written = as_json("export", lake, "all", tmp_path / "here")
    again = as_json("export", lake, "all", tmp_path / "cluster", "--cluster", threads, "--quiet")
    assert (again["scenarios"], again["bytes"]) == (written["scenarios"], written["bytes"])
    assert pickles(tmp_path / "cluster") == pickles(tmp_path / "here")


@pytest.mark.long
def test_export_by_processes(lake, tmp_path, as_json):
    Lake(lake).filter("true", name="all")
    as_json("export", lake, "all", tmp_path / "pool", "--workers", 2)
    as_json("export", lake, "all", tmp_path / "here")
    assert pickles(tmp_path / "pool") == pickles(tmp_path / "here")


@pytest.mark.long
def test_sim_check_and_export_on_worker_processes(dask: Dask, lake, tmp_path, as_json):
    Lake(lake).filter("true", name="all")
    dask.start_worker()
    where = ("--cluster", dask.address, "--quiet")
    simulated = as_json("sim", lake, "--policy", "replay", "--backend", "kinematic", "--name", "far", *where)
    near = as_json("sim", lake, "--policy", "replay", "--backend", "kinematic", "--name", "near", "--workers", 1)
    timing = {"run", "seconds", "next", "workers"}
    assert {k: v for k, v in simulated.items() if k not in timing} == {k: v for k, v in near.items() if k not in timing}
    checked = as_json("maintain", "check", lake, "--simulate", *where)
    assert set(checked.pop("workers")) == set(simulated["workers"])
    assert checked == as_json("maintain", "check", lake, "--simulate", "--workers", 1)
    as_json("export", lake, "all", tmp_path / "far", *where)
    as_json("export", lake, "all", tmp_path / "near")
    assert pickles(tmp_path / "far") == pickles(tmp_path / "near")


def test_unknown_cluster_error_lists_existing_ones(lake):
    result = run("maintain", "check", lake, "--cluster", "slrum")
    assert result.exit_code == 2
    assert "no cluster 'slrum'; did you mean slurm?" in result.stderr
