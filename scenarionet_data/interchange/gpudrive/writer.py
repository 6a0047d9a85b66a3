"""Write scenarios as GPUDrive's JSON, which Nocturne and PufferDrive's preparation read, too."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.gpudrive.layout import FEATURES, INVALID, MAX_OBJECTS, MAX_POINTS, MAX_ROADS, ROADS
from scenarionet_data.interchange.scenes import TrainingScene, make_scene, object_name
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType


@dataclass(frozen=True)
class GpuDriveWriter:
    """Writes one JSON file a scenario."""

    name: ClassVar[str] = "gpudrive"

    def write(self, scenario: ScenarioDescription, stem: str, losses: Losses) -> Mapping[str, bytes]:
        """Return the file of a scenario; see :class:`~scenarionet_data.interchange.base.FormatWriter`."""
        scene = make_scene(scenario, losses)
        losses.leave_out("states of traffic lights", int((scenario.lights.state[:, scene.steps] != 0).sum()))
        size = scene.first_size(losses)
        losses.leave_out("objects beyond those that GPUDrive reads", max(len(scene.rows) - MAX_OBJECTS, 0))
        losses.leave_out("roads beyond those that GPUDrive reads", max(len(scene.roads) - MAX_ROADS, 0))
        place_of = {scenario.tracks.ids[row]: place for place, row in enumerate(scene.rows[:MAX_OBJECTS])}
        interesting = [scene.ids[place_of[track]] for track in scenario.objects_of_interest if track in place_of]
        predicted = [
            {"track_index": place_of[track], "difficulty": difficulty}
            for track, difficulty in dict(scenario.tracks_to_predict).items()
            if track in place_of
        ]
        text = json.dumps(
            {
                "name": f"{stem}.json",
                "scenario_id": scenario.source.scenario_id,
                "objects": [
                    _object(scenario, scene, place, size[place].tolist())
                    for place in range(min(len(scene.rows), MAX_OBJECTS))
                ],
                "roads": [_road(scenario, each, losses) for each in scene.roads[:MAX_ROADS]],
                "tl_states": {},
                "metadata": {
                    "sdc_track_index": scene.ego,
                    "objects_of_interest": interesting,
                    "tracks_to_predict": predicted,
                },
            }
        )
        return {f"{stem}.json": text.encode()}


def _object(scenario: ScenarioDescription, scene: TrainingScene, place: int, size: list[float]) -> dict[str, Any]:
    row, valid = scene.rows[place], scene.valid[place]

    def points(values: Float64) -> list[dict[str, float]]:
        names = "xyz"[: values.shape[1]]
        return [
            dict(zip(names, value if is_valid else [INVALID] * len(names), strict=True))
            for value, is_valid in zip(values.tolist(), valid.tolist(), strict=True)
        ]

    length, width, height = size
    return {
        "position": points(scene.position[place]),
        "width": width,
        "length": length,
        "height": height,
        "heading": [h if ok else INVALID for h, ok in zip(scene.heading[place].tolist(), valid.tolist(), strict=True)],
        "velocity": points(scene.velocity[place]),
        "valid": valid.tolist(),
        "goalPosition": dict(zip("xyz", scene.goal[place].tolist(), strict=True)),
        "type": object_name(scenario.tracks.object_type[row]),
        "id": scene.ids[place],
        "mark_as_expert": scene.is_expert(scenario, place),
    }


def _road(scenario: ScenarioDescription, road: tuple[int, int, Float64], losses: Losses) -> dict[str, Any]:
    row, feature_id, points = road
    losses.leave_out("points of roads beyond those that GPUDrive reads", max(len(points) - MAX_POINTS, 0))
    features = scenario.map
    if features is None:
        raise TypeError("roads without a map")
    kind = MapFeatureType(features.feature_type[row])
    name, number = ROADS[kind]
    losses.leave_out("types of map features that GPUDrive does not distinguish", int(FEATURES[number] != kind))
    return {
        "geometry": [dict(zip("xyz", point, strict=True)) for point in points[:MAX_POINTS].tolist()],
        "type": name,
        "map_element_id": number,
        "id": feature_id,
    }
