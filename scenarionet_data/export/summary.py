"""Compute the statistics in a pickle's metadata that ScenarioNet's filters read.

Same definitions as ``ScenarioDescription.update_summaries`` of MetaDrive 0.4.3, computed from the written dictionary,
so that merging or copying a database with ScenarioNet does not change them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from typing import Any

import numpy as np

_ROAD_LINES = ("ROAD_LINE_", "UNKNOWN_LINE")
_MOVING_DISTANCE = 1.0
_MAX_HEIGHT_DIFF = 10.0


def summarize(description: Mapping[str, Any]) -> dict[str, Any]:
    """Return ``object_summary`` and ``number_summary`` of a description."""
    objects = {track_id: summarize_object(track_id, track) for track_id, track in description["tracks"].items()}
    types = [str(track["type"]) for track in description["tracks"].values()]
    moving = [str(o["type"]) for o in objects.values() if o["moving_distance"] > _MOVING_DISTANCE]
    lights = description["dynamic_map_states"]
    shown = Counter(state for light in lights.values() for state in light["state"]["object_state"] if state is not None)
    numbers = {
        "num_objects": len(types),
        "object_types": set(types),
        "num_objects_each_type": dict(Counter(types)),
        "num_moving_objects": len(moving),
        "num_moving_objects_each_type": dict(Counter(moving)),
        "num_traffic_lights": len(lights),
        "num_traffic_light_types": set(shown),
        "num_traffic_light_each_step": dict(shown),
        "num_map_features": len(description["map_features"]),
        "map_height_diff": map_height_diff(description["map_features"]),
    }
    return {"object_summary": objects, "number_summary": numbers}


def summarize_object(track_id: str, track: Mapping[str, Any]) -> dict[str, Any]:
    """Return length and distance of one track.

    ``moving_distance`` [m] is the sum of steps between consecutive valid timesteps, including gaps;
    ``continuous_valid_length`` is the number of timesteps of the first unbroken run.
    """
    valid = np.asarray(track["state"]["valid"]).astype(bool).reshape(-1)
    position = track["state"]["position"]
    steps = np.diff(position[valid][:, :2], axis=0)
    rest = valid[int(np.argmax(valid)) :] if valid.any() else valid[:0]
    return {
        "type": track["type"],
        "object_id": track_id,
        "track_length": len(position),
        "moving_distance": float(np.sqrt((steps * steps).sum(axis=1)).sum(dtype=np.float64)),
        "valid_length": int(np.count_nonzero(valid)),
        "continuous_valid_length": int(np.argmin(rest)) if not rest.all() else len(rest),
    }


def map_height_diff(map_features: Mapping[str, Any]) -> float:
    """Return the height difference of road lines [m]; -inf if none has a z.

    As in MetaDrive, it stops at the first line that exceeds 10 m: a flag for overpasses, not a measurement.
    """
    highest, lowest = -math.inf, math.inf
    for feature in map_features.values():
        if not feature["type"].startswith(_ROAD_LINES):
            continue
        polyline = np.asarray(feature["polyline"])
        if polyline.shape[-1] == 3:
            highest = max(highest, float(polyline[:, 2].max()))
            lowest = min(lowest, float(polyline[:, 2].min()))
        if highest - lowest > _MAX_HEIGHT_DIFF:
            break
    return highest - lowest
