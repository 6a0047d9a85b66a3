"""Run by MetaDrive's own interpreter: write scenarios of MetaDrive's generator as pickles, a database of its own.

usage: python generate.py FOLDER COUNT

With the settings of ScenarioNet's converter `pg`: two blocks, IDM, a density of 0.15, accidents in every second map.
Nothing of this project is imported here.
"""

from __future__ import annotations

import logging
import pickle
import sys
from pathlib import Path


def main(folder: Path, count: int) -> None:
    """Write ``sd_pg_*.pkl`` and the two files of a database."""
    from metadrive.envs.metadrive_env import MetaDriveEnv
    from metadrive.policy.idm_policy import IDMPolicy

    settings = {
        "start_seed": 0,
        "num_scenarios": count,
        "traffic_density": 0.15,
        "agent_policy": IDMPolicy,
        "accident_prob": 0.5,
        "crash_vehicle_done": False,
        "crash_object_done": False,
        "store_map": False,
        "map": 2,
        "log_level": logging.CRITICAL,
    }
    env = MetaDriveEnv(settings)
    summary, mapping = {}, {}
    folder.mkdir(parents=True, exist_ok=True)
    for seed in range(count):
        scenarios, _ = env.export_scenarios(
            lambda _: [0, 1], scenario_index=[seed], max_episode_length=1000, suppress_warning=True
        )
        name = f"sd_pg_metadrive_{seed}.pkl"
        summary[name], mapping[name] = scenarios[seed]["metadata"], ""
        (folder / name).write_bytes(pickle.dumps(scenarios[seed]))
    (folder / "dataset_summary.pkl").write_bytes(pickle.dumps(summary))
    (folder / "dataset_mapping.pkl").write_bytes(pickle.dumps(mapping))
    env.close()


main(Path(sys.argv[1]), int(sys.argv[2]))
