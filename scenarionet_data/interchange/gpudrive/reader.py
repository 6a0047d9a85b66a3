"""Read GPUDrive's JSON, and Nocturne's, which has no ids, no ego, no heights, and headings in degrees."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.defects import Defects
from scenarionet_data.ingest.shard import Shard
from scenarionet_data.interchange.gpudrive.layout import FEATURE_OF_TYPE, FEATURES, OBJECT_NAMES
from scenarionet_data.interchange.scene_files import FileScene, SceneFiles, SceneLight, SceneObject, SceneRoad
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType

_TYPES = {name: kind for kind, name in OBJECT_NAMES.items()}
_HEIGHT = 1.6
"""Height [m] of Nocturne's objects, which have none."""
_STATES = {
    state.name.removeprefix("LANE_STATE_").lower(): state for state in LightState if state.name.startswith("LANE_STATE")
}


class GpuDrive(SceneFiles):
    """GPUDrive's and Nocturne's scenarios."""

    name: ClassVar[str] = "gpudrive"
    licence: ClassVar[str] = "that of the recordings; of Waymo's: non-commercial, no redistribution"
    raw: ClassVar[str] = "a folder of GPUDrive's or Nocturne's scenarios (*.json)"
    pattern: ClassVar[str] = "*.json"

    def scene(self, path: Path, shard: Shard, defects: Defects) -> FileScene:
        """Read a file."""
        try:
            content = json.loads(path.read_bytes())
        except (OSError, ValueError, RecursionError) as error:
            raise CorruptSource(f"{path}: expected JSON, found none that can be read; copy it again") from error
        told = _mapping(content)
        if not (isinstance(told.get("objects"), list) and isinstance(told.get("roads"), list)):
            raise CorruptSource(f"{path}: expected a scenario with objects and roads, found none; copy it again")
        file = path.relative_to(shard.root).as_posix()
        has_metadata = isinstance(told.get("metadata"), dict)
        metadata = _mapping(told.get("metadata"))
        found = [_object(each, row, not has_metadata) for row, each in enumerate(told["objects"])]
        bad = [f"object {row}" for row, each in enumerate(found) if each is None]
        defects.drop("tracks", file, bad, "objects", "expected states, a size and a known type, found others")
        objects = [each for each in found if each is not None]
        rows = {number: row for row, number in enumerate(np.flatnonzero([each is not None for each in found]).tolist())}
        roads = [_road(each, row) for row, each in enumerate(told["roads"])]
        bad = [f"road {row}" for row, road in enumerate(roads) if road is None]
        defects.drop("maps", file, bad, "roads", "expected points and a known type, found others")
        lights = {str(lane): _light(lane, each) for lane, each in _mapping(told.get("tl_states")).items()}
        bad = [lane[:64] for lane, light in lights.items() if light is None]
        defects.drop("lights", file, bad, "tl_states", "expected states and a stop point, found others")
        predicted = [_mapping(each) for each in _list(metadata.get("tracks_to_predict"))]
        return FileScene(
            objects,
            [road for road in roads if road is not None],
            [light for light in lights.values() if light is not None],
            ego=rows.get(_whole(metadata.get("sdc_track_index"))),
            predicted=[
                (rows[_whole(each.get("track_index"))], max(_whole(each.get("difficulty")), 0))
                for each in predicted
                if _whole(each.get("track_index")) in rows
            ],
            interesting=[str(each) for each in _list(metadata.get("objects_of_interest"))],
        )


def _object(told: Any, row: int, is_nocturne: bool) -> SceneObject | None:
    """An object; None if it cannot be used."""
    told = _mapping(told)
    position, velocity = _points(told.get("position")), _points(told.get("velocity"))
    heading, valid = _numbers(told.get("heading")), told.get("valid")
    kind = _TYPES.get(str(told.get("type")))
    size = [_numbers([told.get(name, _HEIGHT if name == "height" else None)]) for name in ("length", "width", "height")]
    if position is None or velocity is None or heading is None or kind is None or any(side is None for side in size):
        return None
    if not isinstance(valid, list) or len({len(position), len(velocity), len(heading), len(valid)}) > 1:
        return None
    goal = _points([told.get("goalPosition")])
    extras: dict[str, object] = {"mark_as_expert": told["mark_as_expert"] is True} if "mark_as_expert" in told else {}
    if goal is not None and np.isfinite(goal).all():
        extras["goal_position"] = goal[0].tolist()
    return SceneObject(
        str(told.get("id", row)),
        kind,
        position,
        velocity[:, :2],
        np.radians(heading) if is_nocturne else heading,
        np.array([each is True or each == 1 for each in valid], np.bool_),
        tuple(float(side[0]) for side in size if side is not None),  # type: ignore[arg-type]
        extras,
    )


def _road(told: Any, row: int) -> SceneRoad | None:
    """A road; None if it cannot be used."""
    told = _mapping(told)
    geometry, number, word = told.get("geometry"), told.get("map_element_id"), str(told.get("type"))
    points = _points(geometry if isinstance(geometry, list) else [geometry])
    kind = FEATURES.get(number) if isinstance(number, int) else FEATURE_OF_TYPE.get(word)
    if points is None or kind is None:
        return None
    return SceneRoad(str(told.get("id", row)), MapFeatureType(kind), points)


def _light(lane: str, told: Any) -> SceneLight | None:
    told = _mapping(told)
    states, places = _list(told.get("state")), [_numbers(told.get(axis)) for axis in "xyz"]
    if not states or any(place is None or not len(place) for place in places):
        return None
    codes = [_STATES.get(str(state), LightState.LANE_STATE_UNKNOWN) for state in states]
    stop = np.array([place[0] for place in places if place is not None])
    return SceneLight(str(lane), np.array(codes, np.uint8), stop) if np.isfinite(stop).all() else None


def _points(told: Any) -> Float64 | None:
    """(n, 3) points of mappings with x, y and perhaps z; None if they are none."""
    if not isinstance(told, list) or not all(isinstance(point, dict) for point in told):
        return None
    columns = [_numbers([point.get(axis, 0.0 if axis == "z" else None) for point in told]) for axis in "xyz"]
    found = [column for column in columns if column is not None]
    return np.column_stack(found) if len(found) == 3 else None


def _numbers(told: Any) -> Float64 | None:
    """(n,) numbers; None for anything else."""
    if not isinstance(told, list) or not all(type(each) in (int, float) for each in told):
        return None
    try:
        return np.array(told, np.float64)
    except OverflowError:
        return None


def _mapping(told: Any) -> Mapping[str, Any]:
    return told if isinstance(told, dict) else {}


def _list(told: Any) -> list[Any]:
    return told if isinstance(told, list) else []


def _whole(told: Any) -> int:
    return told if isinstance(told, int) else -1
