"""Learn to drive from a dataset of Minari, without a simulator, by behaviour cloning or TD3+BC.

Source: Fujimoto and Gu, A Minimalist Approach to Offline Reinforcement Learning (2021).

    scenarionet convert pg 0:250 lake
    scenarionet split lake --fractions train=0.8 test=0.2 --name fresh
    scenarionet runs record lake fresh_train --minari fresh/recorded-v0 --observation route
    python docs/examples/offline_learning.py fresh/recorded-v0 lake fresh_test --algorithm td3bc
"""

from __future__ import annotations

import copy

import click
import minari
import numpy as np
import torch
from torch import Tensor, nn

from scenarionet_sim import ScenarioNetEnv, Scenarios

GAMMA, SOFT, NOISE, CLIP, WEIGHT = 0.99, 0.005, 0.2, 0.5, 2.5
"""Of TD3 and TD3+BC: discount, soft update, target noise and its bound, weight of the value beside the cloning."""


def network(inputs: int, outputs: int) -> nn.Sequential:
    """Return a perceptron with two hidden layers."""
    return nn.Sequential(nn.Linear(inputs, 256), nn.ReLU(), nn.Linear(256, 256), nn.ReLU(), nn.Linear(256, outputs))


class Transitions:
    """All transitions of a dataset: ``seen``, ``action``, ``reward``, ``after``, ``goes_on``, as tensors (N, ...)."""

    def __init__(self, dataset_id: str) -> None:
        parts = [
            (e.observations[:-1], e.actions, e.rewards[:, None], e.observations[1:], 1.0 - e.terminations[:, None])
            for e in minari.load_dataset(dataset_id)
        ]
        arrays = (np.concatenate(column).astype(np.float32) for column in zip(*parts, strict=True))
        self.seen, self.action, self.reward, self.after, self.goes_on = map(torch.from_numpy, arrays)
        self.mean, self.deviation = self.seen.mean(0), self.seen.std(0) + 1e-3
        self.seen, self.after = self.scaled(self.seen), self.scaled(self.after)
        self.reward = self.reward / self.reward.abs().mean()

    def scaled(self, observations: Tensor) -> Tensor:
        """Return observations with mean 0 and deviation 1."""
        return (observations - self.mean) / self.deviation

    def draw(self, count: int) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
        """Return random transitions."""
        rows = torch.randint(len(self.seen), (count,))
        return self.seen[rows], self.action[rows], self.reward[rows], self.after[rows], self.goes_on[rows]


def learn(data: Transitions, algorithm: str, steps: int) -> nn.Module:
    """Return an actor; ``bc`` imitates actions, ``td3bc`` also raises the value that two critics give them."""
    width = data.seen.shape[1]
    actor = nn.Sequential(network(width, 2), nn.Tanh())
    critics = nn.ModuleList([network(width + 2, 1) for _ in range(2)])
    late_actor, late_critics = copy.deepcopy(actor), copy.deepcopy(critics)
    act, judge = torch.optim.Adam(actor.parameters(), 3e-4), torch.optim.Adam(critics.parameters(), 3e-4)
    for step in range(steps):
        seen, action, reward, after, goes_on = data.draw(256)
        if algorithm == "td3bc":
            with torch.no_grad():
                noise = (NOISE * torch.randn_like(action)).clamp(-CLIP, CLIP)
                then = torch.cat([after, (late_actor(after) + noise).clamp(-1.0, 1.0)], 1)
                wanted = reward + GAMMA * goes_on * torch.minimum(*(critic(then) for critic in late_critics))
            loss = torch.stack([(critic(torch.cat([seen, action], 1)) - wanted).square().mean() for critic in critics])
            judge.zero_grad()
            loss.sum().backward()
            judge.step()
            if step % 2:
                continue
        decided = actor(seen)
        cost = (decided - action).square().mean()
        if algorithm == "td3bc":
            value = critics[0](torch.cat([seen, decided], 1))
            cost = cost - WEIGHT * value.mean() / value.abs().mean().detach()
        act.zero_grad()
        cost.backward()
        act.step()
        for late, now in ((late_actor, actor), (late_critics, critics)):
            for old, new in zip(late.parameters(), now.parameters(), strict=True):
                old.data.lerp_(new.data, SOFT)
    return actor


def drive(actor: nn.Module, data: Transitions, env: ScenarioNetEnv) -> tuple[float, float]:
    """Return mean return and the share of scenarios whose end is reached."""
    returns, arrived = [], []
    for scenario_id in env.scenario_ids:
        seen, _ = env.reset(seed=0, options={"scenario_id": scenario_id})
        total, is_over = 0.0, False
        while not is_over:
            with torch.no_grad():
                action = actor(data.scaled(torch.from_numpy(seen)))
            seen, reward, ended, late, info = env.step(action.numpy())
            total, is_over = total + reward, ended or late
        returns.append(total)
        arrived.append(bool(info["success"]))
    return float(np.mean(returns)), float(np.mean(arrived))


@click.command(help=__doc__)
@click.argument("dataset")
@click.argument("lake")
@click.argument("database")
@click.option("--algorithm", type=click.Choice(["bc", "td3bc"]), default="bc", show_default=True)
@click.option("--observation", type=click.Choice(["paper", "route"]), default="route", show_default=True)
@click.option("--steps", default=10_000, show_default=True, help="Steps of gradient descent.")
@click.option("--seed", default=0, show_default=True)
def main(dataset: str, lake: str, database: str, algorithm: str, observation: str, steps: int, seed: int) -> None:
    """Learn from a dataset, and drive through the scenarios of a database."""
    torch.manual_seed(seed)
    torch.set_num_threads(1)
    data = Transitions(dataset)
    actor = learn(data, algorithm, steps)
    env = ScenarioNetEnv(scenarios=Scenarios(lake, database), sensors=observation)
    mean, share = drive(actor, data, env)
    click.echo(
        f"{algorithm}, seed {seed}: {len(data.seen):,} transitions, {steps:,} steps; on {len(env)} scenarios: "
        f"return {mean:.1f}, {share:.0%} reach their end"
    )


if __name__ == "__main__":
    main()
