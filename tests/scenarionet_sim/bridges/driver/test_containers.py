"""Drivers in containers, with a runtime that starts the processes of its images without isolation."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import driver_process
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter, SourceNotFound
from scenarionet_data.storage import evaluation_runs
from scenarionet_sim.bridges.driver import containers, planner, wire
from scenarionet_sim.drivers.code import pinned_code, policy_name
from scenarionet_sim.evaluation.evaluation import evaluate
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

IMAGE = "ab12" * 16
DRIVES = [make_drive(f"d{k}", num_steps=21, others=(Other(22.0 + 4 * k, vx=1.0),)) for k in range(3)]

RUNTIME = f"""#!{sys.executable}
import os, signal, sys
from pathlib import Path
verb, words, state = sys.argv[1], sys.argv[2:], Path(__file__).parent
if verb == "image":
    assert words[:3] == ["inspect", "--format", "{{{{.Id}}}}"], words
    if words[3] not in ("mine:1.0", "sha256:{IMAGE}"):
        sys.exit(f"Error: No such image: {{words[3]}}")
    print("sha256:{IMAGE}")
elif verb == "run":
    options, (image, place) = words[:-2], words[-2:]
    with (state / "runs").open("a") as log:
        log.write(" ".join(options) + "\\n")
    assert options.pop(0) == "--rm" and image == "sha256:{IMAGE}", words
    given = dict(zip(options[::2], options[1::2]))
    here, there = given["--volume"].split(":")
    (state / given["--name"]).write_text(str(os.getpid()))
    driver = os.environ.get("FAKE_DRIVER", {driver_process.__file__!r})
    place = place.replace(there, here)
    os.execv(sys.executable, [sys.executable, driver, place, {str(Path(wire.__file__).parent / "driver.binpb")!r}])
elif verb == "kill":
    os.kill(int((state / words[0]).read_text()), signal.SIGKILL)
"""


@pytest.fixture
def runtime(tmp_path, monkeypatch):
    """Folder of the runtime, first on PATH."""
    folder = tmp_path / "bin"
    folder.mkdir()
    for name in containers.RUNTIMES:
        (folder / name).write_text(RUNTIME)
        (folder / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    yield folder
    planner.connection_to(f"docker:sha256:{IMAGE}").end()
    planner.connection_to.cache_clear()


@pytest.fixture
def lake(tmp_path) -> Path:
    write_lake(tmp_path / "lake", DRIVES)
    return tmp_path / "lake"


def errors(lake: Path, run: str) -> list[str | None]:
    return (
        Lake(lake)
        .sql("SELECT error FROM results WHERE run = $run ORDER BY scenario_id", {"run": run})["error"]
        .to_list()
    )


def running(runtime: Path) -> list[int]:
    """Processes of containers that have not ended."""
    pids = [int(file.read_text()) for file in runtime.glob("scenarionet-*")]
    return [pid for pid in pids if Path(f"/proc/{pid}/exe").exists()]


def test_an_image_is_pinned_by_its_id(runtime):
    pinned = pinned_code("docker:mine:1.0")
    assert pinned == f"docker:sha256:{IMAGE}" and pinned_code(pinned) == pinned
    assert policy_name(pinned) == "docker-ab12ab12"
    assert pinned_code("podman:mine:1.0") == f"podman:sha256:{IMAGE}"


@pytest.mark.integration
def test_a_container_drives_as_a_process_and_ends_with_its_run(lake, runtime):
    evaluate(lake, policy="docker:mine:1.0", name="there")
    assert errors(lake, "there") == [None] * len(DRIVES)
    assert evaluation_runs.describe(Lake(lake).files, "there")["policy"] == f"docker:sha256:{IMAGE}"
    (options,) = (runtime / "runs").read_text().splitlines()
    assert "--network none" in options and "--pull never" in options and f"--user {os.getuid()}" in options
    assert len(running(runtime)) == 1, "one for all scenarios"
    planner.connection_to(f"docker:sha256:{IMAGE}").end()
    assert running(runtime) == []


@pytest.mark.integration
def test_one_that_ends_costs_its_scenario_and_is_started_again(lake, runtime, monkeypatch, tmp_path):
    source = Path(driver_process.__file__).read_text("utf-8")
    (tmp_path / "dies.py").write_text(source.replace("answer = commands_kind()", "sys.exit('my map is empty')"))
    monkeypatch.setenv("FAKE_DRIVER", str(tmp_path / "dies.py"))
    report = evaluate(lake, policy="docker:mine:1.0", name="dies")
    assert len(report.broken) == len(DRIVES)
    assert all("is it running?" in error for _, error in report.broken), report.broken
    assert len((runtime / "runs").read_text().splitlines()) > 1
    planner.connection_to(f"docker:sha256:{IMAGE}").end()
    assert running(runtime) == []


@pytest.mark.integration
def test_one_that_binds_no_socket_is_a_sentence_of_each_scenario(lake, runtime, monkeypatch, tmp_path):
    for name, program, told in (
        ("ends", "import sys; sys.exit('no licence')", "the container ended with 1: no licence"),
        (
            "sleeps",
            "import time; print('loading', flush=True); time.sleep(60)",
            "binds no socket within 0.5 s: loading",
        ),
    ):
        (tmp_path / f"{name}.py").write_text(program)
        monkeypatch.setenv("FAKE_DRIVER", str(tmp_path / f"{name}.py"))
        monkeypatch.setattr(containers, "START", 60.0 if name == "ends" else 0.5)
        evaluate(lake, policy="docker:mine:1.0", name=name)
        assert all(error is not None and told in error for error in errors(lake, name)), errors(lake, name)
    assert running(runtime) == []


def test_bad_images_are_sentences(runtime, monkeypatch, tmp_path):
    with pytest.raises(SourceNotFound, match=r"docker:other: Error: No such image: other; start docker"):
        pinned_code("docker:other")
    with pytest.raises(BadParameter, match="expected docker:IMAGE"):
        pinned_code("docker:")
    with pytest.raises(BadParameter, match="expected docker:IMAGE"):
        pinned_code("docker:--privileged")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SourceNotFound, match="podman is not installed"):
        pinned_code("podman:mine:1.0")
