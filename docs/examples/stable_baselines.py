"""Stable-Baselines3 on the batch engine: PPO, or TD3 with the two settings without which it learns nothing here.

    python docs/examples/stable_baselines.py lake busy_train --steps 100000

TD3's defaults are for one environment. With W worlds ``gradient_steps=1`` is one update per W transitions: of 60,000
steps in 64 worlds 936, where the paper has 60,000. And ``action_noise=None`` adds no noise to the policy's actions, so
that it repeats its first mistakes. ``gradient_steps=-1`` makes an update for every transition.
"""

from __future__ import annotations

from typing import Any

import click
import numpy as np

from scenarionet_sim.environments.config import VectorConfig
from scenarionet_sim.environments.stable_baselines import StableBaselinesEnv
from scenarionet_sim.policies.external import External
from scenarionet_sim.policies.idm import Idm
from scenarionet_sim.policies.replay import Replay
from scenarionet_sim.scenarios.selection import Scenarios

WORLDS = 64


def make_model(algorithm: str, env: StableBaselinesEnv, seed: int) -> Any:
    """Return a model of Stable-Baselines3 for worlds with one agent each."""
    from stable_baselines3 import PPO, TD3
    from stable_baselines3.common.noise import NormalActionNoise, VectorizedActionNoise

    if algorithm == "ppo":
        return PPO(
            "MlpPolicy", env, n_steps=64, batch_size=16 * env.num_envs, learning_rate=1e-3, seed=seed, device="cpu"
        )
    noise = VectorizedActionNoise(NormalActionNoise(np.zeros(2), np.full(2, 0.3)), env.num_envs)
    return TD3(
        "MlpPolicy", env, action_noise=noise, gradient_steps=-1, learning_starts=5_000, buffer_size=100_000,
        policy_kwargs={"net_arch": [128, 128]}, seed=seed, device="cpu",
    )  # fmt: skip


def success_rate(model: Any, env: StableBaselinesEnv, episodes: int) -> float:
    """Return the share of episodes in which the model, without noise, reaches the destination."""
    seen, found = env.reset(), list[bool]()
    while len(found) < episodes:  # each step depends on the one before
        actions, _ = model.predict(seen, deterministic=True)
        seen, _, _, infos = env.step(actions)
        found += [info["is_success"] for info in infos if "is_success" in info]
    return float(np.mean(found))


@click.command(help=__doc__)
@click.argument("lake")
@click.argument("database", required=False)
@click.option("--algorithm", type=click.Choice(["ppo", "td3"]), default="ppo", show_default=True)
@click.option("--steps", default=100_000, show_default=True, help="Steps of a world to learn for.")
@click.option("--seed", default=0, show_default=True)
def main(lake: str, database: str | None, algorithm: str, steps: int, seed: int) -> None:
    """Learn, and print how often the driver arrives."""
    import torch

    torch.set_num_threads(1)
    config = VectorConfig(Scenarios(lake, database, order="random"), policies=(Replay(), Idm(), External()))
    env = StableBaselinesEnv(WORLDS, config, seed=seed, threads=1)
    model = make_model(algorithm, env, seed).learn(steps)
    click.echo(f"{steps:,} steps of {algorithm}: success {success_rate(model, env, 2 * WORLDS):.0%}")
    env.close()


if __name__ == "__main__":
    main()
