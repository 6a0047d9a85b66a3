"""A hash of what a scenario says, and of nothing that says where it is stored or how it is written."""

from __future__ import annotations

import json
from dataclasses import fields
from typing import Any

import numpy as np
from xxhash import xxh3_64

from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.scenario.description import ScenarioDescription


def content_hash(scenario: ScenarioDescription) -> int:
    """64 bits of XXH3 over the scenario's arrays and description: it tells a change, not a forgery.

    Two scenarios of equal content have equal hashes, whatever their ids, split or lake. A shared map counts by
    its id and window, not by its features.
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
        dict(scenario.extras),
    ]
    seen = xxh3_64(json.dumps(description, sort_keys=True).encode())
    seen.update(scenario.timestamps.data)
    seen.update(scenario.origin.data)
    _add(seen, scenario.tracks)
    _add(seen, scenario.lights)
    if scenario.map is not None and scenario.map_id is None:
        _add(seen, scenario.map)
    return seen.intdigest()


def _add(seen: xxh3_64, part: Any) -> None:
    """Adds the bytes of every array of a part, each behind its name and shape."""
    for field in fields(part):
        value = getattr(part, field.name)
        if isinstance(value, Ragged):
            seen.update(value.offsets.data)
            value = value.values
        seen.update(f"{field.name}{value.shape}".encode())
        seen.update(_text(value) if value.dtype == object else np.ascontiguousarray(value).data)


def _text(strings: Any) -> bytes:
    """Strings with their ends marked, None told from the empty string."""
    listed = strings.tolist()
    if None in listed:
        listed = ["\2" if text is None else text for text in listed]
    return "\0".join(listed).encode()
