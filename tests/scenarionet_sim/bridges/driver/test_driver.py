"""Drivers in other processes: what they get, what they answer, and what goes wrong."""

from __future__ import annotations

import math
import os
import re
import shutil
import socket
import struct
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import driver_process
import numpy as np
import polars as pl
import pytest

from scenarionet_data import Lake
from scenarionet_data.errors import BadParameter
from scenarionet_sim.bridges.driver import planner, wire
from scenarionet_sim.drivers.by_name import resolve_drivers
from scenarionet_sim.evaluation.evaluation import evaluate
from scenarionet_sim.planners.base import Action, Planner
from scenarionet_sim.planners.view import View
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.worlds.world import World
from tests.fixtures.drives import Other, make_drive
from tests.fixtures.lakes import write_lake

DRIVES = [make_drive(f"d{k}", speed=6.0 + k, num_steps=31, others=(Other(22.0 + 4 * k, vx=1.0),)) for k in range(4)]
EXAMPLES = Path(driver_process.__file__).parent
FOLDER = Path(wire.__file__).parent


class Here(Planner):
    """The example's driver in this process."""

    def __init__(self) -> None:
        self.route: list[tuple[float, float]] = []

    def act(self, view: View) -> Action:
        if not self.route:
            self.route = [tuple(each) for each in np.concatenate([view.route.centreline, view.route.beyond]).tolist()]
        moment = wire.message("Moment")()
        wire.fill(moment, view, 1, is_first=True)
        return driver_process.drive(self.route, view.ego, driver_process.is_blocked(view.ego, moment.objects))


@contextmanager
def driver(answer: Callable[[socket.socket], None]) -> Iterator[str]:
    """A driver in a thread, which ``answer`` serves from its first connection on; its policy."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def work() -> None:
            for _ in range(20):
                try:
                    peer, _ = server.accept()
                except OSError:
                    return
                with peer:
                    try:
                        answer(peer)
                    except OSError:
                        return

        threading.Thread(target=work, daemon=True).start()
        yield f"driver:{server.getsockname()[1]}"


@pytest.fixture
def lake(tmp_path: Path) -> Iterator[Path]:
    write_lake(tmp_path / "lake", DRIVES)
    yield tmp_path / "lake"
    planner.connection_to.cache_clear()


def rows(lake: Path, run: str) -> list[dict[str, Any]]:
    found = Lake(lake).sql("SELECT * EXCLUDE run FROM results WHERE run = $run ORDER BY scenario_id", {"run": run})
    return [dict(each) for each in found.to_dicts()]


def states(lake: Path, run: str) -> pl.DataFrame:
    return Lake(lake).sql("SELECT * EXCLUDE run FROM rollouts WHERE run = $run ORDER BY ALL", {"run": run})


def test_a_moment_has_what_the_view_has():
    world = World.from_scenario(make_drive("seen", others=(Other(30.0, 3.5, vx=6.0),), red=True))
    view = View(world, Simulation([world], (Replay(),)).state, 0, world.ego)
    moment = wire.message("Moment")()
    wire.fill(moment, view, 7, is_first=True)
    assert (moment.episode, moment.time, moment.begin.scenario, moment.begin.dt) == (7, 0.0, "made/v1/seen", 0.1)
    ego, others = moment.ego, moment.objects
    assert (ego.x, ego.y, ego.speed, ego.length) == pytest.approx((0.0, 0.0, 10.0, 4.6))
    assert (list(others.x), list(others.y), list(others.velocity_x)) == ([30.0], [3.5], [6.0])
    assert [list(others.id), list(others.type)] == [[1], [world.object_type[1]]]
    assert list(moment.begin.stop_arc) == pytest.approx([20.0]) and list(moment.stop_color) == [3]
    assert moment.begin.route_x[-1] == pytest.approx(40.0) and moment.begin.beyond_x[-1] > 200.0
    wire.fill(later := wire.message("Moment")(), view, 7, is_first=False)
    assert not later.HasField("begin") and later.ego == ego


def serve(peer: socket.socket, spoil: Callable[[bytes, int], bytes | None] = lambda content, _: content) -> None:
    """Drive as the example does; ``spoil`` gets each answer and how many came before."""
    moments, commands, routes = wire.message("Moments"), wire.message("Commands"), {}
    for count in range(5000):
        try:
            asked = moments.FromString(wire.receive(peer))
        except Exception:
            return
        answer = commands()
        for moment in asked.moments:
            if moment.HasField("begin"):
                begin = moment.begin
                routes[moment.episode] = list(zip(begin.route_x, begin.route_y, strict=True)) + list(
                    zip(begin.beyond_x, begin.beyond_y, strict=True)
                )
            blocked = driver_process.is_blocked(moment.ego, moment.objects)
            action = driver_process.drive(routes[moment.episode], moment.ego, blocked)
            command = answer.commands.add(episode=moment.episode)
            command.action.steering, command.action.throttle = action
        content = answer.SerializeToString()
        spoiled = spoil(struct.pack("<I", len(content)) + content, count)
        if spoiled is None:
            return
        peer.sendall(spoiled)


@pytest.mark.integration
def test_in_lockstep_it_drives_to_the_bit_as_in_this_process(lake: Path):
    evaluate(lake, policy=f"{__name__}:Here", name="here")
    with driver(serve) as policy:
        evaluate(lake, policy=policy, name="there")
    assert rows(lake, "there") == rows(lake, "here") and not any(row["error"] for row in rows(lake, "there"))
    assert states(lake, "there").equals(states(lake, "here"))


def commands_of(content: bytes) -> Any:
    return wire.message("Commands").FromString(content[4:])


def with_nan(content: bytes, _: int) -> bytes:
    answer = commands_of(content)
    answer.commands[0].action.throttle = math.nan
    return struct.pack("<I", answer.ByteSize()) + answer.SerializeToString()


def with_error(content: bytes, _: int) -> bytes:
    answer = commands_of(content)
    answer.commands[0].error = "my map is empty"
    return struct.pack("<I", answer.ByteSize()) + answer.SerializeToString()


def with_short_plan(content: bytes, _: int) -> bytes:
    answer = commands_of(content)
    answer.commands[0].plan.x.extend([1.0, 2.0])
    return struct.pack("<I", answer.ByteSize()) + answer.SerializeToString()


def after(count: int, what: Callable[[bytes], bytes | None]) -> Callable[[bytes, int], bytes | None]:
    return lambda content, number: content if number < count else what(content)


FAULTS = {
    "dies": (after(5, lambda _: None), "hung up after 0 of 4 bytes"),
    "sends half a message": (after(5, lambda content: content[:9]), "did not answer in time"),
    "sends no message": (after(5, lambda _: b"\x03\x00\x00\x00\xff\xff\xff"), "3 bytes of it are no Commands"),
    "floods": (after(5, lambda _: b"\xff" * 1000), "4,294,967,295 bytes; expected at most 16,777,216"),
    "forgets one": (after(5, lambda _: b"\x00" * 4), "no command for an episode"),
    "hangs": (after(5, lambda _: b""), "did not answer in time"),
    "sends NaN": (with_nan, "expected finite numbers"),
    "says an error": (with_error, "the driver says: my map is empty"),
    "sends an uneven plan": (with_short_plan, r"\[0, 2\] values of x, y, heading and time"),
}


@pytest.mark.integration
@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_sentences_of_the_scenario_and_the_run_goes_on(
    lake: Path, fault: str, monkeypatch: pytest.MonkeyPatch
):
    spoil, sentence = FAULTS[fault]
    monkeypatch.setattr(planner, "LIMIT", 0.3)
    started = time.monotonic()
    with driver(lambda peer: serve(peer, spoil)) as policy:
        report = evaluate(lake, policy=policy, name="run")
    assert len(report.broken) == len(DRIVES) == report.scenarios and time.monotonic() - started < 20.0
    for row in rows(lake, "run"):
        assert re.search(sentence, row["error"]), row["error"]


@pytest.mark.integration
def test_without_a_driver_the_first_scenario_waits_and_the_others_do_not(lake: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(planner, "LIMIT", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    started = time.monotonic()
    report = evaluate(lake, policy=f"driver:{port}", name="run")
    assert [error.startswith("SourceError: driver at") for _, error in report.broken] == [True] * len(DRIVES)
    assert "Connection refused; is it running?" in report.broken[0][1]
    assert time.monotonic() - started < 0.5 + len(DRIVES) * 0.4 + 2.0


@pytest.mark.parametrize("policy", ["driver:", "driver:port", "driver:70000", "driver:host:"])
def test_addresses_without_a_port_are_refused(policy: str):
    with pytest.raises(BadParameter, match="expected driver:PORT, driver:HOST:PORT or driver:/PATH"):
        resolve_drivers(policy)


def built(folder: Path) -> list[str]:
    """The example in C++, built with Debian's protobuf, which PROTOBUF may have unpacked elsewhere."""
    root = Path(os.environ.get("PROTOBUF", "/"))
    protoc, library = root / "usr/bin/protoc", root / "usr/lib/x86_64-linux-gnu"
    if not (shutil.which("g++") and protoc.exists() and (library / "libprotobuf.a").exists()):
        pytest.skip(
            "needs g++, and protoc with libprotobuf of Debian: apt-get install protobuf-compiler libprotobuf-dev"
        )
    environment = os.environ | {"LD_LIBRARY_PATH": str(library)}
    subprocess.run([protoc, f"-I{FOLDER}", f"--cpp_out={folder}", "driver.proto"], check=True, env=environment)
    descriptors = [protoc, f"-I{FOLDER}", f"--descriptor_set_out={folder}/binpb", "driver.proto"]
    subprocess.run(descriptors, check=True, env=environment)
    assert (folder / "binpb").read_bytes() == (FOLDER / "driver.binpb").read_bytes(), "make driver.binpb again"
    sources = [EXAMPLES / "driver_process.cpp", folder / "driver.pb.cc", library / "libprotobuf.a"]
    includes = [f"-I{folder}", f"-I{root}/usr/include"]
    subprocess.run(["g++", "-std=c++17", *includes, *sources, "-o", folder / "driver", "-pthread"], check=True)
    return [str(folder / "driver")]


@pytest.mark.integration
@pytest.mark.parametrize("language", ["python", "c++"])
def test_processes_in_other_languages_drive_as_this_one(lake: Path, tmp_path: Path, language: str):
    words = built(tmp_path) if language == "c++" else [sys.executable, str(EXAMPLES / "driver_process.py")]
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    evaluate(lake, policy=f"{__name__}:Here", name="here")
    process = subprocess.Popen([*words, str(port), str(FOLDER / "driver.binpb")])
    try:
        evaluate(lake, policy=f"driver:{port}", name="there")
    finally:
        process.kill()
        process.wait()
    assert not any(row["error"] for row in rows(lake, "there"))
    if language == "python":
        assert states(lake, "there").equals(states(lake, "here"))
    for column in ("average_displacement", "route_completion", "mean_speed", "max_jerk"):
        there, here = ([row[column] for row in rows(lake, run)] for run in ("there", "here"))
        np.testing.assert_allclose(there, here, rtol=1e-4)


@pytest.mark.integration
def test_a_process_that_ends_hangs_up() -> None:
    """Python warns of sockets that are open when it ends."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        made = f"planner.connection_to('driver:{server.getsockname()[1]}')"
        code = f"from scenarionet_sim.bridges.driver import planner; made = {made}; made._socket = made._open(9.0)"
        done = subprocess.run([sys.executable, "-W", "always", "-c", code], capture_output=True, text=True, check=True)
    assert "ResourceWarning: unclosed <socket" not in done.stderr
