"""Run by MetaDrive's own interpreter: measure its steps per second of processor time and write them as JSON.

usage: python speed.py DATABASE...

The ego drives straight on with 120 lidar and 12 boundary rays, and about 40 agents do on MetaDrive's roundabout; steps
and resets are timed apart. Nothing of this project is imported here.
"""

from __future__ import annotations

import json
import logging
import sys
import time

_STEPS = 45  # per scenario: about as many as an ego lasts that drives straight on

_AGENTS = 40


def measure(databases: list[str], is_reactive: bool) -> dict[str, float]:
    """Return the number of steps, and the processor time [s] of steps and of resets."""
    from metadrive.envs.scenario_env import ScenarioEnv
    from metadrive.scenario.utils import read_dataset_summary

    count, stepping, resetting = 0, 0.0, 0.0
    for database in databases:
        _, names, _ = read_dataset_summary(database)
        config = {
            "num_scenarios": len(names),
            "data_directory": database,
            "reactive_traffic": is_reactive,
            "no_static_vehicles": False,
            "horizon": 1000,
            "log_level": logging.CRITICAL,
            "vehicle_config": {
                "lidar": {"num_lasers": 120, "distance": 50, "num_others": 0},
                "side_detector": {"num_lasers": 12, "distance": 50},
                "lane_line_detector": {"num_lasers": 0},
            },
        }
        env = ScenarioEnv(config)
        for index in range(len(names)):
            started = time.process_time()
            env.reset(seed=index)
            resetting += time.process_time() - started
            started = time.process_time()
            for _ in range(_STEPS):
                _, _, terminated, truncated, _ = env.step([0.0, 0.0])
                count += 1
                if terminated or truncated:
                    break
            stepping += time.process_time() - started
        env.close()
    return {"steps": count, "stepping": stepping, "resetting": resetting}


def measure_agents() -> dict[str, float]:
    """Return the number of agent-steps, of agents and the processor time [s] of the steps."""
    from metadrive.envs.marl_envs import MultiAgentRoundaboutEnv

    env = MultiAgentRoundaboutEnv({"num_agents": _AGENTS, "log_level": logging.CRITICAL})
    env.reset(seed=0)
    count, stepping = 0, 0.0
    for _ in range(_STEPS):
        agents = list(env.agents)
        started = time.process_time()
        env.step({agent: [0.0, 0.0] for agent in agents})
        stepping += time.process_time() - started
        count += len(agents)
    env.close()
    return {"steps": count, "agents": count / _STEPS, "stepping": stepping}


if __name__ == "__main__":
    found = {name: measure(sys.argv[1:], name == "reactive") for name in ("replay", "reactive")}
    found["several agents"] = measure_agents()
    sys.stdout.write(f"RESULT{json.dumps(found)}\n")
