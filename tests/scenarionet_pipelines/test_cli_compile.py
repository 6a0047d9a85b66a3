"""``scenarionet maintain compile``: later processes do not compile anything."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys

import pytest

from scenarionet_pipelines.cli.address_space import NEEDED

pytestmark = pytest.mark.integration

USE = """
import sys
from scenarionet_data import ScenarioLoader, convert
from scenarionet_data.compiled.announcing import compilations
from scenarionet_sim import Idm, External, Replay, ScenarioNetEnv, Scenarios

convert("pg", "8:10", sys.argv[1])
ScenarioLoader(sys.argv[1])[0]
for policies in ((Replay(), External()), (Replay(), Idm(), External())):
    env = ScenarioNetEnv(scenarios=Scenarios(sys.argv[1]), policies=policies)
    env.reset(seed=0)
    env.step([0.0, 0.5])
print([done.name for done in compilations if not done.from_cache], len(compilations) > 10)
"""


@pytest.mark.long
@pytest.mark.parametrize("is_fresh", [False, True])
def test_nothing_is_compiled_after_compile(tmp_path, is_fresh):
    pytest.importorskip("gymnasium")
    environment = dict(os.environ)
    if is_fresh:
        environment |= {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_CPU_NAME": "generic"}  # none that is shipped
        environment["NUMBA_CPU_FEATURES"] = ""
    run = {"env": environment, "capture_output": True, "text": True, "check": True}
    made = subprocess.run(
        [sys.executable, "-m", "scenarionet_pipelines.cli", "maintain", "compile", "--json"],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (NEEDED, NEEDED)),
        **run,
    )
    report = json.loads(made.stdout)
    assert sum(task["compiled"] + task["cached"] for task in report["tasks"]) > 20
    assert report["folders"]
    if is_fresh:
        assert all(folder.startswith(str(tmp_path)) for folder in report["folders"])
        assert {task["task"]: task["cached"] for task in report["tasks"]}["convert"] == 0
    used = subprocess.run([sys.executable, "-c", USE, str(tmp_path / "lake")], **run)
    assert used.stdout.split() == ["[]", "True"]
