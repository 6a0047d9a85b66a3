"""Steps per second of the simulator, episode ends counted, as JSON: run by ``tests/bench/beside.py`` in own processes.

usage: python rates.py LAKE THREADS processor|wall, with the sources of this or of an earlier version on PYTHONPATH;
only names that both have are imported.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.config import BOUNDARY, PAPER_OBSERVATION, VectorConfig
from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.environments.vector import ScenarioNetVectorEnv
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.scenarios.selection import Scenarios

_WORLDS, _STEPS, _WINDOW = 64, 240, 8
_WARM_UP, _WARM_UP_OF_ONE = 90, 1_500  # until episodes end at different times, and until every world was loaded
_TRAFFIC: dict[str, tuple[Any, ...]] = {"replay": (Replay(), External()), "IDM": (Replay(), Idm(), External())}
_SENSORS = PAPER_OBSERVATION + BOUNDARY


def rates(lake: Path) -> dict[str, float]:
    """Steps per second of processor time by one thread; agent-steps for several agents."""
    clock = time.process_time
    found = {}
    for name, policies in _TRAFFIC.items():
        with closing(_many_worlds(lake, policies, threads=1)) as envs:
            found[name] = _WORLDS * _rate(_stepping(envs), _STEPS, clock)
    env = ScenarioNetEnv(scenarios=Scenarios(lake), backend=Kinematic(), sensors=_SENSORS)
    env.reset(seed=0)
    found["one world"] = _rate(lambda: _step_or_reset(env), 10 * _STEPS, clock, _WARM_UP_OF_ONE)
    env.close()
    return found | _agent_steps(lake, clock)


def wall_rates(lake: Path, threads: int) -> dict[str, float]:
    """Steps per second of wall time: medians of short windows, as other programs interrupt some."""
    found = {}
    for name, policies in _TRAFFIC.items():
        with closing(_many_worlds(lake, policies, threads)) as envs:
            step = _stepping(envs)
            for _ in range(_WARM_UP):
                step()
            windows = [_rate(step, _WINDOW, time.perf_counter, warm_up=0) for _ in range(_STEPS // _WINDOW)]
        found[name] = _WORLDS * statistics.median(windows)
    return found


def _many_worlds(lake: Path, policies: tuple[Any, ...], threads: int) -> ScenarioNetVectorEnv:
    known: dict[str, Any] = {"threads": threads} if "threads" in {field.name for field in fields(VectorConfig)} else {}
    envs = ScenarioNetVectorEnv(_WORLDS, scenarios=Scenarios(lake), policies=policies, sensors=_SENSORS, **known)
    envs.reset(seed=0)
    return envs


def _stepping(envs: ScenarioNetVectorEnv) -> Callable[[], Any]:
    actions = np.zeros((_WORLDS, 2))
    return lambda: envs.step(actions)


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
    lake, threads, clock = Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
    sys.stdout.write(f"RESULT{json.dumps(wall_rates(lake, threads) if clock == 'wall' else rates(lake))}\n")
