"""Cores and memory of the machine or its container."""

from __future__ import annotations

import tomllib

import pytest

from scenarionet_pipelines import machine
from scenarionet_pipelines.doctor import examine, local
from scenarionet_pipelines.doctor.local import Requirement


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
    wanted = ["nothing-like-it>=1", "click>=8", "numpy<2", "nor-this>=2; extra == 'sim'", "b; extra == 'docs'"]
    wanted += ["c; python_version == '2.7' and extra == 'web'"]
    monkeypatch.setattr(local, "_requirements", lambda: wanted)
    found = {f.subject: (f.state, f.found, f.remedy) for f in local.examine_installation() if f.topic == "packages"}
    assert [*found] == ["required", *local.EXTRAS]
    state, text, remedy = found["required"]
    assert (state, remedy) == ("bad", "pip install 'nothing-like-it>=1' 'numpy<2'")
    assert text.startswith("3 packages: nothing-like-it is not installed, numpy is 2")
    assert found["sim"] == ("missing", "for the simulator: nor-this is not installed", install)
    assert found["web"] == ("missing", "for scenarionet browse: c needs Python 2.7", "")
    assert found["plots"] == ("ok", "for pictures and reports", "")


def test_every_extra_of_users_is_examined():
    project = tomllib.loads(local._PROJECT.read_text())["project"]
    assert local.EXTRAS.keys() == project["optional-dependencies"].keys() - {"dev", "docs", "mutants"}


def test_findings_fit_on_a_screen(tmp_path):
    assert len(examine(str(tmp_path))) <= 30


def test_requirements_of_a_checkout_match_the_package(monkeypatch):
    from importlib.metadata import PackageNotFoundError

    def absent(name):
        raise PackageNotFoundError(name)

    monkeypatch.setattr("importlib.metadata.requires", absent)
    found = [local.parse(text) for text in local._requirements()]
    assert Requirement("pyarrow", ">=20,<27", "", "") in found
    assert Requirement("pybullet", ">=3.2.7,<4", "sim", "3.11.") in found
    assert [f for f in local.examine_installation() if "scenarionet-lake is not" in f.found] == []


def test_rospy_is_found_where_debian_has_it(monkeypatch, tmp_path):
    from scenarionet_sim.bridges import rospy_wire

    monkeypatch.setattr(rospy_wire, "DEBIAN", str(tmp_path))
    assert local.examine_ros1().remedy == "apt-get install python3-rospy python3-rosmaster"
    (tmp_path / "rospy").mkdir()
    (tmp_path / "rospy" / "__init__.py").touch()
    assert local.examine_ros1().state == "ok"


def test_a_checkout_of_openpilot_is_named(monkeypatch, tmp_path):
    monkeypatch.delenv("OPENPILOT", raising=False)
    assert list(local.examine_openpilot()) == []
    monkeypatch.setenv("OPENPILOT", str(tmp_path))
    (found,) = local.examine_openpilot()
    assert f"{tmp_path} has no log.capnp" in found.found
    assert "missing: capnp" in found.found
    (tmp_path / "cereal").mkdir()
    (tmp_path / "cereal" / "log.capnp").touch()
    for name in ("capnp", "msgq", "opendbc"):
        (tmp_path / f"{name}.py").touch()
    monkeypatch.syspath_prepend(str(tmp_path))
    assert [each.state for each in local.examine_openpilot()] == ["ok"]


def test_converter_that_fails_to_load_is_named(monkeypatch):
    from scenarionet_data import converters

    def broken(name):
        raise RuntimeError("incompatible")

    monkeypatch.setattr(converters, "names", lambda: ["old"])
    monkeypatch.setattr(converters, "get", broken)
    (found,) = [f for f in local.examine_installation() if f.topic == "converters"]
    assert (found.state, found.found) == ("bad", "does not load: RuntimeError: incompatible")
