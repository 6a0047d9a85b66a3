"""A scenario as the training simulators hold it: 91 timesteps of a few kinds of objects, and roads as polylines.

GPUDrive's JSON, PufferDrive's binary maps and Waymax's examples share this step; coordinates are those of the source
frame.
"""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, IntP
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.interchange.base import Losses
from scenarionet_data.interchange.gpudrive.layout import HISTORY, NUM_STEPS, OBJECT_NAMES, ROADS
from scenarionet_data.interchange.numbering import number_ids
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType, is_lane, is_road_edge

_EXPERT_CROSSING = 0.1  # [m] Waymo's edges are drawn this roughly


@dataclass(frozen=True)
class TrainingScene:
    """Objects and roads of a scenario, in the source frame.

    Attributes:
        rows: (N,) rows of the objects in the scenario's tracks.
        steps: 91 timesteps of the scenario.
        position: (N, 91, 3) float64 [m]. heading: (N, 91) [rad]. velocity: (N, 91, 2) [m/s].
        valid: (N, 91).
        size: (N, 91, 3) length, width, height [m].
        goal: (N, 3) last valid position [m].
        ids: (N,) numbers that are their ids.
        ego: Row of the ego among these objects.
        roads: Row of the map, number that is its id, and points (P, 3) float64 [m] of each road.
    """

    rows: IntP
    steps: slice
    position: Float64
    heading: Float64
    velocity: Float64
    valid: Bool
    size: Float64
    goal: Float64
    ids: list[int]
    ego: int
    roads: list[tuple[int, int, Float64]]

    def first_size(self, losses: Losses) -> Float64:
        """Return the size (N, 3) of each object when it is first seen [m], for files that hold one size."""
        first: Float64 = self.size[np.arange(len(self.rows)), np.argmax(self.valid, axis=1)]
        changes = np.abs(np.where(self.valid[..., None], self.size - first[:, None], 0.0))
        losses.approximate(
            "objects whose size changes",
            int((changes.max(axis=(1, 2), initial=0.0) > 0.01).sum()),
            float(changes.max(initial=0.0)),
            "m",
        )
        return first

    def is_expert(self, scenario: ScenarioDescription, place: int) -> bool:
        """Return whether an object follows its recorded path: as its file said, or because it crosses a road edge."""
        told = json.loads(scenario.tracks.extras[self.rows[place]] or "{}").get("mark_as_expert")
        if told is None:
            return crosses_edges(self.position[place], self.valid[place], scenario.map, scenario.origin)
        return bool(told)


def make_scene(
    scenario: ScenarioDescription, losses: Losses, kinds: Collection[ObjectType] = OBJECT_NAMES.keys()
) -> TrainingScene:
    """Select the timesteps and objects that the training simulators hold, with the ego first to be kept.

    Args:
        scenario: The scenario.
        losses: Collects what is left out.
        kinds: Types of objects that are kept.

    Raises:
        InvalidScenario: The scenario is shorter than 91 timesteps.
    """
    tracks = scenario.tracks
    num_steps = len(scenario.timestamps)
    if num_steps < NUM_STEPS:
        reason = f"expected at least {NUM_STEPS} timesteps, found {num_steps}; convert longer windows"
        raise InvalidScenario(scenario.id, "timestamps", reason)
    if abs(scenario.dt - 0.1) > 1e-3:
        reason = f"expected timesteps of 0.1 s, found {scenario.dt:g} s; convert with dt=0.1"
        raise InvalidScenario(scenario.id, "dt", reason)
    first = min(max(scenario.current_timestep - HISTORY, 0), num_steps - NUM_STEPS)
    steps = slice(first, first + NUM_STEPS)
    losses.leave_out("timesteps", num_steps - NUM_STEPS)
    late = scenario.current_timestep - first - HISTORY
    losses.approximate("current timesteps, which are the eleventh", int(late != 0), abs(late) * scenario.dt, "s")
    is_kept = np.isin(tracks.object_type, list(kinds)) & tracks.valid[:, steps].any(axis=1)
    losses.leave_out("objects of other types, or not seen in these timesteps", int((~is_kept).sum()))
    rows = np.flatnonzero(is_kept)
    held = set(tracks.ids[rows])
    losses.leave_out("objects of interest", sum(track not in held for track in scenario.objects_of_interest))
    losses.leave_out("tracks to predict", sum(track not in held for track, _ in scenario.tracks_to_predict))
    valid = tracks.valid[rows, steps]
    position = tracks.position[rows, steps].astype(np.float64) + scenario.origin
    last = NUM_STEPS - 1 - np.argmax(valid[:, ::-1], axis=1)
    goal = position[np.arange(len(rows)), last]
    for place, row in enumerate(rows):
        asked = json.loads(tracks.extras[row] or "{}").get("goal_position")
        if asked is not None:
            goal[place] = asked
    ego = np.flatnonzero(rows == tracks.index(scenario.ego_id))
    if not len(ego):
        raise InvalidScenario(
            scenario.id, "ego_id", "expected an ego that is a vehicle seen in these timesteps, found none"
        )
    return TrainingScene(
        rows, steps, position, tracks.heading[rows, steps].astype(np.float64),
        tracks.velocity[rows, steps].astype(np.float64), valid, tracks.size[rows, steps].astype(np.float64), goal,
        number_ids({"objects": tracks.ids[rows]}, losses)[0]["objects"], int(ego[0]), _roads(scenario, losses),
    )  # fmt: skip


def _roads(scenario: ScenarioDescription, losses: Losses) -> list[tuple[int, int, Float64]]:
    features = scenario.map
    if features is None:
        losses.leave_out("maps, as the scenario has none")
        return []
    roads = []
    for row, kind in enumerate(features.feature_type):
        points = features.polyline[row] if len(features.polyline[row]) else features.polygon[row]
        if MapFeatureType(kind) in ROADS and len(points):
            roads.append((row, points.astype(np.float64) + scenario.origin))
        else:
            losses.leave_out(f"map features of type {MapFeatureType(kind).name}")
    held, lanes = np.zeros(len(features), np.bool_), is_lane(features.feature_type)
    held[[row for row, _ in roads]] = True
    lanes &= held
    beside = [features.left_neighbors, features.right_neighbors, features.left_boundaries, features.right_boundaries]
    for what, counts in (
        ("links between lanes", features.exit_lanes.lengths),
        ("speed limits of lanes", np.isfinite(features.speed_limit)),
        ("widths of lanes", features.width.lengths > 0),
        ("neighbours and boundaries of lanes", np.sum([links.lengths for links in beside], axis=0)),
    ):
        losses.leave_out(what, int(counts[lanes].sum()))
    is_double = (features.polyline.lengths > 0) & (features.polygon.lengths > 0)
    losses.leave_out("outlines of map features that have a line", int(is_double[held].sum()))
    losses.leave_out("lanes that signs and crosswalks control", int(features.controlled_lanes.lengths[held].sum()))
    named = {"map features": [features.ids[row] for row, _ in roads]}
    numbers = number_ids(named, losses)[0]["map features"]
    return [(row, number, points) for number, (row, points) in zip(numbers, roads, strict=True)]


def crosses_edges(position: Float64, valid: Bool, features: MapFeatures | None, origin: Float64) -> bool:
    """Whether a recorded path crosses a road edge, which a controlled vehicle must not: GPUDrive's ``mark_as_expert``.

    Args:
        position: (T, 3) [m], source frame. valid: (T,).
    """
    path = position[valid, :2]
    if features is None or len(path) < 2:
        return False
    import shapely

    edges = [
        features.polyline[int(row)][:, :2] + origin[:2] for row in np.flatnonzero(is_road_edge(features.feature_type))
    ]
    lines = [shapely.LineString(edge) for edge in edges if len(edge) > 1]
    moved = np.hypot(*np.diff(path, axis=0).T).sum() > _EXPERT_CROSSING
    return bool(moved and shapely.intersects(shapely.LineString(path), lines).any()) if lines else False


def object_name(kind: int) -> str:
    """Return the simulators' name of an ``ObjectType``."""
    return OBJECT_NAMES[ObjectType(kind)]
