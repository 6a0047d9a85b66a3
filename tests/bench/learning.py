"""Learning, end to end with updates: steps per second of one core's processor time, and where the time goes."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from scenarionet_data import Lake
from scenarionet_data.conversion import convert
from tests.bench.measure import Figure

_SCENARIOS, _ROUNDS = "0:64", 12


def figures(recordings: Path | None) -> Iterator[Figure]:
    """The paper's observation, two layers of 128 units, generated scenarios; needs torch."""
    del recordings
    import torch

    from scenarionet_sim.learning.config import make_learner_config
    from scenarionet_sim.learning.training import plan_training

    torch.set_num_threads(1)
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder) / "lake"
        convert("pg", _SCENARIOS, root)
        lake = Lake(root)
        for algorithm, traffic, wanted, agents in (
            ("ppo", "replay", ">= 5000", "one agent, 64 worlds, replayed traffic"),
            ("ppo", "idm", ">= 5000", "one agent, 64 worlds, reacting traffic"),
            ("ippo", "replay", ">= 15000", "every vehicle, 32 worlds"),
            ("copo", "replay", "", "every vehicle, 32 worlds"),
        ):
            config = make_learner_config(algorithm, "small", {"traffic": traffic})
            yield from _learning(plan_training(lake, None, algorithm, config=config), wanted, agents)


def _learning(training, wanted: str, agents: str) -> Iterator[Figure]:
    from scenarionet_sim.environments.flat import FlatEnv
    from scenarionet_sim.learning.learners import make_learner

    config = training.config
    env = FlatEnv(config.worlds, training.environment(), config.seats, 0, threads=1)
    env.reset()
    learner = make_learner(training.algorithm, env, config, 0, None)
    loading = time.process_time()
    while env.coverage < 1.0:  # every scenario is loaded once
        learner.round()
    loading = time.process_time() - loading
    learner.clock.seconds.clear()
    began, done = time.process_time(), 0
    for _ in range(_ROUNDS):
        done += learner.round()[0]
    spent = time.process_time() - began
    env.close()
    title = f"learn: {training.algorithm}, {agents}"
    yield Figure(title, done / spent, "steps/s", wanted)
    yield Figure(f"{title}: first rounds, until all 64 scenarios are loaded", loading, "s")
    total = sum(learner.clock.seconds.values())
    for activity, seconds in learner.clock.seconds.items():
        yield Figure(f"{title}: {activity}", 100.0 * seconds / total, "% of wall time")
