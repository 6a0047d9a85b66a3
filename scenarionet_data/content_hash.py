"""A hash of what a scenario says, and of nothing that says where it is stored or how it is written."""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields
from typing import Any

import numpy as np

from scenarionet_data.ragged import Ragged
from scenarionet_data.scenario import ScenarioDescription


def content_hash(scenario: ScenarioDescription) -> int:
    """The first 64 bits of a SHA-256 over the scenario's arrays and description.

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
    pieces: list[Any] = [json.dumps(description, sort_keys=True).encode(), scenario.timestamps, scenario.origin]
    _collect(pieces, scenario.tracks)
    _collect(pieces, scenario.lights)
    if scenario.map is not None and scenario.map_id is None:
        _collect(pieces, scenario.map)
    return int.from_bytes(hashlib.sha256(b"".join(pieces)).digest()[:8], "big")


def _collect(pieces: list[Any], part: Any) -> None:
    """Adds the bytes of every array of a part, each behind its name and shape."""
    for field in fields(part):
        value = getattr(part, field.name)
        if isinstance(value, Ragged):
            pieces.append(value.offsets)
            value = value.values
        pieces.append(f"{field.name}{value.shape}".encode())
        pieces.append(_text(value) if value.dtype == object else np.ascontiguousarray(value))


def _text(strings: Any) -> bytes:
    """Strings with their ends marked, None told from the empty string."""
    listed = strings.tolist()
    if None in listed:
        listed = ["\2" if text is None else text for text in listed]
    return "\0".join(listed).encode()
