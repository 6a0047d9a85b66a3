"""Convert Lyft's lit traffic light faces, frame by frame, to states of the lanes they control."""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.converters.lyft.map_features import LyftCity
from scenarionet_data.converters.lyft.recording import LyftContent
from scenarionet_data.scenario.description import Lights, strings
from scenarionet_data.scenario.vocabulary import LIGHT_COLORS, LightState, Provenance

_UNKNOWN = LightState.LANE_STATE_UNKNOWN
_CODES = 16
"""Greater than the number of light states."""


def lights(content: LyftContent, city: LyftCity | None, origin: Float64) -> Lights:
    """Build one row per traffic light and controlled lane.

    The state of a lane is that of the lit (ACTIVE) face, of the most restrictive one if several are lit, unknown if
    none is known to be lit, and none where the light is not reported. Faces without a lane in the map, and all faces
    without a map, are assigned to a row with the light's id as lane.

    Args:
        content: Frames with their faces.
        city: The map; None without one.
        origin: (3,) [m].
    """
    faces = content.faces
    if not len(faces):
        return Lights.empty(len(content.times))
    names = np.char.add(np.char.add(faces["traffic_light_id"], "\n"), faces["face_id"])
    kinds, kind_of_row = np.unique(names, return_inverse=True)
    rows: dict[tuple[str, str], int] = {}
    shown = np.zeros((sum(len(_targets(city, kind)) for kind in kinds.tolist()), len(content.times)), np.uint8)
    is_lit = faces["traffic_light_face_status"][:, 0] > 0
    for number, kind in enumerate(kinds.tolist()):
        mine = kind_of_row == number
        _, face = kind.split("\n")
        value = np.where(
            is_lit[mine], _ranked(city.faces[face][0] if city and face in city.faces else _UNKNOWN), _ranked(_UNKNOWN)
        )
        for target in _targets(city, kind):
            row = shown[rows.setdefault(target, len(rows))]
            np.maximum.at(row, content.faces_frame[mine], value)
    keys = list(rows)
    lanes = [lane for _, lane in keys]
    exits = city.exits if city else {}
    unknown = np.full(2, np.nan)
    stop = np.array([exits.get(lane, unknown) - origin[:2] for lane in lanes])
    return Lights(
        ids=strings(light for light, _ in keys),
        lane_ids=strings(lanes),
        stop_point=np.column_stack([stop, np.where(np.isnan(stop[:, 0]), np.nan, 0.0)]).astype(np.float32),
        state=shown[: len(rows)] % _CODES,
        is_lane_in_map=np.array([lane in exits for lane in lanes], dtype=np.bool_),
        provenance=np.full(len(keys), Provenance.OBSERVED, np.uint8),
    )


def _ranked(state: LightState) -> int:
    """Encode a state as a number that increases with its restrictiveness."""
    return int(LIGHT_COLORS[state]) * _CODES + int(state)


def _targets(city: LyftCity | None, kind: str) -> list[tuple[str, str]]:
    """Light and lane of the rows of a face."""
    light, face = kind.split("\n")
    lanes = city.faces[face][1] if city and face in city.faces else []
    return [(light, lane) for lane in lanes or [light]]
