"""Long runs: memory stays flat, and every observation is that of a world loaded alone."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from scenarionet_sim.environments.config import VectorConfig
from scenarionet_sim.environments.flat import FlatEnv
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.replay import Replay

NAMES = ("wall", "crowd", "empty", "walker")
STEPS, SLOTS = 1_000_000, 16


def action(timestep):
    return np.stack([0.05 * np.sin(timestep / 5.0), np.full(len(timestep), 0.6)], axis=1)


def alone(config):
    """Observations and rewards of one episode of the only scenario, in a new environment."""
    env, seen, rewards = FlatEnv(1, config), [], [0.0]
    seen.append(env.reset(seed=0)[0][0].copy())
    infos: list[dict] = []
    while not infos:
        _, reward, _, _, infos = env.step(action(np.array([len(seen) - 1])))
        seen.append((env.last_observations if infos else env.observations)[0].copy())
        rewards.append(float(reward[0]))
    env.close()
    return infos[0]["scenario_id"], (np.array(seen), np.array(rewards, np.float32))


@pytest.mark.long
def test_a_million_steps_with_ten_thousand_resets(only):
    policies = (Replay(), Idm(), External())
    expected = dict(alone(VectorConfig(only(name), policies=policies, prefetch=0)) for name in NAMES)
    env = FlatEnv(SLOTS, VectorConfig(only(*NAMES), policies=policies, cache_size=2), threads=2)
    env.reset(seed=0)
    timestep, played, resets, sizes = np.zeros(SLOTS, np.int64), [[] for _ in range(SLOTS)], 0, []
    for step in range(STEPS // SLOTS):
        before = env.observations.copy()
        _, rewards, _, _, infos = env.step(action(timestep))
        for slot in range(SLOTS):
            played[slot].append((before[slot], rewards[slot]))
        timestep += 1
        for info in infos:
            slot, (seen, earned) = info["slot"], expected[info["scenario_id"]]
            np.testing.assert_array_equal([row for row, _ in played[slot]], seen[:-1])
            np.testing.assert_array_equal([reward for _, reward in played[slot]], earned[1:])
            np.testing.assert_array_equal(env.last_observations[slot], seen[-1])
            played[slot], timestep[slot], resets = [], 0, resets + 1
        if step % 500 == 0:
            pages = int(Path("/proc/self/statm").read_text().split()[1])
            sizes.append(pages * os.sysconf("SC_PAGE_SIZE") / 1e6)
    env.close()
    assert resets >= 10_000
    growth = max(sizes[len(sizes) // 2 :]) - max(sizes[: len(sizes) // 2])
    assert growth < 5.0, f"{growth:.1f} MB more in the second half of {resets} resets"
