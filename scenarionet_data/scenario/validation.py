"""Structural rules for the parts of a scenario; :meth:`ScenarioDescription.validate` applies them.

Whether motion is plausible depends on the budgets of a dataset; those checks are in ``sql/checks``.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Array, Object, UInt8
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.parts import ID_LISTS, Lights, MapFeatures, Tracks
from scenarionet_data.scenario.vocabulary import LightState, MapFeatureType, ObjectType, Provenance

_PI = np.float32(np.pi)


class Validator:
    """Raises InvalidScenario at the first rule that a scenario breaks."""

    def __init__(self, scenario_id: str) -> None:
        self.scenario_id = scenario_id

    def check(self, is_met: bool | np.bool_, field: str, reason: str) -> None:
        """Raise if a rule is not met."""
        if not is_met:
            raise InvalidScenario(self.scenario_id, field, reason)

    def array(self, array: Any, field: str, shape: tuple[int, ...], dtype: npt.DTypeLike) -> None:
        """Check shape and dtype."""
        # Messages are built only on failure: formatting a dtype takes longer than comparing it.
        if not isinstance(array, np.ndarray):
            self.check(False, field, f"wanted an array, found {type(array).__name__}")
        if array.shape != shape:
            self.check(False, field, f"wanted shape {shape}, found {array.shape}")
        if array.dtype != dtype:
            self.check(False, field, f"wanted {np.dtype(dtype)}, found {array.dtype}")

    def finite(self, array: Array, field: str) -> None:
        """Check that no number is NaN or infinite."""
        self.check_finite(array.size - int(np.count_nonzero(np.isfinite(array))), array.size, field)

    def check_finite(self, num_bad: int, size: int, field: str) -> None:
        """Check a count of numbers that are NaN or infinite."""
        self.check(num_bad == 0, field, f"wanted finite numbers, found {num_bad} NaN or infinite of {size}")

    def strings(self, words: Iterable[Any], field: str) -> None:
        """Check that all values are non-empty str."""
        listed = list(words)
        self.check(set(map(type, listed)) <= {str} and all(listed), field, "wanted non-empty str")

    def unique(self, ids: Object, field: str) -> None:
        """Check that ids are unique, non-empty str."""
        distinct = set(ids)
        if len(distinct) != len(ids):
            first = next(identifier for identifier in ids if (ids == identifier).sum() > 1)
            self.check(False, field, f"wanted unique ids, found {first!r} more than once")
        self.strings(distinct, field)

    def codes(self, codes: UInt8, field: str, vocabulary: type[IntEnum]) -> None:
        """Check that codes are members of an enum."""
        known = np.zeros(256, np.bool_)
        known[list(vocabulary)] = True
        unknown = codes[~known[codes]]
        if len(unknown):
            self.check(False, field, f"wanted codes of {vocabulary.__name__}, found {int(unknown[0])}")


def validate_tracks(validator: Validator, tracks: Tracks, steps: int) -> None:
    """Check arrays, codes and canonical values of tracks."""
    from scenarionet_data.scenario.validation_kernels import count_faults  # imports numba, which takes 0.4 s

    count = len(tracks.ids)
    validator.array(tracks.ids, "tracks.ids", (count,), object)
    validator.unique(tracks.ids, "tracks.ids")
    validator.array(tracks.object_type, "tracks.object_type", (count,), np.uint8)
    validator.codes(tracks.object_type, "tracks.object_type", ObjectType)
    validator.array(tracks.valid, "tracks.valid", (count, steps), np.bool_)
    shapes = {"position": (count, steps, 3), "heading": (count, steps), "velocity": (count, steps, 2)}
    shapes["size"] = (count, steps, 3)
    for name, shape in shapes.items():
        array = getattr(tracks, name)
        validator.array(array, f"tracks.{name}", shape, np.float32)
        num_bad, num_set = count_faults(array.reshape(count, steps, -1 if array.size else 1), tracks.valid)
        validator.check_finite(num_bad, array.size, f"tracks.{name}")
        validator.check(num_set == 0, f"tracks.{name}", "wanted 0 where valid is False")
    in_range = (tracks.heading >= -_PI).all() and (tracks.heading < _PI).all()
    validator.check(in_range, "tracks.heading", "wanted [-pi, pi)")
    validator.check(
        ((tracks.size > 0) | ~tracks.valid[..., None]).all(), "tracks.size", "wanted sizes above 0 where valid"
    )
    validator.array(tracks.is_interpolated, "tracks.is_interpolated", (count, steps), np.bool_)
    is_inside = not (tracks.is_interpolated & ~tracks.valid).any()
    validator.check(is_inside, "tracks.is_interpolated", "wanted False where valid is False")
    for name in ("is_size_assumed", "is_type_assumed", "is_velocity_estimated"):
        validator.array(getattr(tracks, name), f"tracks.{name}", (count,), np.bool_)
    for name in ("source_type", "extras"):
        validator.array(getattr(tracks, name), f"tracks.{name}", (count,), object)


def validate_lights(validator: Validator, lights: Lights, steps: int) -> None:
    """Check arrays and codes of traffic lights."""
    count = len(lights.ids)
    validator.array(lights.ids, "lights.ids", (count,), object)
    validator.array(lights.lane_ids, "lights.lane_ids", (count,), object)
    keys = set(zip(lights.ids, lights.lane_ids, strict=True))
    validator.check(len(keys) == count, "lights.ids", "wanted one row per light and lane, found duplicates")
    validator.strings(lights.ids, "lights.ids")
    validator.strings(lights.lane_ids, "lights.lane_ids")
    validator.array(lights.state, "lights.state", (count, steps), np.uint8)
    validator.codes(lights.state, "lights.state", LightState)
    validator.array(lights.stop_point, "lights.stop_point", (count, 3), np.float32)
    validator.check(not np.isinf(lights.stop_point).any(), "lights.stop_point", "wanted metres or NaN, found infinity")
    validator.array(lights.is_lane_in_map, "lights.is_lane_in_map", (count,), np.bool_)
    validator.array(lights.provenance, "lights.provenance", (count,), np.uint8)
    validator.codes(lights.provenance, "lights.provenance", Provenance)


def validate_map(validator: Validator, features: MapFeatures) -> None:
    """Check arrays, codes and offsets of map features."""
    count = len(features.ids)
    validator.array(features.ids, "map.ids", (count,), object)
    validator.unique(features.ids, "map.ids")
    validator.array(features.feature_type, "map.feature_type", (count,), np.uint8)
    validator.codes(features.feature_type, "map.feature_type", MapFeatureType)
    for name, width in (("polyline", 3), ("polygon", 3), ("width", 2)):
        ragged = getattr(features, name)
        _validate_ragged(validator, ragged, f"map.{name}", count)
        validator.array(ragged.values, f"map.{name}", (len(ragged.values), width), np.float32)
        validator.finite(ragged.values, f"map.{name}")
    widths, points = features.width.lengths, features.polyline.lengths
    fits = (widths == 0) | (widths == 1) | (widths == points)
    validator.check(fits.all(), "map.width", "wanted none, one, or one per point of the polyline")
    for name in ID_LISTS:
        ragged = getattr(features, name)
        _validate_ragged(validator, ragged, f"map.{name}", count)
        validator.array(ragged.values, f"map.{name}", (len(ragged.values),), object)
        validator.strings(ragged.values, f"map.{name}")
    validator.array(features.speed_limit, "map.speed_limit", (count,), np.float32)
    known = features.speed_limit[~np.isnan(features.speed_limit)]
    validator.check(((known >= 0) & (known < np.inf)).all(), "map.speed_limit", "wanted m/s from 0, or NaN")
    validator.array(features.is_intersection, "map.is_intersection", (count,), np.int8)
    validator.check(np.isin(features.is_intersection, (-1, 0, 1)).all(), "map.is_intersection", "wanted 1, 0 or -1")
    validator.array(features.extras, "map.extras", (count,), object)


def _validate_ragged(validator: Validator, ragged: Ragged, field: str, count: int) -> None:
    validator.array(ragged.offsets, field, (count + 1,), np.int32)
    ordered = ragged.offsets[0] == 0 and (ragged.lengths >= 0).all()
    validator.check(ordered, field, "wanted offsets that start at 0 and never fall")
    validator.check(ragged.offsets[-1] == len(ragged.values), field, "wanted the last offset at the end of the values")
