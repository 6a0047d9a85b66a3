"""Read traffic lights from ScenarioNet pickles of every version."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.converters.scenarionet.frame import Frame
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.description import Lights, strings
from scenarionet_data.scenario.vocabulary import LightState, Provenance

_LIGHT_STATES: dict[str | None, int] = {None: LightState.ABSENT, **{s.name: s for s in LightState if s}}


def make_lights(states: Mapping[Any, Any], length: int, features: Iterable[Any], frame: Frame, where: str) -> Lights:
    """Build canonical traffic lights.

    Args:
        states: ``description["dynamic_map_states"]``; lights have the ids of their lanes.
        length: T.
        features: Ids of the map features.
        frame: The pickle's frame.
        where: Name of the pickle in errors.

    Raises:
        InvalidScenario: A light does not have T states, or has states unknown to ScenarioNet.
    """
    if not states:
        return Lights.empty(length)
    lanes = [str(lane_id) for lane_id in states]
    in_map = {str(feature_id) for feature_id in features}
    metadata = [light.get("metadata", {}) for light in states.values()]
    ids = [described.get("light_ids", []) for described in metadata]
    codes = [_codes(light, lane, length, where) for lane, light in zip(lanes, states.values(), strict=True)]
    points = np.array([_stop_point(light, frame.ground) for light in states.values()], dtype=np.float64)
    provenance = [Provenance[described.get("provenance", "OBSERVED")] for described in metadata]
    return Lights(
        ids=strings(own[0] if len(own) == 1 else lane for own, lane in zip(ids, lanes, strict=True)),
        lane_ids=strings(lanes),
        stop_point=(points - frame.local_origin).astype(np.float32),
        state=np.array(codes, dtype=np.uint8),
        is_lane_in_map=np.array([lane in in_map for lane in lanes], dtype=np.bool_),
        provenance=np.array(provenance, dtype=np.uint8),
    )


def _codes(light: Mapping[str, Any], lane: str, length: int, where: str) -> list[int]:
    words = list(light["state"]["object_state"])
    path = f"dynamic_map_states[{lane!r}].state.object_state"
    if len(words) != length:
        raise InvalidScenario(where, path, f"expected {length} states, found {len(words)}")
    if all(isinstance(word, int | np.integer) for word in words):
        # MetaDrive of spring 2023: Waymo's codes, which are one less than the lake's.
        seen = np.asarray(light["state"].get("lane", np.ones(length))).reshape(-1).astype(bool)
        is_seen = [known and 0 <= code < 9 for code, known in zip(words, seen, strict=True)]
        return [code + 1 if known else LightState.ABSENT for code, known in zip(words, is_seen, strict=True)]
    unknown = set(words) - set(_LIGHT_STATES)
    if unknown:
        raise InvalidScenario(where, path, f"expected names of LightState or None, found {sorted(unknown)[0]!r}")
    return [_LIGHT_STATES[word] for word in words]


def _stop_point(light: Mapping[str, Any], ground: float) -> Float64:
    """(3,) stop point; NaN if missing."""
    if light.get("metadata", {}).get("is_stop_point_assumed"):
        return np.full(3, np.nan)
    if "stop_point" in light["state"]:  # oldest form: one row per timestep, zero where unknown
        used = np.flatnonzero(np.asarray(light["state"]["lane"]).astype(bool))
        return _point(light["state"]["stop_point"][used[0]] if len(used) else None, ground)
    return _point(light.get("stop_point"), ground)


def _point(point: npt.ArrayLike | None, ground: float) -> Float64:
    """(3,) of a 2D or 3D point; NaN if missing."""
    if point is None or not np.size(point):
        return np.full(3, np.nan)
    return np.append(np.asarray(point, dtype=np.float64).reshape(-1)[:3], ground)[:3]
