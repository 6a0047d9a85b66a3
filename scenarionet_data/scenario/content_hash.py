"""Hash of a scenario's content, independent of where and how it is stored."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import Any

import numpy as np
from xxhash import xxh3_64, xxh3_128

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription


def content_hash(scenario: ScenarioDescription) -> int:
    """64-bit XXH3 hash of the scenario's arrays and description; detects changes, not forgery.

    Scenarios of equal content have equal hashes, regardless of id, split and lake; content is equal if tracks, lights
    and features are in the same order, too. A shared map contributes its id and window, not its features;
    ``extras["pickle"]``, which tells how a pickle was written, does not contribute.
    """
    source = scenario.source
    description = [
        scenario.dt,
        scenario.current_timestep,
        scenario.ego_id,
        scenario.has_z,
        [source.scenario_id, source.log, source.city, source.date, source.crs],
        [scenario.map_id, scenario.map_crop],
        scenario.objects_of_interest,
        scenario.tracks_to_predict,
        {key: value for key, value in scenario.extras.items() if key not in _NOT_HASHED},
    ]
    digest = xxh3_64(json.dumps(description, sort_keys=True).encode())
    digest.update(scenario.timestamps.data)
    digest.update(scenario.origin.data)
    _add(digest, scenario.tracks)
    _add(digest, scenario.lights)
    if scenario.map is not None and scenario.map_id is None:
        _add(digest, scenario.map)
    return digest.intdigest()


def map_hash(features: MapFeatures) -> int:
    """128-bit XXH3 hash of a map's features, in their order."""
    digest = xxh3_128()
    _add(digest, features)
    return digest.intdigest()


_NOT_HASHED = ("pickle",)
_HASHED_NAMES = {"feature_type": "types"}
"""Names of renamed fields in hashes, which must not change."""
_HASHED_IF_SET = ("is_interpolated",)
"""Later fields: hashes of scenarios that do not use them must not change."""


def _add(digest: xxh3_64 | xxh3_128, part: Any) -> None:
    """Hash every array of a part, preceded by its name and shape."""
    for field in fields(part):
        value = getattr(part, field.name)
        if field.name in _HASHED_IF_SET and not value.any():
            continue
        if isinstance(value, Ragged):
            digest.update(value.offsets.data)
            value = value.values
        name = _HASHED_NAMES.get(field.name, field.name)
        digest.update(f"{name}{value.shape}".encode())
        if value.dtype == object:
            listed = value.tolist()
            if None in listed:  # it differs from the empty string
                listed = ["\2" if text is None else text for text in listed]
            digest.update("\0".join(listed).encode())
        else:
            digest.update(np.ascontiguousarray(value).data)
