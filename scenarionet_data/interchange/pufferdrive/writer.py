"""Write scenarios as PufferDrive's binary maps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scenarionet_data.arrays.dtypes import Float32, Float64
from scenarionet_data.building.thinning import thin
from scenarionet_data.errors import BadParameter
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.gpudrive.layout import FEATURE_OF_TYPE, INVALID, ROADS
from scenarionet_data.interchange.pufferdrive.layout import OBJECT_TYPES, ROAD_TYPES, Entity, PufferMap, encode
from scenarionet_data.interchange.scenes import TrainingScene, make_scene, object_name
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType

_SIMPLIFIED_FROM = 11  # points; shorter polylines are kept
_AREA = 0.1  # [m²] of the triangle at a point that is left out
_LONGEST_SEGMENT = 250.0  # [m]


@dataclass(frozen=True)
class PufferDriveWriter:
    """Writes one binary map a scenario.

    Attributes:
        layout: 2 for PufferDrive 2.0, 1 for pufferlib 3.0.
        simplify: Leave out points of polylines as PufferDrive's own preparation does.
    """

    name: ClassVar[str] = "pufferdrive"

    layout: int = 2
    simplify: bool = True

    def __post_init__(self) -> None:
        if self.layout not in (1, 2):
            raise BadParameter(f"layout={self.layout}: PufferDrive has the layouts 1 and 2")

    def write(self, scenario: ScenarioDescription, stem: str, losses: Losses) -> Mapping[str, bytes]:
        """Return the file of a scenario; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        scene = make_scene(scenario, losses)
        losses.leave_out("states of traffic lights", int((scenario.lights.state[:, scene.steps] != 0).sum()))
        size = scene.first_size(losses)
        objects = [_object(scenario, scene, place, size[place].tolist()) for place in range(len(scene.rows))]
        roads = [] if scenario.map is None else [self._road(scenario.map, each, losses) for each in scene.roads]
        place_of = {scenario.tracks.ids[row]: place for place, row in enumerate(scene.rows)}
        predicted = tuple(place_of[track] for track, _ in scenario.tracks_to_predict if track in place_of)
        losses.leave_out("objects of interest", sum(track in place_of for track in scenario.objects_of_interest))
        levels = [level for track, level in scenario.tracks_to_predict if track in place_of]
        losses.leave_out("difficulties of tracks to predict", sum(level > 0 for level in levels))
        if self.layout == 1:
            losses.leave_out("ids of objects and map features", len(objects) + len(roads))
            losses.leave_out("egos")
            losses.leave_out("tracks to predict", len(predicted))
        everything = np.concatenate(
            [entity.position[entity.valid] for entity in objects] + [road.position for road in roads]
        )
        losses.approximate(
            "coordinates stored as float32", everything.size, float(np.spacing(np.abs(everything)).max() / 2), "m"
        )
        return {f"{stem}.bin": encode(PufferMap(objects, roads, scene.ego, predicted), self.layout)}

    def _road(self, features: MapFeatures, road: tuple[int, int, Float64], losses: Losses) -> Entity:
        row, feature_id, points = road
        kind = MapFeatureType(features.feature_type[row])
        name, number = ROADS[kind]
        losses.leave_out(
            "types of map features that PufferDrive does not distinguish", int(FEATURE_OF_TYPE[name] != kind)
        )
        if self.simplify and len(points) >= _SIMPLIFIED_FROM and number <= 16:
            kept = simplified(points)
            losses.leave_out("points of polylines, as PufferDrive's preparation does", len(points) - len(kept))
            points = kept
        return Entity(ROAD_TYPES[name], feature_id, points.astype(np.float32))


def _object(scenario: ScenarioDescription, scene: TrainingScene, place: int, size: list[float]) -> Entity:
    row, valid = scene.rows[place], scene.valid[place]

    def stored(values: Float64) -> Float32:
        is_known = valid.reshape(-1, *[1] * (values.ndim - 1))
        return np.where(is_known, values, INVALID).astype(np.float32)

    velocity = np.concatenate([scene.velocity[place], np.zeros((len(valid), 1))], axis=1)
    length, width, height = size
    return Entity(
        kind=OBJECT_TYPES[object_name(scenario.tracks.object_type[row])],
        id=scene.ids[place],
        position=stored(scene.position[place]),
        velocity=stored(velocity),
        heading=stored(scene.heading[place]),
        valid=valid,
        size=(width, length, height),
        goal=tuple(scene.goal[place].tolist()),
        is_expert=scene.is_expert(scenario, place),
    )


def simplified(points: Float64) -> Float64:
    """Leave out points whose triangle with their neighbours has less than 0.1 m², until none is left.

    Args:
        points: (P, 3) [m].
    """
    is_kept = np.empty(len(points), np.bool_)
    ends = np.array([0, len(points)], np.int32)
    thin(points, ends, _AREA, _LONGEST_SEGMENT, np.empty(len(points), np.int32), is_kept)
    return points[is_kept]
