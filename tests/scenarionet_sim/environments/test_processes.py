"""Environments in worker processes, forked or spawned, for any imports of the parent."""

from __future__ import annotations

import subprocess
import sys

import pytest

from tests.fixtures.waiting import HANGS_AFTER

pytestmark = pytest.mark.integration

PARENT = """
import sys
from functools import partial

import numpy as np
from gymnasium.vector import AsyncVectorEnv

from scenarionet_data import Lake
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.config import EnvConfig
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.scenarios.selection import Scenarios

if __name__ == "__main__":
    lake, context, backend = sys.argv[1:]
    physics = Bullet() if backend == "bullet" else Kinematic()
    config = EnvConfig(Scenarios(lake, where="ego_distance > 5"), backend=physics)
    assert Lake(lake).sql("SELECT scenario_id FROM metadata ORDER BY 1").height == 6  # starts the threads of polars
    here = ScenarioNetEnv(config)  # starts threads of DuckDB, Arrow and its own
    expected = here.reset(seed=5)[0]
    envs = AsyncVectorEnv([partial(ScenarioNetEnv, config)] * 2, context=None if context == "default" else context)
    observed, _ = envs.reset(seed=[5, 5])
    np.testing.assert_array_equal(observed, [expected, expected])
    for _ in range(5):
        _, rewards, *_ = envs.step(np.full((2, 2), 0.5, np.float32))
        assert rewards[0] == rewards[1] == here.step((0.5, 0.5))[1] != 0.0
    envs.close()
    print("stepped")
"""


def run(*command: object) -> str:
    """Run a program and return its output, with a time limit."""
    done = subprocess.run(
        [sys.executable, *map(str, command)], capture_output=True, text=True, timeout=HANGS_AFTER, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.long
@pytest.mark.parametrize("backend", ["kinematic", "bullet"])
@pytest.mark.parametrize("context", ["default", "fork", "spawn", "forkserver"])
def test_worker_processes(context, backend, drives, tmp_path):
    (tmp_path / "parent.py").write_text(PARENT)
    assert run(tmp_path / "parent.py", drives, context, backend) == "stepped\n"


def test_environment_imports_no_fork_unsafe_library(drives):
    program = f"""
import sys
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.scenarios.selection import Scenarios
env = ScenarioNetEnv(scenarios=Scenarios({str(drives)!r}, where="num_objects > 0", order="weighted"))
env.reset(seed=0)
env.step((0.0, 0.5))
print("polars" in sys.modules)
"""
    assert run("-c", program) == "False\n"
