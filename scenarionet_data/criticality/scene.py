"""What criticality is computed from: one object of a scenario, and all others as it meets them."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Self

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int64
from scenarionet_data.arrays.geometry import box_corners
from scenarionet_data.criticality.lane_path import DrivenPath, LaneAreas
from scenarionet_data.scenario.description import MapFeatures, ScenarioDescription
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType

_MOVERS = (ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST)


@dataclass(frozen=True)
class Assumptions:
    """Assumptions of the measures; the defaults are those of CommonRoad-CriMe 0.4.5, and of RSS its authors'.

    Attributes:
        acceleration: The strongest that an object can brake or accelerate with [m/s^2].
        lateral_acceleration: The strongest to a side [m/s^2].
        axis_acceleration: The strongest along each axis of an evasive manoeuvre [m/s^2].
        jerk: The greatest along each axis of an evasive manoeuvre [m/s^3].
        switch_speed: Speed above which the engine's power limits acceleration [m/s].
        top_speed, least_speed: Speeds at which a manoeuvre cannot go on [m/s].
        steering_distance: How far an evasive manoeuvre goes to the side [m].
        mass, other_mass: Masses for delta_v and ci [kg].
        tau: Threshold of ttc for tet and tit [s].
        safety_time: Distance that is left by dst [s].
        pet_threshold: Conflicts with a longer pet are none for ci [s].
        leader_braking: With which the leading object brakes for pttc [m/s^2].
        response_time: Of RSS [s].
        rss_acceleration, rss_braking, rss_leader_braking: Longitudinal limits of RSS [m/s^2].
        rss_lateral_acceleration, rss_lateral_braking: Lateral limits of RSS [m/s^2].
        rss_margin: Lateral fluctuation margin of RSS [m].
    """

    acceleration: float = 11.5
    lateral_acceleration: float = 8.0
    axis_acceleration: float = 8.0
    jerk: float = 25.0
    switch_speed: float = 7.319
    top_speed: float = 50.8
    least_speed: float = 0.2
    steering_distance: float = 0.8
    mass: float = 1093.2952334674046
    other_mass: float = 1093.2952334674046
    tau: float = 2.0
    safety_time: float = 2.0
    pet_threshold: float = 5.0
    leader_braking: float = 8.0
    response_time: float = 1.0
    rss_acceleration: float = 3.5
    rss_braking: float = 4.0
    rss_leader_braking: float = 8.0
    rss_lateral_acceleration: float = 0.2
    rss_lateral_braking: float = 0.8
    rss_margin: float = 0.0


def rates(values: Float64, seconds: Float64) -> Float64:
    """Rates of change of values (N, T) at times (T,): of the parabola through three, of the line at the ends of a run.

    NaN where the value is; 0 for a value without neighbours.
    """
    step = np.diff(seconds)
    slope = np.diff(values, axis=1) / step
    before, after = (np.pad(slope, ((0, 0), each), constant_values=np.nan) for each in ((1, 0), (0, 1)))
    early, late = np.pad(step, (1, 0), constant_values=1.0), np.pad(step, (0, 1), constant_values=1.0)
    both = (early * after + late * before) / (early + late)
    either = np.where(np.isnan(before), after, np.where(np.isnan(after), before, both))
    return np.where(np.isnan(values), np.nan, np.nan_to_num(either, nan=0.0))


@dataclass(frozen=True)
class SurroundingTraffic:
    """All objects of a scenario (N) at all timesteps (T), NaN while they are not observed.

    Attributes:
        x, y, heading: The middle of their boxes [m, rad].
        vx, vy: Velocity along their heading, in the scenario frame [m/s].
        speed, accel, jerk: Along their heading; the derivatives are those of speed [m/s, m/s^2, m/s^3].
        length, width: [m].
        moves: (N,) whether the object is of a kind that moves.
        seconds: (T,) times [s].
        lanes: Lanes of the map.
        crosswalks: (C,) polygons.
    """

    x: Float64
    y: Float64
    heading: Float64
    vx: Float64
    vy: Float64
    speed: Float64
    accel: Float64
    jerk: Float64
    length: Float64
    width: Float64
    moves: Bool
    seconds: Float64
    lanes: LaneAreas
    crosswalks: Array

    @classmethod
    def of(cls, scenario: ScenarioDescription) -> Self:
        """Read a scenario."""
        tracks = scenario.tracks

        def observed(values: Array) -> Float64:
            return np.where(tracks.valid, values.astype(np.float64), np.nan)

        heading = observed(tracks.heading)
        cos, sin = np.cos(heading), np.sin(heading)
        vx, vy = (tracks.velocity[..., axis].astype(np.float64) for axis in (0, 1))
        speed = vx * cos + vy * sin
        accel = rates(speed, scenario.timestamps)
        return cls(
            observed(tracks.position[..., 0]), observed(tracks.position[..., 1]), heading, speed * cos, speed * sin,
            speed, accel, rates(accel, scenario.timestamps),
            observed(tracks.size[..., 0]), observed(tracks.size[..., 1]),
            np.isin(tracks.object_type, _MOVERS), scenario.timestamps, LaneAreas(scenario.map),
            _crosswalks(scenario.map),
        )  # fmt: skip

    @cached_property
    def outlines(self) -> Array:
        """Boxes (N, T) as polygons, None while not observed."""
        found = np.full(self.x.shape, None, dtype=object)
        seen = np.isfinite(self.x)
        middle = np.stack([self.x[seen], self.y[seen]], axis=-1)
        found[seen] = shapely.polygons(box_corners(middle, self.heading[seen], self.length[seen], self.width[seen]))
        return found

    @cached_property
    def driven(self) -> list[Int64]:
        """For each object the lanes that hold it and lead its way, in order of time, the nearest first."""
        held = self.lanes.held(self.x, self.y, self.heading)
        ends = np.searchsorted(held.at, np.arange(1, len(self.x)) * self.x.shape[1])
        return np.split(held.lane, ends)

    @cached_property
    def neighbourhoods(self) -> Bool:
        """Lanes that boxes touch, and those before and after: (N, T, lanes)."""
        return self.lanes.neighbourhood(self.outlines)


def _crosswalks(features: MapFeatures | None) -> Array:
    rows = [] if features is None else np.flatnonzero(features.feature_type == MapFeatureType.CROSSWALK).tolist()
    areas = [features.polygon[row][:, :2].astype(np.float64) for row in rows] if features is not None else []
    return np.array([shapely.make_valid(shapely.polygons(area)) for area in areas if len(area) > 2], dtype=object)


@dataclass(frozen=True)
class Meeting:
    """An object among the others: what measures are functions of. Arrays are (N, T), with the object itself a row.

    Attributes:
        traffic: All objects.
        row: The object.
        limits: Assumptions.
        found: Measures that were computed.
    """

    traffic: SurroundingTraffic
    row: int
    limits: Assumptions = field(default_factory=Assumptions)
    found: dict[str, Float64] = field(default_factory=dict)

    def own(self, values: Float64) -> Float64:
        """Return the object's values (1, T) of values (N, T)."""
        return values[self.row : self.row + 1]

    @cached_property
    def is_met(self) -> Bool:
        """Whether object and other are both observed."""
        seen = np.isfinite(self.traffic.x)
        met: Bool = seen & seen[self.row]
        met[self.row] = False
        return met

    @cached_property
    def chain(self) -> list[int]:
        """The lanes that the object drives, see :meth:`.LaneAreas.chain`."""
        return self.traffic.lanes.chain(self.traffic.driven[self.row])

    @cached_property
    def path(self) -> DrivenPath | None:
        """The path along these lanes; None without a lane."""
        return self.traffic.lanes.path(self.chain) if self.chain else None

    @cached_property
    def _places(self) -> tuple[Float64, Float64, Float64]:
        if self.path is None:
            nowhere = np.full_like(self.traffic.x, np.nan)
            return nowhere, nowhere, nowhere
        return self.path.places(self.traffic.x, self.traffic.y)

    @property
    def s(self) -> Float64:
        """Places along the path [m], NaN beyond it."""
        return self._places[0]

    @property
    def d(self) -> Float64:
        """Places to the left of the path [m]."""
        return self._places[1]

    @cached_property
    def turn(self) -> Float64:
        """Headings relative to the path [rad]."""
        return self.traffic.heading - self._places[2]

    @cached_property
    def is_on_same_lane(self) -> Bool:
        """Whether lanes that the boxes touch, or lanes before or after them, are the same."""
        lanes = self.traffic.neighbourhoods
        same: Bool = (lanes & lanes[self.row]).any(axis=2)
        return same
