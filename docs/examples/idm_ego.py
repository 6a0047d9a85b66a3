"""Baseline driver over a database: the Intelligent Driver Model on the ego's recorded route, each scenario once.

python -m idm_ego lake busy_val
"""

from __future__ import annotations

from collections import Counter

import click

from scenarionet_sim import EnvConfig, Idm, Replay, ScenarioNetEnv, Scenarios, ego, vehicles

ENDS = ("success", "out_of_road", "timeout")


def evaluate(scenarios: Scenarios) -> Counter[str]:
    """Count how episodes ended, and in how many the ego crashed; other vehicles react to it.

    Args:
        scenarios: Scenarios in sequential order.
    """
    env = ScenarioNetEnv(EnvConfig(scenarios, policies=(Replay(), Idm(objects=vehicles), Idm(objects=ego))))
    ends: Counter[str] = Counter()
    for _ in range(len(env)):
        env.reset()
        is_over = False
        while not is_over:
            _, _, terminated, truncated, info = env.step((0.0, 0.0))
            is_over = terminated or truncated
        ends.update(name for name in ENDS if info[name])
        ends["crashed"] += info["vehicle_crashes"] + info["human_crashes"] + info["object_crashes"] > 0
        ends["episodes"] += 1
    env.close()
    return ends


@click.command(help=__doc__)
@click.argument("lake")
@click.argument("database", required=False)
def main(lake: str, database: str | None) -> None:
    """Print the number of episodes by end."""
    ends = evaluate(Scenarios(lake, database))
    for name in (*ENDS, "crashed"):
        click.echo(f"{name:12} {ends[name]:5} of {ends['episodes']}")


if __name__ == "__main__":
    main()
