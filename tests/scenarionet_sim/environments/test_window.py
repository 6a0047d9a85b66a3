"""The window of ``render_mode="human"``: shows the vehicles on a virtual display; an error without a display."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import numpy as np
import pytest

from tests.fixtures.waiting import HANGS_AFTER

PROGRAM = """
import sys
from pathlib import Path
from matplotlib import pyplot
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.{module} import {kind}
from scenarionet_sim.scenarios.selection import Scenarios

env = {kind}(scenarios=Scenarios(sys.argv[1], ["made/v1/crowd"]), backend=Kinematic(), render_mode="human")
screens = []
for step in range(12):
    if step == 0:
        env.reset(seed=0)
    else:
        env.step((0.0, 0.5) if "{kind}" == "ScenarioNetEnv" else dict.fromkeys(env.agents, (0.0, 0.5)))
    if step in (1, 11):
        Path(sys.argv[2], str(step)).write_bytes(Path(sys.argv[2], "Xvfb_screen0").read_bytes())
(number,) = pyplot.get_fignums()
pyplot.close(number)  # as its user may do
env.step((0.0, 0.5) if "{kind}" == "ScenarioNetEnv" else dict.fromkeys(env.agents, (0.0, 0.5)))
env.close()
print(pyplot.get_fignums())
"""
CHECK = """
import sys, warnings
import gymnasium
from gymnasium.utils.env_checker import check_env
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.scenarios.selection import Scenarios

warnings.simplefilter("error")
made = gymnasium.make("scenarionet_sim:ScenarioNet-v0", scenarios=Scenarios(sys.argv[1]), backend=Kinematic())
check_env(made.unwrapped)  # makes it again in every render mode
print(made.metadata["render_modes"])
"""
FACES = [("single_agent", "ScenarioNetEnv"), ("multi_agent", "ScenarioNetParallelEnv")]


@pytest.fixture
def display(tmp_path):
    """A virtual display whose screen is a file of ``tmp_path``."""
    program = shutil.which("Xvfb")
    if program is None:
        pytest.skip("no virtual display: install Xvfb")
    screen = ["-screen", "0", "900x900x24", "-nolisten", "tcp", "-fbdir", str(tmp_path)]
    read, write = os.pipe()
    server = subprocess.Popen([program, "-displayfd", str(write), *screen], pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as answer:
        yield f":{answer.readline().strip()}"
    server.terminate()
    server.wait(timeout=HANGS_AFTER)


def pixels(dump: bytes) -> np.ndarray:
    """Colours on a screen (n,) from an X window dump, whose header gives its own size and that of the colour map."""
    header, colours = np.frombuffer(dump, ">u4", 1)[0], np.frombuffer(dump, ">u4", 20)[19]
    return np.frombuffer(dump[header + 12 * colours :], np.uint32)


def drive(lake, folder, module, kind, **environment):
    return run(PROGRAM.format(module=module, kind=kind), lake, folder, **environment)


def run(program, *words, **environment):
    command = [sys.executable, "-c", program, *map(str, words)]
    return subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=HANGS_AFTER, env=os.environ | environment
    )


@pytest.mark.long
@pytest.mark.parametrize(("module", "kind"), FACES)
def test_window_shows_the_vehicles(module, kind, drives, display, tmp_path):
    done = drive(drives, tmp_path, module, kind, DISPLAY=display, MPLBACKEND="")
    assert (done.returncode, done.stdout) == (0, "[]\n"), done.stderr
    first, last = (pixels((tmp_path / step).read_bytes()) for step in ("1", "11"))
    assert len(np.unique(last)) > 20
    assert 0.001 < (first != last).mean() < 0.9


@pytest.mark.long
def test_gymnasium_checker_passes_with_every_render_mode(drives, display):
    done = run(CHECK, drives, DISPLAY=display, MPLBACKEND="")
    assert (done.returncode, done.stdout) == (0, "['rgb_array', 'human']\n"), done.stderr


@pytest.mark.long
@pytest.mark.parametrize("backend", ["", "tkagg"])
def test_window_without_a_display_is_an_error(backend, drives, tmp_path):
    done = drive(drives, tmp_path, *FACES[0], DISPLAY="", WAYLAND_DISPLAY="", MPLBACKEND=backend)
    assert "BadParameter: a window needs a display" in done.stderr
    assert "render_mode='rgb_array'" in done.stderr
