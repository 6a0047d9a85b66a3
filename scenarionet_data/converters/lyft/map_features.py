"""Convert Lyft's semantic map to map features in the recordings' world frame, and find the lanes of its lights.

Geometry is transformed from local frames to earth-centred coordinates, and from there to the world frame by
``world_to_ecef`` of ``meta.json``. Objects have no heights, so the map has z = 0 as well. It has about 8,500 lanes.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import MapBuilder, flat_points
from scenarionet_data.building.plausible import find_bad_geometry
from scenarionet_data.building.polylines import between, midlines
from scenarionet_data.converters.cities import CityMap, complete_links
from scenarionet_data.converters.lyft.lanes import LaneSide, LaneSides, in_driving_direction
from scenarionet_data.converters.lyft.wire import SEMI_MAJOR_AXIS, LyftWireMap, WireControls, WireLanes, read_map
from scenarionet_data.converters.lyft.wire import WireSide as WireSide
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.listing import cached_by_file
from scenarionet_data.scenario.vocabulary import LightState
from scenarionet_data.scenario.vocabulary import MapFeatureType as Type

_ACCESS = ("UNKNOWN", "NO_RESTRICTION", "ONLY_HOV", "ONLY_BUS", "ONLY_BIKE", "ONLY_TURN")
_TURNS = ("UNKNOWN", "THROUGH", "LEFT", "SHARP_LEFT", "RIGHT", "SHARP_RIGHT", "U_TURN")
_BACKWARD = 3
"""RoadNetworkSegment.TravelDirection.ONE_WAY_BACKWARD."""
_MOTORWAYS = (1, 14)
"""RoadNetworkSegment.RoadClass MOTORWAY, MOTORWAY_LINK."""

_DIVIDERS: dict[int, tuple[Type, str | None]] = {
    0: (Type.UNKNOWN_LINE, None),
    2: (Type.ROAD_LINE_SOLID_SINGLE_YELLOW, None),
    3: (Type.ROAD_LINE_SOLID_SINGLE_WHITE, None),
    4: (Type.ROAD_LINE_BROKEN_SINGLE_YELLOW, None),
    5: (Type.ROAD_LINE_BROKEN_SINGLE_WHITE, None),
    6: (Type.ROAD_LINE_SOLID_DOUBLE_YELLOW, None),
    7: (Type.ROAD_LINE_SOLID_DOUBLE_WHITE, None),
    8: (Type.ROAD_LINE_PASSING_DOUBLE_YELLOW, "DOUBLE_YELLOW_SOLID_FAR_DASHED_NEAR"),
    9: (Type.ROAD_LINE_PASSING_DOUBLE_YELLOW, "DOUBLE_YELLOW_DASHED_FAR_SOLID_NEAR"),
    10: (Type.ROAD_EDGE_BOUNDARY, "CURB_RED"),
    11: (Type.ROAD_EDGE_BOUNDARY, "CURB_YELLOW"),
    12: (Type.ROAD_EDGE_BOUNDARY, None),
}
"""``MapFeatureType`` by Lane.Boundary.DividerType, with a name where the type is less specific; 1, NONE, is no line."""

_AREAS = {16: Type.CROSSWALK, 15: Type.SPEED_BUMP, 34: Type.SPEED_BUMP, 35: Type.CARPARK_AREA}
_STOP_SIGN, _STOP_LINE = 7, 47
"""Kinds of traffic controls, by field number in TrafficControlElement."""

FACES = {
    9: LightState.LANE_STATE_FLASHING_CAUTION,
    10: LightState.LANE_STATE_FLASHING_STOP,
    11: LightState.LANE_STATE_STOP,
    12: LightState.LANE_STATE_CAUTION,
    13: LightState.LANE_STATE_GO,
    **dict.fromkeys((30, 32, 38, 41, 44), LightState.LANE_STATE_ARROW_STOP),
    **dict.fromkeys((36, 37, 39, 42, 45), LightState.LANE_STATE_ARROW_CAUTION),
    **dict.fromkeys((31, 33, 40, 43, 46), LightState.LANE_STATE_ARROW_GO),
}
"""``LightState`` while a face is lit: flashing yellow and red, then red, yellow, green, and the arrows."""


@dataclass(frozen=True, eq=False)
class LyftCity(CityMap):
    """A semantic map in the world frame, z = 0.

    Attributes:
        exits: End of each lane, (2,) [m]: its stop point.
        faces: State and controlled lanes by face of a traffic light.
    """

    exits: dict[str, Float64]
    faces: dict[str, tuple[LightState, list[str]]]


@cached_by_file(2)
def read_city(map_file: Path, meta_file: Path) -> LyftCity:
    """Read a semantic map; cached, as every scenario is cropped from it.

    Args:
        map_file: ``semantic_map.pb``.
        meta_file: ``meta.json``.

    Raises:
        CorruptSource: A file is missing or damaged.
    """
    try:
        matrix = np.array(json.loads(meta_file.read_bytes())["world_to_ecef"], dtype=np.float64)
    except OSError as error:
        raise CorruptSource(f"{meta_file}: cannot be read ({error.strerror}); download it again") from error
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError) as error:
        raise CorruptSource(f"{meta_file}: expected JSON with the matrix world_to_ecef; download it again") from error
    if not _is_rigid(matrix):
        raise CorruptSource(f"{meta_file}: world_to_ecef: expected a 4 x 4 rigid transform; download it again")
    ecef_to_world = np.linalg.inv(matrix).astype(np.float64)
    wire, file, defects = read_map(map_file), f"{map_file.parent.name}/{map_file.name}", Defects()
    for number, reason in wire.damaged:
        defects.drop("maps", file, [f"element {number}"], "element", f"expected a sound map element, found {reason}")
    defects.drop("maps", file, wire.repeated, "id", "expected elements with ids of their own, found one repeated")
    lanes = _lanes(wire.lanes, ecef_to_world, file, defects)
    builder = MapBuilder()
    exits = _add_lanes(builder, wire, lanes)
    lights = {name: faces for name, faces in zip(wire.controls.ids, wire.controls.faces, strict=True) if faces}
    ordered: dict[str, dict[str, None]] = {}
    for lane, controls in zip(wire.lanes.ids, wire.lanes.controls, strict=True):
        for control in controls:
            for name in (control, *lights.get(control, ())):
                ordered.setdefault(name, {})[lane] = None
    controlled = {name: list(names) for name, names in ordered.items()}
    centre = np.median(list(exits.values()), axis=0)
    _add_controls(builder, wire.controls, ecef_to_world, controlled, centre, file, defects)
    builder.defects = defects.found()
    kinds = zip(wire.controls.ids, wire.controls.kinds.tolist(), strict=True)
    faces = {name: (FACES[kind], controlled.get(name, [])) for name, kind in kinds if kind in FACES}
    return LyftCity(builder, exits, faces)


def _is_rigid(matrix: Float64) -> bool:
    """Whether a matrix is a rotation and a translation by less than two radii of the earth."""
    if matrix.shape != (4, 4) or not (np.abs(matrix) < 2 * SEMI_MAJOR_AXIS).all():
        return False
    is_turn = np.abs(matrix[:3, :3] @ matrix[:3, :3].T - np.eye(3)).max() < 1e-3
    return bool(is_turn and np.array_equal(matrix[3], [0.0, 0.0, 0.0, 1.0]))


def _in_world(points: Float64, ecef_to_world: Float64) -> Float64:
    """(P, 2) world coordinates of earth-centred points (P, 3)."""
    return points @ ecef_to_world[:2, :3].T + ecef_to_world[:2, 3]


# --- lanes ----------------------------------------------------------------------------------------------


def _lanes(wire: WireLanes, ecef_to_world: Float64, file: str, defects: Defects) -> dict[str, LaneSides]:
    """Lanes with geometry, by id, in driving direction; the others are added to ``defects``."""
    left, right = (_sides(side, ecef_to_world) for side in (wire.left, wire.right))
    centre = np.median(_in_world(wire.left.lines.values, ecef_to_world), axis=0)
    found = {}
    for name, *pair in zip(wire.ids, left, right, strict=True):
        fewest = min(len(side.points) for side in pair)
        reason = find_bad_geometry(np.concatenate([side.points for side in pair]), centre)
        if fewest > 1 and not reason:
            found[name] = LaneSides(*pair)
        else:
            reason = reason or f"expected at least 2 points on each side, found {fewest}"
            defects.drop("maps", file, [f"lane {name}"], "boundary", reason)
    is_backward = dict(zip(wire.ids, (wire.orientations == _BACKWARD).tolist(), strict=True))
    return in_driving_direction(found, is_backward, dict(zip(wire.ids, wire.ahead, strict=True)))


def _sides(wire: WireSide, ecef_to_world: Float64) -> list[LaneSide]:
    lines = Ragged(wire.lines.offsets, _in_world(wire.lines.values, ecef_to_world))
    return [LaneSide(*side) for side in zip(lines, wire.dividers, wire.changes, strict=True)]


def _add_lanes(builder: MapBuilder, wire: LyftWireMap, lanes: Mapping[str, LaneSides]) -> dict[str, Float64]:
    """Add lanes and the paint along them; return the end of each lane."""
    left, right = (flat_points([sides[side].points for sides in lanes.values()]) for side in (0, 1))
    centers, widths = between(midlines(left, right), left, right)
    entries: dict[str, list[str]] = {name: [] for name in wire.lanes.ids}
    complete_links(entries, dict(zip(wire.lanes.ids, wire.lanes.ahead, strict=True)))
    rows = {name: row for row, name in enumerate(wire.lanes.ids)}
    for (name, sides), center, width in zip(lanes.items(), centers, widths, strict=True):
        row = rows[name]
        parent = wire.lanes.parents[row]
        forward, backward, _ = wire.segments.get(wire.lanes.parents[row], (0.0, 0.0, 0))
        limit = backward if wire.lanes.orientations[row] == _BACKWARD and backward > 0.0 else forward
        access, turn = _ACCESS[wire.lanes.access[row]], _TURNS[wire.lanes.turns[row]]
        extras = {
            "parent": wire.lanes.parents[row],
            "access_restriction": access if access.startswith("ONLY_") else "",
            "turn_type": turn if turn != "UNKNOWN" else "",
            "can_have_parked_cars": bool(wire.lanes.can_have_parked_cars[row]),
        }
        builder.add(
            name,
            _lane_type(wire, row),
            polyline=center,
            polygon=np.concatenate([sides.left.points, sides.right.points[::-1]]),
            speed_limit=limit if 0.0 < limit < np.inf else np.nan,
            width=width,
            entry_lanes=entries[name],
            exit_lanes=wire.lanes.ahead[row],
            left_neighbors=_some(wire.lanes.left_neighbors[row]),
            right_neighbors=_some(wire.lanes.right_neighbors[row]),
            left_boundaries=_add_paint(builder, f"{name}-left", sides.left),
            right_boundaries=_add_paint(builder, f"{name}-right", sides.right),
            is_intersection=False if parent in wire.segments else wire.junctions.get(parent),
            extras={key: value for key, value in extras.items() if value} or None,
        )
    return {name: sides.ends[1] for name, sides in lanes.items()}


def _some(name: str) -> tuple[str, ...]:
    return (name,) if name else ()


def _lane_type(wire: LyftWireMap, row: int) -> Type:
    if _ACCESS[wire.lanes.access[row]] == "ONLY_BIKE":
        return Type.LANE_BIKE_LANE
    _, _, road_class = wire.segments.get(wire.lanes.parents[row], (0.0, 0.0, 0))
    return Type.LANE_FREEWAY if road_class in _MOTORWAYS else Type.LANE_SURFACE_STREET


def _add_paint(builder: MapBuilder, name: str, side: LaneSide) -> list[str]:
    """Add the lines along one side of a lane; return their ids."""
    added = []
    for number, (kind, points) in enumerate(side.paint()):
        if kind not in _DIVIDERS:
            continue
        line, word = _DIVIDERS[kind]
        added.append(name if len(side.dividers) == 1 else f"{name}-{number}")
        builder.add(added[-1], line, polyline=points, extras={"divider_type": word} if word else None)
    return added


# --- traffic controls -----------------------------------------------------------------------------------


def _add_controls(
    builder: MapBuilder,
    controls: WireControls,
    ecef_to_world: Float64,
    controlled: Mapping[str, Sequence[str]],
    centre: Float64,
    file: str,
    defects: Defects,
) -> None:
    """Add areas, stop signs and stop lines; other signs have no feature type."""
    places = Ragged(controls.points.offsets, _in_world(controls.points.values, ecef_to_world))
    for name, kind, points in zip(controls.ids, controls.kinds.tolist(), places, strict=True):
        lanes = controlled.get(name, ())
        is_used = kind in _AREAS or kind in (_STOP_SIGN, _STOP_LINE)
        reason = find_bad_geometry(points, centre) if is_used else None
        if reason:
            defects.drop("maps", file, [f"traffic control {name}"], "points", reason)
        elif kind in _AREAS and len(points) > 2:
            builder.add(name, _AREAS[kind], polygon=points, controlled_lanes=lanes)
        elif kind == _STOP_SIGN:
            builder.add(name, Type.STOP_SIGN, polyline=points.mean(axis=0, keepdims=True), controlled_lanes=lanes)
        elif kind == _STOP_LINE and len(points) > 1:
            builder.add(name, Type.STOP_LINE, polyline=points, controlled_lanes=lanes)
