"""What UniTraj's own code is given: its configuration, and scenarios in its form."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from scenarionet_data import ScenarioDescription
from scenarionet_data.scenario import vocabulary
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType


def config(past: int, future: int, agents: int, roads: int, points: int) -> dict[str, Any]:
    """Configuration of UniTraj's datasets: numbers of timesteps, agents, polylines and points."""
    return {
        "past_len": past, "future_len": future, "max_num_agents": agents, "max_num_roads": roads,
        "max_points_per_lane": points, "map_range": 100, "center_offset_of_map": [30.0, 0.0],
        "object_type": ["VEHICLE", "PEDESTRIAN", "CYCLIST"], "masked_attributes": [], "only_train_on_ego": False,
        "line_type": ["lane", "stop_sign", "road_edge", "road_line", "crosswalk", "speed_bump"],
        "trajectory_sample_interval": 1, "manually_split_lane": False, "remove_outliers": False,
        "method": {"model_name": "autobot"},
    }  # fmt: skip


def as_dictionary(scenario: ScenarioDescription, targets: Iterable[str]) -> dict[str, Any]:
    """A scenario in the form that UniTraj reads, from the loaded arrays: exactly the input of our layout."""
    tracks, features = scenario.tracks, scenario.map
    names, kinds = vocabulary.names(ObjectType), vocabulary.names(MapFeatureType)
    states = {
        track_id: {
            "type": names[tracks.object_type[row]],
            "state": {
                "position": tracks.position[row].astype(np.float64),
                **{name: tracks.size[row, :, axis] for axis, name in enumerate(("length", "width", "height"))},
                "heading": tracks.heading[row],
                "velocity": tracks.velocity[row],
                "valid": tracks.valid[row],
            },
        }
        for row, track_id in enumerate(tracks.ids)
    }
    map_features = {}
    for row, name in enumerate(features.ids):
        line, outline = features.polyline[row].astype(np.float64), features.polygon[row].astype(np.float64)
        feature = {"type": kinds[features.feature_type[row]], "lane": [], "position": line[0] if len(line) else None}
        feature |= {"polyline": line} if len(line) else {}
        map_features[name] = feature | ({"polygon": outline} if len(outline) else {})
    metadata = {
        "ts": scenario.timestamps, "sdc_id": scenario.ego_id, "scenario_id": scenario.id, "dataset": "made",
        "tracks_to_predict": dict.fromkeys(targets),
    }  # fmt: skip
    return {"tracks": states, "map_features": map_features, "dynamic_map_states": {}, "metadata": metadata}
