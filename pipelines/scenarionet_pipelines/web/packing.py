"""Binary format of a scenario for the browser: a JSON header and plain arrays that JavaScript reads without parsing.

Layout: length of the header (uint32, little-endian), header (UTF-8, padded with spaces to a multiple of 4), arrays,
each aligned to 4 bytes. ``header["arrays"]`` gives the dtype, shape and offset after the header of each array.
``static/scene.js`` reads the format.
"""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Array, UInt8
from scenarionet_data.arrays.geometry import median_sizes
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.scenario.description import Lights, MapFeatures, ScenarioDescription
from scenarionet_data.scenario.lane_polygons import lane_outlines
from scenarionet_data.scenario.stop_points import light_places
from scenarionet_data.scenario.vocabulary import (
    LIGHT_COLORS,
    LightColor,
    LightState,
    MapFeatureType,
    ObjectType,
    is_lane,
    is_road_edge,
    is_road_line,
    names,
)

_ALIGNMENT = 4
_KINDS = ("lane", "line", "edge", "crosswalk", "stop", "area")
_TYPES = names(ObjectType)
_FEATURES = names(MapFeatureType)
_STATES = names(LightState)


def pack(scenario: ScenarioDescription) -> bytes:
    """Pack the trajectories, traffic lights and map of a scenario.

    Positions are float32 [m] in the scenario frame, headings are in radians. Arrays of objects and lights have the
    shape (N, T, ...).
    """
    features, tracks = scenario.map, scenario.tracks
    predicted = {track_id for track_id, _ in scenario.tracks_to_predict}
    interesting = set(scenario.objects_of_interest)
    arrays: dict[str, Array] = {
        "time": scenario.timestamps.astype(np.float32),
        "position": tracks.position[..., :2],
        "heading": tracks.heading,
        "velocity": tracks.velocity,
        "size": median_sizes(tracks.size, tracks.valid),
        "valid": tracks.valid.astype(np.uint8),
    }
    arrays |= _lights(scenario.lights, features)
    objects = [
        {
            "id": str(track_id),
            "type": _TYPES[code],
            "source": None if source is None else str(source),
            "interesting": track_id in interesting,
            "predicted": track_id in predicted,
        }
        for track_id, code, source in zip(tracks.ids, tracks.object_type, tracks.source_type, strict=True)
    ]
    described: list[dict[str, Any]] = []
    if features is not None:
        kinds = _kinds(features.feature_type)
        for name, code, kind, speed in zip(
            features.ids, features.feature_type, kinds, features.speed_limit, strict=True
        ):
            limit = None if np.isnan(speed) else round(float(speed), 2)  # [m/s]
            described.append({"id": str(name), "type": _FEATURES[code] or str(code), "kind": kind, "limit": limit})
        arrays |= _points("line", features.polyline) | _points("area", _outlines(features))
    header: dict[str, Any] = {
        "id": scenario.id,
        "dt": scenario.dt,
        "now": scenario.current_timestep,
        "ego": scenario.ego_index,
        "objects": objects,
        "lights": [str(name) for name in scenario.lights.ids],
        "lightStates": list(_STATES),
        "lightColors": [LightColor(color).name for color in LIGHT_COLORS],
        "features": described,
    }
    return layout(header, arrays)


def _lights(lights: Lights, features: MapFeatures | None) -> dict[str, Array]:
    """Stop points and states of traffic lights."""
    stop = lights.stop_point[:, :2]
    if features is not None:
        rows = np.flatnonzero(is_lane(features.feature_type))
        stop = light_places(lights, features.ids[rows], features.polyline.take(rows))[1]
    return {"lightPosition": stop, "lightState": lights.state}


def _kinds(types: UInt8) -> list[str]:
    """The drawing style of each feature."""
    chosen = np.select(
        [
            is_lane(types),
            is_road_line(types),
            is_road_edge(types),
            types == MapFeatureType.CROSSWALK,
            np.isin(types, (MapFeatureType.STOP_LINE, MapFeatureType.STOP_SIGN)),
        ],
        range(len(_KINDS) - 1),
        len(_KINDS) - 1,
    )
    return [_KINDS[number] for number in chosen]


def _outlines(features: MapFeatures) -> Ragged:
    """Recorded outlines of all features; lanes without one are outlined by their width, as in pictures."""
    rows = np.flatnonzero(is_lane(features.feature_type))
    lanes, recorded = lane_outlines(features, rows), features.polygon
    both = Ragged.from_flat(
        np.concatenate([recorded.lengths, lanes.lengths]), np.concatenate([recorded.values[:, :2], lanes.values])
    )
    source = np.arange(len(recorded))
    source[rows] = len(recorded) + np.arange(len(lanes))
    return both.take(source)


def _points(name: str, lists: Ragged) -> dict[str, Array]:
    return {f"{name}Points": lists.values[:, :2].astype(np.float32), f"{name}Offsets": lists.offsets}


def layout(header: dict[str, Any], arrays: dict[str, Array]) -> bytes:
    """Lay out a header and arrays in the format of this module."""
    chunks: list[bytes] = []
    described, offset = {}, 0
    for name, array in arrays.items():
        little = np.ascontiguousarray(array, array.dtype.newbyteorder("<"))
        chunk = little.tobytes()
        described[name] = {"type": little.dtype.name, "shape": list(little.shape), "offset": offset}
        chunks += [chunk, b"\0" * (-len(chunk) % _ALIGNMENT)]
        offset += len(chunk) + -len(chunk) % _ALIGNMENT
    text = json.dumps(header | {"arrays": described}, allow_nan=False).encode()
    text += b" " * (-len(text) % _ALIGNMENT)
    return b"".join([struct.pack("<I", len(text)), text, *chunks])
