"""Minimal loop: an agent with random actions.

python docs/examples/random_agent.py lake busy_train
"""

from __future__ import annotations

import click
import gymnasium

import scenarionet_sim
from scenarionet_sim import Scenarios


def play(env: gymnasium.Env[object, object], episodes: int, seed: int) -> list[tuple[str, float]]:
    """Play episodes with random actions.

    Returns:
        Scenario id and return of each episode.
    """
    env.action_space.seed(seed)
    played = []
    for episode in range(episodes):
        _, info = env.reset(seed=seed if episode == 0 else None)
        total, is_over = 0.0, False
        while not is_over:
            _, reward, terminated, truncated, info = env.step(env.action_space.sample())
            total += float(reward)
            is_over = terminated or truncated
        played.append((str(info["scenario_id"]), total))
    return played


@click.command(help=__doc__)
@click.argument("lake")
@click.argument("database", required=False)
@click.option("--episodes", default=5, show_default=True)
@click.option("--seed", default=0, show_default=True)
def main(lake: str, database: str | None, episodes: int, seed: int) -> None:
    """Print the return of each episode."""
    env = gymnasium.make(f"{scenarionet_sim.__name__}:ScenarioNet-v0", scenarios=Scenarios(lake, database))
    for scenario_id, reward in play(env, episodes, seed):
        click.echo(f"{scenario_id}  {reward:8.2f}")
    env.close()


if __name__ == "__main__":
    main()
