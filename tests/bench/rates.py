"""Steps per second of the simulator, episode ends counted, as JSON: run by ``tests/bench/beside.py`` in own processes.

usage: python rates.py LAKE THREADS, with the sources of this or of an earlier version on PYTHONPATH; only names that
both have are imported.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.config import BOUNDARY, PAPER_OBSERVATION, VectorConfig
from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.environments.vector import ScenarioNetVectorEnv
from scenarionet_sim.policies import External, Idm, Replay
from scenarionet_sim.scenarios import Scenarios

_WORLDS, _STEPS = 64, 240
_WARM_UP, _WARM_UP_OF_ONE = 90, 1_500  # until episodes end at different times, and until every world was loaded
_TRAFFIC: dict[str, tuple[Any, ...]] = {"replay": (Replay(), External()), "IDM": (Replay(), Idm(), External())}
_SENSORS = PAPER_OBSERVATION + BOUNDARY


def rates(lake: Path, threads: int) -> dict[str, float]:
    """Steps per second of processor time, with several threads of wall time; agent-steps for several agents."""
    clock = time.process_time if threads == 1 else time.perf_counter
    known = {"threads": threads} if "threads" in {field.name for field in fields(VectorConfig)} else {}
    found = {}
    for name, policies in _TRAFFIC.items():
        envs = ScenarioNetVectorEnv(_WORLDS, scenarios=Scenarios(lake), policies=policies, sensors=_SENSORS, **known)
        envs.reset(seed=0)
        actions = np.zeros((_WORLDS, 2))
        found[name] = _WORLDS * _rate(lambda e=envs, a=actions: e.step(a), _STEPS, clock)
        envs.close()
    if threads > 1:
        return found
    env = ScenarioNetEnv(scenarios=Scenarios(lake), backend=Kinematic(), sensors=_SENSORS)
    env.reset(seed=0)
    found["one world"] = _rate(lambda: _step_or_reset(env), 10 * _STEPS, clock, _WARM_UP_OF_ONE)
    env.close()
    return found | _agent_steps(lake, clock)


def _rate(step: Callable[[], Any], count: int, clock: Callable[[], float], warm_up: int = _WARM_UP) -> float:
    for _ in range(warm_up):
        step()
    started = clock()
    for _ in range(count):
        step()
    return count / (clock() - started)


def _step_or_reset(env: ScenarioNetEnv) -> None:
    _, _, terminated, truncated, _ = env.step(np.zeros(2))
    if terminated or truncated:
        env.reset()


def _agent_steps(lake: Path, clock: Callable[[], float]) -> dict[str, float]:
    """Agent-steps per second in the scenario with about 35 agents, and their number."""
    env = ScenarioNetParallelEnv(scenarios=Scenarios(lake))
    found = []
    for _ in range(14):
        _, infos = env.reset()
        found.append((len(env.agents), next(iter(infos.values()))["scenario_id"] if infos else ""))
    agents, scenario_id = min(found, key=lambda pair: abs(pair[0] - 35))
    count, seconds = 0, 0.0
    for episode in range(6):
        env.reset(options={"scenario_id": scenario_id})
        started = clock()
        for _ in range(40):
            count += len(env.agents) if episode else 0
            env.step(dict.fromkeys(env.agents, (0.0, 0.0)))
        seconds += clock() - started if episode else 0.0
    env.close()
    return {"agents": float(agents), "several agents": count / seconds}


if __name__ == "__main__":
    sys.stdout.write(f"RESULT{json.dumps(rates(Path(sys.argv[1]), int(sys.argv[2])))}\n")
