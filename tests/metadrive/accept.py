"""Run by MetaDrive's own interpreter: open a database as MetaDrive does and print the findings as JSON.

usage: python accept.py check|replay|load DATABASE

Nothing of this project is imported here.
"""

from __future__ import annotations

import json
import logging
import pickle
import sys
from pathlib import Path
from typing import Any

import numpy as np


def check(database: str) -> dict[str, Any]:
    """Per file: MetaDrive's sanity check, its summaries, and the numbers of its filters."""
    from metadrive.scenario.scenario_description import ScenarioDescription as Description
    from metadrive.scenario.utils import read_dataset_summary, read_scenario_data

    summary, names, mapping = read_dataset_summary(database)
    found = {}
    for name in names:
        path = Path(database) / mapping[name] / name
        with path.open("rb") as file:
            plain = pickle.load(file)
        Description.sanity_check(plain, check_self_type=True)
        Description.sanity_check(plain, check_self_type=True, valid_check=_is_seen(plain))
        ours = plain["metadata"]
        theirs = Description.update_summaries(Description(pickle.loads(pickle.dumps(plain))))["metadata"]
        moved = read_scenario_data(path, centralize=True)
        ego = moved.get_sdc_track()["state"]["position"][0]
        found[name] = {
            "same_objects": _is_same(ours["object_summary"], theirs["object_summary"]),
            "same_numbers": _is_same(ours["number_summary"], theirs["number_summary"]),
            "same_listed": _is_same(summary[name]["object_summary"], theirs["object_summary"]),
            "num_objects": Description.num_object(Description(plain)),
            "sdc_moving_dist": Description.sdc_moving_dist(Description(plain)),
            "ego_at": [float(ego[0]), float(ego[1])],
        }
    return {"names": names, "found": found}


def _is_seen(plain: dict[str, Any]) -> bool:
    """MetaDrive's stricter check refuses tracks that are never valid, which the lake keeps."""
    return all(track["state"]["valid"].any() for track in plain["tracks"].values())


def _is_same(first: Any, second: Any) -> bool:
    if isinstance(first, dict):
        return set(first) == set(second) and all(_is_same(first[key], second[key]) for key in first)
    if isinstance(first, float):
        return bool(np.isclose(first, second, rtol=1e-4, atol=1e-4))
    return set(first) == set(second) if isinstance(first, set | tuple) else first == second


def replay(database: str) -> dict[str, Any]:
    """Per file: drive the ego along its recording until the episode ends."""
    from metadrive.envs.scenario_env import ScenarioEnv
    from metadrive.policy.replay_policy import ReplayEgoCarPolicy
    from metadrive.scenario.utils import read_dataset_summary

    _, names, _ = read_dataset_summary(database)
    config = {
        "agent_policy": ReplayEgoCarPolicy,
        "num_scenarios": len(names),
        "data_directory": database,
        "horizon": 1000,
        "no_static_vehicles": False,
        "log_level": logging.CRITICAL,
    }
    env = ScenarioEnv(config)
    found = {}
    for index, name in enumerate(names):
        env.reset(seed=index)
        spawned = env.engine.global_config["agent_configs"]["default_agent"]
        ego_size = [float(spawned[key]) for key in ("length", "width", "height")]
        num_lanes = len(env.engine.current_map.road_network.graph)
        num_lights = len(env.engine.light_manager.spawned_objects)
        info: dict[str, Any] = {}
        for _ in range(1000):
            _, _, terminated, truncated, info = env.step([0, 0])
            if terminated or truncated:
                break
        found[name] = {
            "arrive_dest": bool(info["arrive_dest"]),
            "route_completion": float(info["route_completion"]),
            "ego_size": ego_size,
            "num_lanes": num_lanes,
            "num_lights": num_lights,
        }
    env.close()
    return {"names": names, "found": found}


def load(database: str) -> dict[str, Any]:
    """Print the installed NumPy version, and whether every array is intact and writable."""
    totals, writable = {}, True
    for path in sorted(Path(database).glob("*.pkl")):
        with path.open("rb") as file:
            arrays = list(_arrays(pickle.load(file)))
        totals[path.name] = float(sum(np.nansum(array.astype(np.float64)) for array in arrays))
        writable &= all(array.flags.writeable for array in arrays)
    return {"numpy": np.__version__, "totals": totals, "writable": writable}


def _arrays(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        yield value
    for inner in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from _arrays(inner)


if __name__ == "__main__":
    task, folder = sys.argv[1:]
    result = {"check": check, "replay": replay, "load": load}[task](folder)
    sys.stdout.write(f"RESULT {json.dumps(result)}\n")
