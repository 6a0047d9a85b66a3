"""Run by an interpreter with trajdata: measure its samples per second of processor time, and write them as JSON.

usage: python speed.py STATES.parquet CACHE

STATES has recorded states: scenario_id, track_id, timestep, object_type, x, y, z, heading, vx, vy, length, width,
height, ordered by the first three, at 0.1 s. CACHE is an empty folder for trajdata's cache. Nothing of this project is
imported here. Samples have 64 agents, 1 s of history, 8 s of future and no map; what trajdata caches is not timed.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from trajdata import UnifiedDataset
from trajdata.data_structures.agent import AgentMetadata, AgentType, FixedExtent
from trajdata.data_structures.environment import EnvMetadata
from trajdata.data_structures.scene_metadata import Scene, SceneMetadata
from trajdata.dataset_specific.raw_dataset import RawDataset
from trajdata.utils import env_utils

_DT = 0.1
_BATCH, _BATCHES = 16, 8
_TYPES = {
    "VEHICLE": AgentType.VEHICLE,
    "PEDESTRIAN": AgentType.PEDESTRIAN,
    "CYCLIST": AgentType.BICYCLE,
}


class Recorded(RawDataset):
    """The recorded states as a dataset of trajdata; of objects that are observed without gaps."""

    def compute_metadata(self, env_name: str, data_dir: str) -> EnvMetadata:
        """Read the states."""
        states = pd.read_parquet(data_dir)
        places = states.groupby(["scenario_id", "track_id"])["timestep"].agg(["min", "max", "count"])
        whole = places[places["max"] - places["min"] + 1 == places["count"]].index
        states = states.set_index(["scenario_id", "track_id"]).loc[whole].reset_index()
        self.scenes = dict(iter(states.groupby("scenario_id")))
        splits = dict.fromkeys(self.scenes, "all")
        return EnvMetadata(env_name, data_dir, _DT, [("all",)], splits)

    def load_dataset_obj(self, verbose: bool = False) -> None:
        """Keep what is read already."""
        self.dataset_obj = self.scenes

    def _get_matching_scenes_from_obj(self, *_: Any) -> list[SceneMetadata]:
        return [SceneMetadata(self.name, name, _DT, place) for place, name in enumerate(self.scenes)]

    def get_scene(self, scene_info: SceneMetadata) -> Scene:
        """Describe a scene."""
        steps = int(self.scenes[scene_info.name]["timestep"].max()) + 1
        return Scene(self.metadata, scene_info.name, "recorded", "all", steps, scene_info.raw_data_idx, None)

    def get_agent_info(
        self, scene: Scene, cache_path: Path, cache_class: Any
    ) -> tuple[list[AgentMetadata], list[list[AgentMetadata]]]:
        """Write a scene's states to the cache."""
        rows = self.scenes[scene.name].rename(columns={"track_id": "agent_id", "timestep": "scene_ts"})
        agents, presence = [], [[] for _ in range(scene.length_timesteps)]
        for name, track in rows.groupby("agent_id"):
            first, last = int(track["scene_ts"].iloc[0]), int(track["scene_ts"].iloc[-1])
            size = FixedExtent(*(float(track[side].iloc[0]) for side in ("length", "width", "height")))
            kind = _TYPES.get(track["object_type"].iloc[0], AgentType.UNKNOWN)
            agents.append(AgentMetadata(name, kind, first, last, size))
            for step in range(first, last + 1):
                presence[step].append(agents[-1])
        states = rows[["agent_id", "scene_ts", "x", "y", "z", "vx", "vy"]].assign(
            ax=0.0, ay=0.0, heading=rows["heading"]
        )
        cache_class.save_agent_data(states.set_index(["agent_id", "scene_ts"]), cache_path, scene)
        return agents, presence

    def cache_maps(self, *_: Any) -> None:
        """Cache nothing: the samples have no map."""


def main(states: str, cache: str) -> None:
    """Make batches of random samples."""
    env_utils.get_raw_dataset = lambda name, folder: Recorded(name, folder, parallelizable=False, has_maps=False)
    dataset = UnifiedDataset(
        desired_data=["recorded"],
        centric="agent",
        history_sec=(1.0, 1.0),
        future_sec=(8.0, 8.0),
        max_neighbor_num=63,
        agent_interaction_distances=defaultdict(lambda: 100.0),
        require_map_cache=False,
        data_dirs={"recorded": states},
        cache_location=cache,
    )
    collate, rng, times = dataset.get_collate_fn(), np.random.default_rng(0), []
    for _ in range(_BATCHES + 1):
        chosen = rng.integers(0, len(dataset), _BATCH).tolist()
        started = time.process_time()
        collate([dataset[k] for k in chosen])
        times.append((time.process_time() - started) / _BATCH)
    rate = 1 / statistics.median(times[1:])
    sys.stdout.write("RESULT" + json.dumps({"samples": len(dataset), "rate": rate}) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
