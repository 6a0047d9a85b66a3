"""The simulator: steps per second of CPU of every environment, resets, the bird's-eye view, memory, compile time.

On nuScenes 0061 and 1100 and a Waymo scenario where recordings are at hand, else on generated ones.
"""

from __future__ import annotations

import json
import os
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data import ScenarioLoader
from scenarionet_data.conversion import convert
from scenarionet_sim.backends.base import Backend
from scenarionet_sim.backends.bullet import Bullet
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.config import BOUNDARY, PAPER_OBSERVATION
from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.environments.vector import ScenarioNetVectorEnv
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.sensors.bird_view import BirdView
from scenarionet_sim.sensors.lidar import Lidar
from scenarionet_sim.sensors.line_rays import BoundaryDetector
from scenarionet_sim.sensors.navigation import Navigation
from scenarionet_sim.sensors.state import EgoState
from scenarionet_sim.simulation.simulation import Simulation
from scenarionet_sim.task.task import Termination
from scenarionet_sim.worlds.world import World
from tests.bench import beside, many_worlds
from tests.bench.measure import Figure, in_fresh_process

FULL = (Lidar(rays=240), BoundaryDetector(rays=12), EgoState(), Navigation())
"""Twice the paper's lidar, and all else that it observes."""

_ENDLESS = Termination(off_route=1e9, completion=1e9, short_route=0.01, extra_steps=10**6)
"""So that who drives badly is measured all the same."""

_WORLDS = 64
TRAFFIC: dict[str, tuple[Policy, ...]] = {
    "replay": (Replay(), External()),
    "IDM": (Replay(), Idm(), External()),
}
_REFERENCE = "MetaDrive 78-113 on scene 0061"
_FIRST_USE = """
import json, sys, time
import numpy
from scenarionet_sim.environments.multi_agent import ScenarioNetParallelEnv
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.base import Policy
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.environments.config import BOUNDARY, PAPER_OBSERVATION
started = time.process_time()
env = ScenarioNetEnv(
    scenarios=Scenarios(sys.argv[1]), backend=Kinematic(), policies=(Replay(), Idm(), External()),
    sensors=PAPER_OBSERVATION + BOUNDARY, prefetch=0,
)
env.reset(seed=0)
env.step([0.0, 0.0])
print(json.dumps(time.process_time() - started))
"""

_MEMORY = """
import json, os, sys
from pathlib import Path
import numpy as np
from scenarionet_sim.backends.kinematic import Kinematic
from scenarionet_sim.environments.single_agent import ScenarioNetEnv
from scenarionet_sim.scenarios.selection import Scenarios
from scenarionet_sim.sensors.state import EgoState
scenarios = Scenarios(sys.argv[1], order="random")
env = ScenarioNetEnv(scenarios=scenarios, backend=Kinematic(), sensors=(EgoState(),), cache_size=4)
sizes = []
for count in range(5_000):
    env.reset(seed=0 if count == 0 else None)
    if count >= 1_000 and count % 50 == 0:
        sizes.append(int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6)
env.close()
print(json.dumps(20 * float(np.polyfit(np.arange(len(sizes)), sizes, 1)[0])))
"""


def figures(recordings: Path | None) -> Iterator[Figure]:
    """Benchmarks of the simulator in CPU time; medians."""
    with tempfile.TemporaryDirectory() as folder:
        lake = Path(folder) / "lake"
        names = _recorded(lake, recordings) if recordings else _generated(lake)
        yield from _first_use(lake, Path(folder) / "cache")
        for name, scenario_id in names.items():
            yield from _single(lake, name, scenario_id)
        yield from _resets(lake)
        yield from _vector(lake, recordings)
        yield from many_worlds.figures(lake, recordings)
        yield from _several_agents(lake, recordings is not None)
        yield from _bird_view(lake, names)
        yield from _memory(lake)


def _recorded(lake: Path, recordings: Path) -> dict[str, str]:
    convert("scenarionet", str(recordings / "scenarionet"), lake)
    ids = ScenarioLoader(lake).scenario_ids
    names = ("scene-0061", "scene-1100", "waymo_8a346109094cd5aa")
    return {name: next(found for found in ids if found.endswith(name)) for name in names}


def _generated(lake: Path) -> dict[str, str]:
    convert("pg", "0:14", lake)
    return {f"generated {k}": found for k, found in enumerate(ScenarioLoader(lake).scenario_ids[:3])}


def _first_use(lake: Path, cache: Path) -> Iterator[Figure]:
    """Time from an empty kernel cache to the first step, in a separate process."""
    before = os.environ.get("NUMBA_CACHE_DIR")
    os.environ["NUMBA_CACHE_DIR"] = str(cache)
    try:
        first, second = (json.loads(in_fresh_process(_FIRST_USE, str(lake))) for _ in range(2))
    finally:
        os.environ.pop("NUMBA_CACHE_DIR")
        if before is not None:
            os.environ["NUMBA_CACHE_DIR"] = before
    yield Figure("sim: first reset and step, nothing compiled yet", first, "s", "<= 10")
    yield Figure("sim: the same in another process, compiled code on disk", second, "s")


def _single(lake: Path, name: str, scenario_id: str) -> Iterator[Figure]:
    for backend, wanted in ((Kinematic(), ">= 15000"), (Bullet(), ">= 5000")):
        kind = type(backend).__name__.lower()
        goal = wanted if name == "scene-0061" else ""
        yield Figure(
            f"sim: {name}, {kind}, full observation", _rate(lake, scenario_id, backend), "steps/s", goal, _REFERENCE
        )
    world = World.from_scenario(ScenarioLoader(lake, [scenario_id])[0])
    for traffic, policies in TRAFFIC.items():
        yield Figure(f"sim: {name}, the loop alone, {traffic} traffic", _loop_rate([world], policies), "steps/s")


def _loop_rate(worlds: list[World], policies: tuple[Policy, ...]) -> float:
    simulation, actions = Simulation(worlds, policies), np.zeros((len(worlds), 2))

    def reset() -> None:
        for slot in range(len(worlds)):
            simulation.reset(slot)

    return len(worlds) / _seconds_a_step(lambda: simulation.step(actions), reset, 90)


def _rate(lake: Path, scenario_id: str, backend: Backend) -> float:
    env = ScenarioNetEnv(
        scenarios=Scenarios(lake, [scenario_id]), backend=backend, sensors=FULL, termination=_ENDLESS, prefetch=0
    )
    action = np.zeros(2, np.float32)
    env.reset(seed=0)
    seconds = _seconds_a_step(lambda: env.step(action), env.reset, 90)
    env.close()
    return 1 / seconds


def _seconds_a_step(step: Callable[[], Any], reset: Callable[[], Any], steps: int, episodes: int = 15) -> float:
    """Median over episodes of the CPU time of a step, without resets."""
    found = []
    for _ in range(episodes + 2):
        reset()
        started = time.process_time()
        for _ in range(steps):
            step()
        found.append((time.process_time() - started) / steps)
    return statistics.median(found[2:])


def _resets(lake: Path) -> Iterator[Figure]:
    """Resets that read the lake, and resets from worlds in memory."""
    for name, cache_size, wanted in (("read from the lake", 1, "<= 20"), ("from memory", 32, "<= 2")):
        env = ScenarioNetEnv(scenarios=Scenarios(lake), backend=Kinematic(), prefetch=0, cache_size=cache_size)
        found: dict[str, list[float]] = {}
        for _ in range(14 * 4):
            started = time.process_time()
            _, info = env.reset()
            found.setdefault(info["scenario_id"], []).append(1e3 * (time.process_time() - started))
        env.close()
        later = [statistics.median(times[1:]) for times in found.values()]
        yield Figure(f"sim: reset {name}", statistics.median(later), "ms", wanted)
        yield Figure(f"sim: reset {name}, the slowest scenario", max(later), "ms", wanted)


def _vector(lake: Path, recordings: Path | None) -> Iterator[Figure]:
    """World-steps per second of one core, episode ends counted, beside others and beside the loop without ends."""
    for traffic in TRAFFIC:
        rates = {has_ends: _vector_rate(lake, TRAFFIC[traffic], has_ends)[0] for has_ends in (True, False)}
        objects = _vector_rate(lake, TRAFFIC[traffic], has_ends=False)[1]
        name = f"sim: {_WORLDS} worlds of {objects:.0f} objects, {traffic} traffic"
        yield Figure(f"{name}, episode ends counted", rates[True], "world-steps/s")
        yield Figure(f"{name}, without ends", rates[False], "world-steps/s")
        yield Figure(f"{name}, all steps against those without ends", _share(lake, TRAFFIC[traffic]), "", ">= 0.95")
    if recordings:
        yield from beside.figures(lake, recordings, objects)
    yield Figure("sim: the next world into a slot, already in the pool", _slot_change(lake), "us", "<= 50")
    worlds = [World.from_scenario(scenario) for scenario in ScenarioLoader(lake)]
    worlds = [worlds[k % len(worlds)] for k in range(_WORLDS)]
    for traffic, policies in TRAFFIC.items():
        rate = _loop_rate(worlds, policies)
        yield Figure(f"sim: {_WORLDS} worlds, the loop alone, {traffic} traffic", rate, "world-steps/s")


def _slot_change(lake: Path) -> float:
    """Microseconds to begin an episode of another world, per slot of a batch."""
    worlds = [World.from_scenario(scenario) for scenario in ScenarioLoader(lake)]
    worlds = [worlds[k % len(worlds)] for k in range(_WORLDS)]
    simulation, slots = Simulation(worlds), range(_WORLDS)
    turn = iter(range(10**9))
    return (
        1e6
        / _WORLDS
        * _seconds_a_step(
            lambda: (simulation.begin(slots, np.roll(worlds, next(turn)).tolist()), simulation.observe_begun()),
            lambda: None,
            10,
        )
    )


def _vector_rate(lake: Path, policies: tuple[Policy, ...], has_ends: bool) -> tuple[float, float]:
    """World-steps per second, and objects per world, on one core."""
    envs = ScenarioNetVectorEnv(
        _WORLDS, scenarios=Scenarios(lake), policies=policies, sensors=PAPER_OBSERVATION + BOUNDARY,
        termination=Termination() if has_ends else _ENDLESS, threads=1,
    )  # fmt: skip
    actions = np.zeros((_WORLDS, 2))
    envs.reset(seed=0)
    for _ in range(60 if has_ends else 0):  # until episodes end at different times
        envs.step(actions)
    reset = (lambda: None) if has_ends else envs.reset
    seconds = _seconds_a_step(lambda: envs.step(actions), reset, 60, episodes=7)
    objects = envs.core.simulation.state.present.sum() / _WORLDS
    envs.close()
    return _WORLDS / seconds, objects


def _share(lake: Path, policies: tuple[Policy, ...], steps: int = 1_000) -> float:
    """Rate of all steps as a share of that of the steps in which no episode begins, in one series of steps.

    Worlds that never end would be others: they play the beginnings of all logs, with other objects on other roads.
    """
    envs = ScenarioNetVectorEnv(
        _WORLDS, scenarios=Scenarios(lake), policies=policies, sensors=PAPER_OBSERVATION + BOUNDARY, threads=1
    )
    actions, begins = np.zeros((_WORLDS, 2)), False
    envs.reset(seed=0)
    times: dict[bool, list[float]] = {True: [], False: []}
    for number in range(steps + 60):
        started = time.process_time()
        _, _, terminated, truncated, _ = envs.step(actions)
        if number >= 60:
            times[begins].append(time.process_time() - started)
        begins = bool((terminated | truncated).any())
    envs.close()
    plain, beginning = (statistics.median(times[begins]) for begins in (False, True))
    return plain / (plain + len(times[True]) / steps * (beginning - plain))


def _several_agents(lake: Path, is_recorded: bool) -> Iterator[Figure]:
    """The scenario with about 40 moving vehicles, each an agent."""
    env = ScenarioNetParallelEnv(scenarios=Scenarios(lake), prefetch=0)
    found = []
    for _ in range(14):
        _, infos = env.reset()
        found.append((len(env.agents), next(iter(infos.values()))["scenario_id"] if infos else ""))
    count, scenario_id = min(found, key=lambda pair: abs(pair[0] - 40))
    rates = []
    for _ in range(5):
        env.reset(options={"scenario_id": scenario_id})
        number, started = 0, time.process_time()
        for _ in range(40):
            number += len(env.agents)
            env.step(dict.fromkeys(env.agents, (0.0, 0.0)))
        rates.append(number / (time.process_time() - started))
    env.close()
    wanted = ">= 20000" if is_recorded else ""
    yield Figure(f"sim: {count} agents", statistics.median(rates), "agent-steps/s", wanted, "MetaDrive 1,410")


def _bird_view(lake: Path, names: dict[str, str]) -> Iterator[Figure]:
    sensor, rng = BirdView(), np.random.default_rng(0)
    for name, scenario_id in names.items():
        simulation = Simulation([World.from_scenario(ScenarioLoader(lake, [scenario_id])[0])])
        out = sensor.empty(1)
        seconds = _seconds_a_step(
            lambda s=simulation, o=out: sensor.observe(s.batch, s.state, s.agents, rng, o), lambda: None, 20
        )
        shape = "x".join(map(str, sensor.shape))
        yield Figure(f"sim: bird's view {shape}, {name}", 1 / seconds, "pictures/s", ">= 1000")


def _memory(lake: Path) -> Iterator[Figure]:
    """Growth of a process over 5,000 resets, after the first 1,000."""
    slope = json.loads(in_fresh_process(_MEMORY, str(lake)))
    yield Figure("sim: growth of memory a 1,000 resets, after the first 1,000", slope, "MB", "<= 1")
