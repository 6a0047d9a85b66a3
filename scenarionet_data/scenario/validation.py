"""What every scenario must satisfy before it enters the lake; the words behind ``ScenarioDescription.validate``.

Structural rules only. Whether motion is plausible is a question of budgets per dataset, asked in
``scenarionet_data.testing`` and ``sql/checks``.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Object, UInt8
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building.kernels import count_faults
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.description import (
    ID_LISTS,
    Lights,
    MapFeatures,
    ScenarioDescription,
    Tracks,
    is_scenario_id,
    make_scenario_id,
)
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType, Provenance

_PI = np.float32(np.pi)


def validate(scenario: ScenarioDescription) -> None:
    """Raise InvalidScenario at the first rule that ``scenario`` breaks."""
    check = _Check(scenario.id)
    check.that(is_scenario_id(scenario.id), "id", "wanted <dataset>/<version>/<source id>[@start]")
    release = make_scenario_id(scenario.dataset, scenario.version, "")
    check.that(scenario.id.startswith(release), "id", f"wanted {release}..., after its dataset and version")
    _validate_time(check, scenario)
    _validate_tracks(check, scenario.tracks, scenario.num_timesteps)
    _validate_ego(check, scenario)
    _validate_lights(check, scenario.lights, scenario.num_timesteps)
    if scenario.map is not None:
        _validate_map(check, scenario.map)
        if not scenario.has_z:
            flat = not scenario.map.polyline.values[:, 2].any() and not scenario.map.polygon.values[:, 2].any()
            check.that(flat, "map.polyline", "wanted z = 0 where has_z is False")
    if not scenario.has_z:
        check.that(not scenario.tracks.position[..., 2].any(), "tracks.position", "wanted z = 0: has_z is False")
        stops = np.nan_to_num(scenario.lights.stop_point[:, 2])
        check.that(not stops.any(), "lights.stop_point", "wanted z = 0: has_z is False")
    _validate_crop(check, scenario)
    _validate_links(check, scenario)


class _Check:
    """Raises InvalidScenario for one scenario."""

    def __init__(self, scenario_id: str) -> None:
        self.scenario_id = scenario_id

    def that(self, is_met: bool | np.bool_, field: str, reason: str) -> None:
        if not is_met:
            raise InvalidScenario(self.scenario_id, field, reason)

    def array(self, array: Any, field: str, shape: tuple[int, ...], dtype: npt.DTypeLike) -> None:
        # Messages are made only when they are needed: naming a dtype takes longer than comparing it.
        if not isinstance(array, np.ndarray):
            self.that(False, field, f"wanted an array, found {type(array).__name__}")
        if array.shape != shape:
            self.that(False, field, f"wanted shape {shape}, found {array.shape}")
        if array.dtype != dtype:
            self.that(False, field, f"wanted {np.dtype(dtype)}, found {array.dtype}")

    def finite(self, array: Array, field: str) -> None:
        self.that_finite(array.size - int(np.count_nonzero(np.isfinite(array))), array.size, field)

    def that_finite(self, num_bad: int, size: int, field: str) -> None:
        self.that(num_bad == 0, field, f"wanted finite numbers, found {num_bad} NaN or infinite of {size}")

    def words(self, words: Iterable[Any], field: str) -> None:
        listed = list(words)
        self.that(set(map(type, listed)) <= {str} and all(listed), field, "wanted non-empty str")

    def unique(self, ids: Object, field: str) -> None:
        distinct = set(ids)
        if len(distinct) != len(ids):
            first = next(identifier for identifier in ids if (ids == identifier).sum() > 1)
            self.that(False, field, f"wanted unique ids, found {first!r} more than once")
        self.words(distinct, field)

    def codes(self, codes: UInt8, field: str, vocabulary: type[IntEnum]) -> None:
        known = np.zeros(256, np.bool_)
        known[list(vocabulary)] = True
        unknown = codes[~known[codes]]
        if len(unknown):
            self.that(False, field, f"wanted codes of {vocabulary.__name__}, found {int(unknown[0])}")


def _validate_time(check: _Check, scenario: ScenarioDescription) -> None:
    steps = scenario.num_timesteps
    check.array(scenario.timestamps, "timestamps", (steps,), np.float64)
    check.that(steps > 0, "timestamps", "wanted at least one timestep, found none")
    check.finite(scenario.timestamps, "timestamps")
    check.that(scenario.timestamps[0] == 0, "timestamps", f"wanted the first 0, found {scenario.timestamps[0]}")
    check.that((np.diff(scenario.timestamps) > 0).all(), "timestamps", "wanted strictly increasing times")
    check.that(0 < scenario.dt < np.inf, "dt", f"wanted a positive timestep, found {scenario.dt}")
    current = scenario.current_timestep
    check.that(0 <= current < steps, "current_timestep", f"wanted 0 ... {steps - 1}, found {current}")
    check.array(scenario.origin, "origin", (3,), np.float64)
    check.finite(scenario.origin, "origin")


def _validate_tracks(check: _Check, tracks: Tracks, steps: int) -> None:
    count = len(tracks.ids)
    check.array(tracks.ids, "tracks.ids", (count,), object)
    check.unique(tracks.ids, "tracks.ids")
    check.array(tracks.object_type, "tracks.object_type", (count,), np.uint8)
    check.codes(tracks.object_type, "tracks.object_type", ObjectType)
    check.array(tracks.valid, "tracks.valid", (count, steps), np.bool_)
    shapes = {"position": (count, steps, 3), "heading": (count, steps), "velocity": (count, steps, 2)}
    shapes["size"] = (count, steps, 3)
    for name, shape in shapes.items():
        array = getattr(tracks, name)
        check.array(array, f"tracks.{name}", shape, np.float32)
        num_bad, num_set = count_faults(array.reshape(count, steps, -1 if array.size else 1), tracks.valid)
        check.that_finite(num_bad, array.size, f"tracks.{name}")
        check.that(num_set == 0, f"tracks.{name}", "wanted 0 where valid is False")
    in_range = (tracks.heading >= -_PI).all() and (tracks.heading < _PI).all()
    check.that(in_range, "tracks.heading", "wanted [-pi, pi)")
    check.that(((tracks.size > 0) | ~tracks.valid[..., None]).all(), "tracks.size", "wanted sizes above 0 where valid")
    for name in ("is_size_assumed", "is_type_assumed", "is_velocity_estimated"):
        check.array(getattr(tracks, name), f"tracks.{name}", (count,), np.bool_)
    for name in ("source_type", "extras"):
        check.array(getattr(tracks, name), f"tracks.{name}", (count,), object)


def _validate_ego(check: _Check, scenario: ScenarioDescription) -> None:
    rows = np.flatnonzero(scenario.tracks.ids == scenario.ego_id)
    check.that(len(rows) == 1, "ego_id", f"wanted a track {scenario.ego_id!r}, found none")
    now = scenario.current_timestep
    check.that(scenario.tracks.valid[rows[0], now], "ego_id", f"wanted the ego valid at current_timestep {now}")


def _validate_lights(check: _Check, lights: Lights, steps: int) -> None:
    count = len(lights.ids)
    check.array(lights.ids, "lights.ids", (count,), object)
    check.array(lights.lane_ids, "lights.lane_ids", (count,), object)
    keys = set(zip(lights.ids, lights.lane_ids, strict=True))
    check.that(len(keys) == count, "lights.ids", "wanted one row per light and lane, found duplicates")
    check.words(lights.ids, "lights.ids")
    check.words(lights.lane_ids, "lights.lane_ids")
    check.array(lights.state, "lights.state", (count, steps), np.uint8)
    check.codes(lights.state, "lights.state", LightState)
    check.array(lights.stop_point, "lights.stop_point", (count, 3), np.float32)
    check.that(not np.isinf(lights.stop_point).any(), "lights.stop_point", "wanted metres or NaN, found infinity")
    check.array(lights.is_lane_in_map, "lights.is_lane_in_map", (count,), np.bool_)
    check.array(lights.provenance, "lights.provenance", (count,), np.uint8)
    check.codes(lights.provenance, "lights.provenance", Provenance)


def _validate_map(check: _Check, features: MapFeatures) -> None:
    count = len(features.ids)
    check.array(features.ids, "map.ids", (count,), object)
    check.unique(features.ids, "map.ids")
    check.array(features.types, "map.types", (count,), np.uint8)
    check.codes(features.types, "map.types", MapFeatureType)
    for name, width in (("polyline", 3), ("polygon", 3), ("width", 2)):
        ragged = getattr(features, name)
        _validate_ragged(check, ragged, f"map.{name}", count)
        check.array(ragged.values, f"map.{name}", (len(ragged.values), width), np.float32)
        check.finite(ragged.values, f"map.{name}")
    widths, points = features.width.lengths, features.polyline.lengths
    fits = (widths == 0) | (widths == 1) | (widths == points)
    check.that(fits.all(), "map.width", "wanted none, one, or one per point of the polyline")
    for name in ID_LISTS:
        ragged = getattr(features, name)
        _validate_ragged(check, ragged, f"map.{name}", count)
        check.array(ragged.values, f"map.{name}", (len(ragged.values),), object)
        check.words(ragged.values, f"map.{name}")
    check.array(features.speed_limit, "map.speed_limit", (count,), np.float32)
    known = features.speed_limit[~np.isnan(features.speed_limit)]
    check.that(((known >= 0) & (known < np.inf)).all(), "map.speed_limit", "wanted m/s from 0, or NaN")
    check.array(features.is_intersection, "map.is_intersection", (count,), np.int8)
    check.that(np.isin(features.is_intersection, (-1, 0, 1)).all(), "map.is_intersection", "wanted 1, 0 or -1")
    check.array(features.extras, "map.extras", (count,), object)


def _validate_ragged(check: _Check, ragged: Ragged, field: str, count: int) -> None:
    check.array(ragged.offsets, field, (count + 1,), np.int32)
    ordered = ragged.offsets[0] == 0 and (ragged.lengths >= 0).all()
    check.that(ordered, field, "wanted offsets that start at 0 and never fall")
    check.that(ragged.offsets[-1] == len(ragged.values), field, "wanted the last offset at the end of the values")


def _validate_crop(check: _Check, scenario: ScenarioDescription) -> None:
    crop = scenario.map_crop
    check.that((scenario.map_id is None) == (crop is None), "map_crop", "wanted map_id and map_crop, or neither")
    if crop is not None:
        is_box = len(crop) == 4 and np.isfinite(crop).all() and crop[0] <= crop[2] and crop[1] <= crop[3]
        check.that(is_box, "map_crop", f"wanted min_x, min_y, max_x, max_y in metres, found {crop}")


def _validate_links(check: _Check, scenario: ScenarioDescription) -> None:
    tracks = set(scenario.tracks.ids)
    for name, ids in (
        ("objects_of_interest", scenario.objects_of_interest),
        ("tracks_to_predict", [track_id for track_id, _ in scenario.tracks_to_predict]),
    ):
        missing = [track_id for track_id in ids if track_id not in tracks]
        check.that(not missing, name, f"wanted tracks of the scenario, found {missing[:3]}")
    if scenario.map_id is None:  # of a shared map only the crop is here
        lanes = set() if scenario.map is None else set(scenario.map.ids)
        found = np.array([lane in lanes for lane in scenario.lights.lane_ids], dtype=np.bool_)
        same = np.array_equal(found, scenario.lights.is_lane_in_map)
        check.that(same, "lights.is_lane_in_map", "wanted True exactly where lane_id is a map feature")
