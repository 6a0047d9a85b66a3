"""Put recorded states on timesteps of equal length: linear between adjacent recorded times, along the shorter arc."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenarionet_data.arrays.dtypes import Array, Bool, Float64, Int64, is_number
from scenarionet_data.arrays.geometry import wrap_angle
from scenarionet_data.building.tracks import make_tracks
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.description import ScenarioDescription, Tracks, check_scenario

_SAME_TIME = 1e-6
"""Times closer than this are the same [s]."""
_TOLERANCE = 0.05
"""Recorded times may be this many timesteps away from the regular ones (5 ms at 10 Hz) and are kept."""
EGO_GAP = 0.5
"""Longest time between usable rows of the ego between which it is interpolated [s]."""
_LONGEST_STEP = 1e4
"""Longest timestep [s]."""
_LONGEST_GAP = 1.0
"""Longest time between adjacent recorded times that is bridged [s], at least 1.5 timesteps of the recording."""


class Resampling:
    """Regular timesteps over recorded frames.

    A timestep between two frames that both observe an object is interpolated linearly. At the ends of an observation,
    a frame holds for half a timestep; ``between`` extrapolates that far. Gaps stay gaps.

    Args:
        times: (S,) [s] of the frames, strictly increasing from 0.
        seen: (N, S) whether a frame observes an object.
        step: Timestep [s].
        longest_gap: Longest time between two frames that is bridged [s].

    Attributes:
        timestamps: (T,) [s].
        frame: (T,) last frame at or before each timestep.
        valid: (N, T).
        is_interpolated: (N, T) valid states that are at no recorded time.
    """

    def __init__(self, times: Float64, seen: Bool, step: float, longest_gap: float) -> None:
        self.timestamps: Float64 = np.arange(round(float(times[-1]) / step) + 1, dtype=np.float64) * step
        before = np.searchsorted(times, self.timestamps + _SAME_TIME, side="right") - 1
        after = np.minimum(before + 1, len(times) - 1)
        since, span = self.timestamps - times[before], times[after] - times[before]
        since = np.where(np.abs(since) <= _SAME_TIME, 0.0, since)
        seen_before, seen_after, reach = seen[:, before], seen[:, after], step / 2.0 + _SAME_TIME
        bridged = seen_before & seen_after & (span > 0) & (span <= longest_gap)
        held_before = seen_before & (since <= reach) & ~bridged
        held_after = seen_after & (span - since <= reach) & ~bridged & ~held_before
        self.frame: Int64 = before
        self.valid: Bool = bridged | held_before | held_after
        fraction = np.divide(since, span, out=np.zeros_like(since), where=span > 0)
        self._first = np.where(held_after, after, before)
        self._second = np.where(bridged, after, self._first)
        self._share = np.where(bridged, fraction, 0.0)
        self._beyond = np.where(bridged, 0.0, np.where(held_after, since - span, since))
        self.is_interpolated: Bool = self.valid & ((self._share > 0) | (self._beyond != 0))

    def nearest(self, values: Array) -> Array:
        """Take values (N, S, ...) at the first of the frames that a timestep lies between, as (N, T, ...)."""
        return _take(values, self._first)

    def between(self, values: Array, slope: Array | None = None) -> Array:
        """Interpolate values (N, S, ...) as (N, T, ...); ``slope`` [1/s] extrapolates at the ends."""
        first = _take(values, self._first)
        found: Array = first + _over(self._share, first) * (_take(values, self._second) - first)
        return found if slope is None else found + _over(self._beyond, first) * _take(slope, self._first)

    def angle_between(self, angles: Float64) -> Float64:
        """Interpolate angles (N, S) [rad] along the shorter arc, as (N, T), not wrapped."""
        first = _take(angles, self._first)
        turned: Float64 = first + self._share * wrap_angle(_take(angles, self._second) - first)
        return turned


def resample(scenario: ScenarioDescription, dt: float | None = None) -> ScenarioDescription:
    """Return a scenario with timesteps of ``dt`` seconds; the same object if its timesteps are that already.

    Positions, velocities and headings are interpolated, and flagged in ``tracks.is_interpolated``. Sizes and lights
    are those of the last recorded timestep. Lists over timesteps in ``extras`` stay those of the recording.

    Args:
        scenario: The scenario.
        dt: Timestep [s]; ``scenario.dt`` by default, if steps differ.

    Raises:
        BadParameter: It is no scenario, or ``dt`` is not a time above 0.
    """
    check_scenario(scenario)
    dt = scenario.dt if dt is None else dt
    if not (is_number(dt) and 0.0 < dt <= _LONGEST_STEP):
        raise BadParameter(f"dt: expected a timestep above 0 s and up to {_LONGEST_STEP:g} s, found {dt!r}")
    times = scenario.timestamps
    if np.abs(times - np.arange(len(times)) * dt).max() <= _TOLERANCE * dt:
        return scenario
    steps = Resampling(times, scenario.tracks.valid, dt, max(_LONGEST_GAP, 1.5 * scenario.dt))
    current = round(float(times[scenario.current_timestep]) / dt)
    velocity = scenario.tracks.velocity.astype(np.float64)
    slope = np.concatenate([velocity, np.zeros((*velocity.shape[:2], 1))], axis=-1)
    made = make_tracks(
        scenario.tracks.ids.tolist(),
        scenario.tracks.object_type,
        steps.between(scenario.tracks.position.astype(np.float64), slope),
        steps.angle_between(scenario.tracks.heading.astype(np.float64)),
        steps.between(velocity),
        steps.nearest(scenario.tracks.size),
        steps.valid,
        origin=np.zeros(3),
        is_interpolated=steps.is_interpolated | steps.nearest(scenario.tracks.is_interpolated),
    )
    arrays = ("position", "heading", "velocity", "size", "valid", "is_interpolated")
    return replace(
        scenario,
        timestamps=steps.timestamps,
        dt=dt,
        current_timestep=min(current, len(steps.timestamps) - 1),
        tracks=replace(scenario.tracks, **{name: getattr(made, name) for name in arrays}),
        lights=replace(scenario.lights, state=scenario.lights.state[:, steps.frame]),
    )


def _take(values: Array, frames: Int64) -> Array:
    """Take values (N, S, ...) at each object's frames (N, T)."""
    rows = np.arange(len(values))[:, None] * values.shape[1]
    taken: Array = values.reshape(-1, *values.shape[2:]).take(rows + frames, axis=0)  # faster than take_along_axis
    return taken


def _over(factor: Float64, values: Array) -> Float64:
    """(N, T) factors in the shape of values (N, T, ...)."""
    return factor.reshape(*factor.shape, *[1] * (values.ndim - 2))


def bridge_gaps(
    times: Float64, known: Bool, values: Float64, angle: int | None = None, longest_gap: float = EGO_GAP
) -> tuple[Float64, Bool]:
    """Interpolate the ego where its rows cannot be used: the one rule of all converters.

    Args:
        times: (T,) [s].
        known: (T,) whether its row can be used.
        values: (T, C) of its rows; those of unknown rows are ignored.
        angle: Column of ``values`` with an angle [rad].
        longest_gap: Longest time between the two known rows around unknown ones [s].

    Returns:
        (T, C) values, NaN where unknown; and (T,) rows that are interpolated.
    """
    (rows,) = np.nonzero(known)
    after = np.searchsorted(rows, np.arange(len(times)))
    filled = ~known & (after > 0) & (after < len(rows))
    filled[filled] = times[rows[after[filled]]] - times[rows[after[filled] - 1]] <= longest_gap
    found = np.where(known[:, None], values, np.nan)
    for column in range(values.shape[1] if filled.any() else 0):
        told = values[known, column].astype(np.float64)
        found[filled, column] = np.interp(times[filled], times[known], np.unwrap(told) if column == angle else told)
    return found, filled


def cut_steps(scenario: ScenarioDescription, steps: slice) -> ScenarioDescription:
    """Return a scenario during some timesteps, without road users that are not there then.

    Args:
        scenario: The scenario; its ``current_timestep`` has to be one of them.
        steps: Which timesteps, each of them.
    """
    time, first = scenario.timestamps[steps], range(scenario.num_timesteps)[steps].start
    kept = np.flatnonzero(scenario.tracks.valid[:, steps].any(axis=1))
    arrays = {name: getattr(scenario.tracks, name)[kept] for name in Tracks.__dataclass_fields__}
    tracks = Tracks(**{name: each[:, steps] if each.ndim > 1 else each for name, each in arrays.items()})
    return replace(
        scenario.with_tracks(tracks),
        timestamps=time - time[0],
        current_timestep=scenario.current_timestep - first,
        lights=replace(scenario.lights, state=scenario.lights.state[:, steps]),
    )
