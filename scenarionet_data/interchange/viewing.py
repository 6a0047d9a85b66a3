"""What viewers of recordings draw of a scenario: lines of the map, boxes, paths and lights, in the scenario frame.

Foxglove's MCAP and rerun's recordings share this step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int64, IntP, UInt8
from scenarionet_data.interchange.base import Losses
from scenarionet_data.scenario.description import ScenarioDescription
from scenarionet_data.scenario.vocabulary import (
    LIGHT_COLORS,
    LightColor,
    LightState,
    MapFeatureType,
    ObjectType,
    is_lane,
    is_road_edge,
)

Color = tuple[int, int, int, int]

EGO: Color = (214, 69, 65, 255)
OBJECT_COLORS: dict[ObjectType, Color] = {
    ObjectType.VEHICLE: (66, 133, 214, 255),
    ObjectType.PEDESTRIAN: (240, 160, 48, 255),
    ObjectType.CYCLIST: (64, 168, 96, 255),
}
OTHER: Color = (150, 150, 150, 255)
LIGHTS: dict[LightColor, Color] = {
    LightColor.UNKNOWN: (170, 170, 170, 255),
    LightColor.GREEN: (60, 200, 90, 255),
    LightColor.YELLOW: (245, 200, 50, 255),
    LightColor.RED: (230, 50, 50, 255),
}
LIGHT_HEIGHT = 4.0  # [m] above the stop point, where a signal hangs
LAYERS: dict[str, Color] = {
    "lanes": (150, 150, 150, 255),
    "road_lines": (215, 215, 215, 255),
    "road_edges": (110, 110, 110, 255),
    "crosswalks": (120, 160, 220, 255),
    "areas": (90, 90, 90, 255),
    "points": (220, 80, 80, 255),
}
"""Layers of the map and their colours."""


@dataclass(frozen=True)
class ViewedScene:
    """A scenario as viewers draw it.

    Attributes:
        nanoseconds: (T,) int64 since the first timestep.
        layers: Lines of the map, (P, 3) float32 [m] each, by name of the layer; outlines are closed.
        names: (N,) names of the objects, unique: their type and id.
        colors: (N, 4) uint8, red, green, blue, alpha.
        position, size: (N, T, 3) float32 [m]. heading: (N, T) float32 [rad]. valid: (N, T).
        ego: Row of the ego.
        lights: (K, 3) float32 [m] where lights stand.
        light_colors: (K, T) codes of ``LightColor``. light_seen: (K, T) whether a state is known.
        light_names: (K,).
    """

    nanoseconds: Int64
    layers: dict[str, list[Float32]]
    names: list[str]
    colors: UInt8
    position: Float32
    size: Float32
    heading: Float32
    valid: Bool
    ego: int
    lights: Float32
    light_colors: UInt8
    light_seen: Bool
    light_names: list[str]

    def objects_at(self, timestep: int) -> IntP:
        """Return the rows of the objects that are there at a timestep."""
        return np.flatnonzero(self.valid[:, timestep])

    def path(self, row: int) -> Float32:
        """Return the recorded positions (P, 3) [m] of an object."""
        points: Float32 = self.position[row, self.valid[row]]
        return points


def draw(scenario: ScenarioDescription, losses: Losses) -> ViewedScene:
    """Return what viewers draw of a scenario, and count what they do not hold."""
    tracks, lights = scenario.tracks, scenario.lights
    kinds = [ObjectType(kind) for kind in tracks.object_type]
    colors = np.array([OBJECT_COLORS.get(kind, OTHER) for kind in kinds], np.uint8).reshape(-1, 4)
    colors[scenario.ego_index] = EGO
    stands = np.isfinite(lights.stop_point).all(axis=1)
    losses.leave_out("lights without a position", int((~stands).sum()))
    losses.leave_out("recorded velocities", int(tracks.valid.sum()))
    losses.leave_out(
        "objects of interest and tracks to predict", len(scenario.objects_of_interest) + len(scenario.tracks_to_predict)
    )
    return ViewedScene(
        nanoseconds=np.round(scenario.timestamps * 1e9).astype(np.int64),
        layers=_layers(scenario, losses),
        names=[f"{kind.name.lower()} {track}" for kind, track in zip(kinds, tracks.ids, strict=True)],
        colors=colors,
        position=tracks.position,
        size=tracks.size,
        heading=tracks.heading,
        valid=tracks.valid,
        ego=scenario.ego_index,
        lights=lights.stop_point[stands],
        light_colors=LIGHT_COLORS[lights.state[stands]].astype(np.uint8),
        light_seen=lights.state[stands] != LightState.ABSENT,
        light_names=[f"light {lane}" for lane in lights.lane_ids[stands]],
    )


def quaternions(heading: Float64 | Float32) -> Float64:
    """Return rotations about the z axis as (..., 4) float64 x, y, z, w, for headings (...) [rad]."""
    half = np.asarray(heading, np.float64) / 2
    zero = np.zeros_like(half)
    return np.stack([zero, zero, np.sin(half), np.cos(half)], axis=-1)


def _layers(scenario: ScenarioDescription, losses: Losses) -> dict[str, list[Float32]]:
    layers: dict[str, list[Float32]] = {name: [] for name in LAYERS}
    features = scenario.map
    if features is None:
        losses.leave_out("maps, as the scenario has none")
        return {}
    lanes, edges = is_lane(features.feature_type), is_road_edge(features.feature_type)
    for row, kind in enumerate(features.feature_type):
        line, outline = features.polyline[row], features.polygon[row]
        points = line if len(line) else np.concatenate([outline, outline[:1]])
        if len(points) == 0:
            losses.leave_out("map features without points")
        elif lanes[row]:
            layers["lanes"].append(points)
        elif edges[row]:
            layers["road_edges"].append(points)
        elif MapFeatureType(kind).name.startswith(("ROAD_LINE", "UNKNOWN_LINE", "STOP_LINE")):
            layers["road_lines"].append(points)
        elif kind == MapFeatureType.CROSSWALK:
            layers["crosswalks"].append(points)
        else:
            layers["areas" if len(points) > 1 else "points"].append(points)
    beside = (features.entry_lanes, features.exit_lanes, features.left_neighbors, features.right_neighbors)
    losses.leave_out("links and neighbours of lanes", int(sum(links.lengths.sum() for links in beside)))
    losses.leave_out("speed limits of lanes", int(np.isfinite(features.speed_limit[lanes]).sum()))
    return {name: lines for name, lines in layers.items() if lines}
