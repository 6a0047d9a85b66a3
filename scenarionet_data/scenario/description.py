"""One traffic scenario as frozen arrays: what converters yield, the lake stores and the simulator drives in.

Frame: the scenario frame is the source's frame moved by ``origin`` (never turned): x forward-east, y left-north,
z up, right-handed, metres; headings in radians counter-clockwise from +x, in [-pi, pi). Coordinates are
float32 offsets from a float64 origin near the ego, so they are exact to 0.1 mm within 1 km.
N objects, T timesteps, L lights, M map features. Where an object is not valid, its arrays hold 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.cards import HasCard
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.defects import Defect
from scenarionet_data.scenario.parts import (
    ID_LISTS,
    Lights,
    MapFeatures,
    ScenarioPart,
    Source,
    Tracks,
    is_scenario_id,
    make_scenario_id,
    strings,
)
from scenarionet_data.scenario.validation import Validator, validate_lights, validate_map, validate_tracks

__all__ = [
    "ID_LISTS",
    "Lights",
    "MapFeatures",
    "ScenarioDescription",
    "Source",
    "Tracks",
    "is_scenario_id",
    "make_scenario_id",
    "strings",
]


@dataclass(frozen=True, eq=False)
class ScenarioDescription(ScenarioPart, HasCard):
    """One scenario, complete.

    Attributes:
        id: Globally unique, see :func:`make_scenario_id`.
        dataset, version, split: For example ``"waymo"``, ``"v1.2"``, ``"train"``.
        timestamps: (T,) float64 [s] from the first timestep, strictly increasing.
        dt: Nominal timestep [s].
        current_timestep: Last timestep of the history.
        ego_id: Track of the recording vehicle; valid at ``current_timestep``.
        origin: (3,) float64 [m] scenario frame to source frame.
        has_z: Whether the source records heights; without, every z is 0.
        source: Its origin in the dataset.
        tracks, lights: Its objects and traffic lights.
        map: Its map features (of a shared map: the crop); None without a map.
        map_id: Key of a map shared by many scenarios; None when the map is the scenario's own.
        map_crop: min_x, min_y, max_x, max_y [m] in the scenario frame: the window on a shared map.
        objects_of_interest: Tracks the source marks as interesting.
        tracks_to_predict: Tracks whose future the source's challenge asks to predict, with its difficulty or 0.
        extras: JSON-able mapping of properties that only this source has.
        defects: What its conversion dropped or assumed; not part of its content: a loaded scenario has none.
        num_recorded_rows: Rows of the recording behind the tracks, if they are not one for each valid state, as after
            interpolation; the share of dropped rows refers to them. Like ``defects``, not part of the content.
    """

    id: str
    dataset: str
    version: str
    split: str
    timestamps: Float64
    dt: float
    current_timestep: int
    ego_id: str
    origin: Float64
    has_z: bool
    source: Source
    tracks: Tracks
    lights: Lights
    map: MapFeatures | None
    map_id: str | None = None
    map_crop: tuple[float, float, float, float] | None = None
    # Fields that are made when they are read have no default that Python finds in the class instead.
    objects_of_interest: tuple[str, ...] = field(default_factory=tuple)
    tracks_to_predict: tuple[tuple[str, int], ...] = field(default_factory=tuple)
    extras: Mapping[str, Any] = field(default_factory=dict)
    defects: tuple[Defect, ...] = field(default=(), compare=False)
    num_recorded_rows: int | None = field(default=None, compare=False)

    @property
    def num_timesteps(self) -> int:
        """T."""
        return len(self.timestamps)

    @property
    def ego_index(self) -> int:
        """Row of the ego in ``tracks``."""
        return self.tracks.index(self.ego_id)

    def with_tracks(self, tracks: Tracks) -> ScenarioDescription:
        """Return the scenario with other tracks, without what it says of objects that are not among them."""
        ids = set(tracks.ids)
        return replace(
            self,
            tracks=tracks,
            objects_of_interest=tuple(each for each in self.objects_of_interest if each in ids),
            tracks_to_predict=tuple(each for each in self.tracks_to_predict if each[0] in ids),
        )

    def with_own_map(self) -> ScenarioDescription:
        """Return the scenario with the part of the shared map that it has loaded as a map of its own."""
        if self.map_id is None:
            return self
        lanes = set() if self.map is None else set(self.map.ids)
        is_in_map = np.array([each in lanes for each in self.lights.lane_ids], np.bool_)
        return replace(self, lights=replace(self.lights, is_lane_in_map=is_in_map), map_id=None, map_crop=None)

    def __repr__(self) -> str:
        return (
            f"ScenarioDescription({self.id!r}, {self.num_timesteps} timesteps, {len(self.tracks)} tracks, "
            f"{len(self.lights)} lights, {len(self.map) if self.map else 0} map features)"
        )

    def validate(self) -> None:
        """Check the contract of every part.

        Raises:
            InvalidScenario: With scenario, field, expected and found value.
        """
        validator = Validator(self.id)
        validator.check(is_scenario_id(self.id), "id", "wanted <dataset>/<version>/<source id>[@start]")
        release = make_scenario_id(self.dataset, self.version, "")
        validator.check(self.id.startswith(release), "id", f"wanted {release}..., after its dataset and version")
        steps = self.num_timesteps
        validator.array(self.timestamps, "timestamps", (steps,), np.float64)
        validator.check(steps > 0, "timestamps", "wanted at least one timestep, found none")
        validator.finite(self.timestamps, "timestamps")
        validator.check(self.timestamps[0] == 0, "timestamps", f"wanted the first 0, found {self.timestamps[0]}")
        is_later = np.append(np.diff(self.timestamps) > 0, True)
        place = int(is_later.argmin())
        found = f"found {self.timestamps[place : place + 2].tolist()} s at timesteps {place} and {place + 1}"
        validator.check(bool(is_later.all()), "timestamps", f"wanted strictly increasing times, {found}")
        validator.check(0 < self.dt < np.inf, "dt", f"wanted a positive timestep, found {self.dt}")
        current = self.current_timestep
        validator.check(0 <= current < steps, "current_timestep", f"wanted 0 ... {steps - 1}, found {current}")
        validator.array(self.origin, "origin", (3,), np.float64)
        validator.finite(self.origin, "origin")
        validate_tracks(validator, self.tracks, steps)
        rows = np.flatnonzero(self.tracks.ids == self.ego_id)
        validator.check(len(rows) == 1, "ego_id", f"wanted a track {self.ego_id!r}, found none")
        validator.check(
            self.tracks.valid[rows[0], current], "ego_id", f"wanted the ego valid at current_timestep {current}"
        )
        validate_lights(validator, self.lights, steps)
        if self.map is not None:
            validate_map(validator, self.map)
        if not self.has_z:
            if self.map is not None:
                flat = not self.map.polyline.values[:, 2].any() and not self.map.polygon.values[:, 2].any()
                validator.check(flat, "map.polyline", "wanted z = 0 where has_z is False")
            is_flat = not self.tracks.position[..., 2].any()
            validator.check(is_flat, "tracks.position", "wanted z = 0: has_z is False")
            stops = np.nan_to_num(self.lights.stop_point[:, 2])
            validator.check(not stops.any(), "lights.stop_point", "wanted z = 0: has_z is False")
        crop = self.map_crop
        validator.check((self.map_id is None) == (crop is None), "map_crop", "wanted map_id and map_crop, or neither")
        if crop is not None:
            is_box = len(crop) == 4 and np.isfinite(crop).all() and crop[0] <= crop[2] and crop[1] <= crop[3]
            validator.check(is_box, "map_crop", f"wanted min_x, min_y, max_x, max_y in metres, found {crop}")
        tracks = set(self.tracks.ids)
        for name, ids in (
            ("objects_of_interest", self.objects_of_interest),
            ("tracks_to_predict", [track_id for track_id, _ in self.tracks_to_predict]),
        ):
            missing = [track_id for track_id in ids if track_id not in tracks]
            validator.check(not missing, name, f"wanted tracks of the scenario, found {missing[:3]}")
        if self.map_id is None:  # of a shared map, only the crop is loaded
            lanes = set() if self.map is None else set(self.map.ids)
            is_in_map = np.array([lane in lanes for lane in self.lights.lane_ids], dtype=np.bool_)
            same = np.array_equal(is_in_map, self.lights.is_lane_in_map)
            validator.check(same, "lights.is_lane_in_map", "wanted True exactly where lane_id is a map feature")


def check_scenario(given: object) -> ScenarioDescription:
    """Return what is given if it is a scenario.

    Raises:
        BadParameter: It is not.
    """
    if not isinstance(given, ScenarioDescription):
        raise BadParameter(f"expected a scenario, such as ScenarioLoader('lake')[0]; found {given!r}")
    return given
