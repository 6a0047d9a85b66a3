"""Cores and memory of the machine or its container."""

from __future__ import annotations

import pytest

from scenarionet_pipelines import machine
from scenarionet_pipelines.doctor import local


@pytest.fixture
def container(tmp_path, monkeypatch):
    monkeypatch.setattr(machine, "_CGROUP", tmp_path)
    monkeypatch.setattr("os.sched_getaffinity", lambda _: set(range(16)), raising=False)
    return tmp_path


def test_without_limits(container):
    assert machine.num_cores() == 16
    assert machine.memory() > 2**28


def test_limits_of_a_container(container):
    (container / "cpu.max").write_text("350000 100000\n")
    (container / "memory.max").write_text(f"{2**30}\n")
    assert machine.num_cores() == 4
    assert machine.memory() == 2**30
    assert machine.default_workers() == 1  # memory for half a worker
    (container / "memory.max").write_text("max\n")
    (container / "cpu.max").write_text("max 100000\n")
    assert machine.num_cores() == 16


@pytest.mark.parametrize(("gigabytes", "workers"), [(1, 1), (7, 3), (64, 16)])
def test_workers_fit_into_memory(container, gigabytes, workers, monkeypatch):
    monkeypatch.setattr(machine, "memory", lambda: gigabytes * 2**30)
    assert machine.default_workers() == workers


def test_free_disk_of_a_folder_that_does_not_exist_yet(tmp_path):
    assert machine.free_disk(tmp_path / "not" / "yet") == pytest.approx(machine.free_disk(tmp_path), rel=0.1)


def test_versions():
    assert local.is_within("26.0.1", ">=19,<27")
    assert not local.is_within("18.9", ">=19,<27")
    assert not local.is_within("27", ">=19,<27")
    assert local.is_within("3.2.7rc1", ">=3.2.7")
    assert local.is_within("1", "")


@pytest.mark.parametrize(
    ("is_checkout", "install"), [(True, "pip install -e '.[sim]'"), (False, "pip install 'scenarionet-lake[sim]'")]
)
def test_missing_packages_have_a_remedy(is_checkout, install, monkeypatch, tmp_path):
    (tmp_path / "checkout").touch()
    monkeypatch.setattr(local, "_PROJECT", tmp_path / ("checkout" if is_checkout else "nothing"))
    wanted = ["nothing-like-it>=1", "numpy<2", "nor-this>=2; extra == 'sim'", "b>=1; python_version == '2.7'"]
    monkeypatch.setattr(local, "_requirements", lambda: wanted)
    found = [(f.subject, f.state, f.remedy) for f in local.examine_installation() if f.topic == "packages"]
    assert found == [
        ("nothing-like-it", "bad", "pip install 'nothing-like-it>=1'"),
        ("numpy", "bad", "pip install 'numpy<2'"),
        ("nor-this", "missing", install),
        ("b", "missing", ""),
    ]


def test_requirements_of_a_checkout_match_the_package(monkeypatch):
    from importlib.metadata import PackageNotFoundError

    def absent(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr("importlib.metadata.requires", absent)
    found = [local._parse(text) for text in local._requirements()]
    assert ("pyarrow", ">=19,<27", "") in found
    assert ("pybullet", ">=3.2.7,<4", " python_version == '3.11' and extra == 'sim'") in found


def test_converter_that_fails_to_load_is_named(monkeypatch):
    from scenarionet_data import converters

    def broken(name):
        raise RuntimeError("incompatible")

    monkeypatch.setattr(converters, "names", lambda: ["old"])
    monkeypatch.setattr(converters, "get", broken)
    (found,) = [f for f in local.examine_installation() if f.topic == "converters"]
    assert (found.state, found.found) == ("bad", "does not load: RuntimeError: incompatible")
