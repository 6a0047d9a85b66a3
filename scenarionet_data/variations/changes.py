"""Apply the values of parameters to a scenario: pure functions over the arrays of its tracks.

Every change keeps positions, velocities and headings consistent. Frames and units are those of the scenario.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, IntP
from scenarionet_data.arrays.geometry import estimate_velocity, rotate, wrap_angle
from scenarionet_data.building.tracks import METRES, RADIANS, rounded
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.scenario.description import ScenarioDescription, strings
from scenarionet_data.scenario.vocabulary import ObjectType
from scenarionet_data.variations.parameters import CHANGES, FRICTION, LIGHTS, ROAD

DRIFT_TIME = 3.0
"""Time in which a drift or a delay grows from 0, at the current timestep, to its value [s]."""

KINDS = (
    (ObjectType.VEHICLE, (4.6, 1.9, 1.6), 70.0),
    (ObjectType.VEHICLE, (12.0, 2.55, 3.8), 36.0),
    (ObjectType.CYCLIST, (1.8, 0.6, 1.7), 20.0),
    (ObjectType.PEDESTRIAN, (0.6, 0.6, 1.75), 7.0),
)
"""What replaces a road user, by number from 1 on: car, lorry, cyclist, pedestrian; type, size [m], top speed [m/s]."""

MAX_EXTENSION = 30.0
"""Distance that a road user may be moved beyond the ends of its recorded path, straight on [m]."""

_ROAD_USERS = (ObjectType.VEHICLE, ObjectType.PEDESTRIAN, ObjectType.CYCLIST)
_TINY = 1e-3


@dataclass(frozen=True)
class VariedMotion:
    """The states of one track over the timesteps.

    Attributes:
        position: (T, 3) [m].
        heading: (T,) [rad], not wrapped.
        velocity: (T, 2) [m/s].
        size: (T, 3) float32 [m].
        valid: (T,).
        time: (T,) [s].
        now: The current timestep.
    """

    position: Float64
    heading: Float64
    velocity: Float64
    size: Float32
    valid: Bool
    time: Float64
    now: int


_NO_ROLES: Mapping[str, str] = {}


def find_track(scenario: ScenarioDescription, target: str, roles: Mapping[str, str] = _NO_ROLES) -> int:
    """Return the row of ``ego``, of ``nearest`` (the road user closest to the ego now), of a role, or of a track id.

    Raises:
        InvalidScenario: The scenario has no such track.
    """
    tracks, now, target = scenario.tracks, scenario.current_timestep, roles.get(target, target)
    if target == "ego":
        return scenario.ego_index
    if target == "nearest":
        away = np.hypot(*(tracks.position[:, now, :2] - tracks.position[scenario.ego_index, now, :2]).T)
        is_other = tracks.valid[:, now] & np.isin(tracks.object_type, _ROAD_USERS)
        is_other[scenario.ego_index] = False
        if is_other.any():
            return int(np.where(is_other, away, np.inf).argmin())
        raise InvalidScenario(
            scenario.id, "actor", "wanted a road user near the ego at the current timestep, found none"
        )
    if target not in set(tracks.ids):
        named = ", ".join(tracks.ids[:5])
        raise InvalidScenario(scenario.id, "actor", f"wanted a track {target!r}, found {len(tracks)}: {named}, ...")
    return tracks.index(target)


def change(
    scenario: ScenarioDescription, values: Mapping[str, float], roles: Mapping[str, str] = _NO_ROLES
) -> tuple[ScenarioDescription, IntP]:
    """Apply parameters to a scenario.

    Args:
        scenario: The scenario.
        values: By name.
        roles: Tracks by other names that targets may have.

    Returns:
        The scenario, of the same id, and for each of its rows of tracks the row of the parent that it comes from
        unchanged, or ``-1 - row`` if it was changed.

    Raises:
        InvalidScenario: It has no such road user, or a changed one would leave its recorded path too far or never be.
    """
    by_target: dict[int, dict[str, float]] = {}
    lights, extras = scenario.lights, scenario.extras
    for name, value in values.items():
        target, _, word = name.rpartition(".")
        if target == LIGHTS:
            lights = replace(
                lights,
                state=lights.state[
                    :, np.abs((scenario.timestamps - value)[:, None] - scenario.timestamps[None]).argmin(axis=1)
                ],
            )
        elif target == ROAD:
            extras = {**extras, FRICTION: value * extras.get(FRICTION, 1.0)}
        else:
            by_target.setdefault(find_track(scenario, target, roles), {})[word] = value
    tracks = scenario.tracks
    rows, origins = list(range(len(tracks))), list(range(len(tracks)))
    motions: dict[int, VariedMotion] = {}
    types = tracks.object_type.copy()
    for row, changes in by_target.items():
        motion = _motion(scenario, row)
        for word in CHANGES:
            if word in changes and word in _OF_MOTION:
                motion = _OF_MOTION[word](motion, changes[word])
        kind = round(changes.get("replace", 0.0))
        if kind:
            types[row], size, top = KINDS[kind - 1]
            fastest = float(np.hypot(*motion.velocity[motion.valid].T).max(initial=0.0))
            if fastest > top:
                reason = f"wanted at most {top:g} m/s of what replaces track {tracks.ids[row]}, found {fastest:.4g}"
                raise InvalidScenario(scenario.id, "speed", reason)
            motion = replace(motion, size=np.full_like(motion.size, size) * np.float32(changes.get("size", 1.0)))
        if kind or any(word in _OF_MOTION for word in changes):
            motions[row], origins[row] = motion, -1 - row
        if "copy" in changes:
            motions[len(rows)] = _started(motion, changes["copy"])
            rows.append(row)
            origins.append(-1 - row)
    for row, motion in motions.items():
        if not motion.valid.any():
            raise InvalidScenario(scenario.id, "valid", f"track {tracks.ids[rows[row]]} is at no timestep any more")
        _check_extension(scenario, rows[row], motion)
    kept = [row for row, k in enumerate(rows) if row >= len(tracks) or by_target.get(k, {}).get("remove", 0.0) < 0.5]
    parent = replace(scenario, tracks=replace(tracks, object_type=types), lights=lights, extras=extras)
    return _with_tracks(parent, rows, kept, motions), np.array(origins, np.intp)[kept]


def _motion(scenario: ScenarioDescription, row: int) -> VariedMotion:
    tracks = scenario.tracks
    valid, heading = tracks.valid[row], tracks.heading[row].astype(np.float64)
    heading[valid] = np.unwrap(heading[valid])
    position, velocity = tracks.position[row].astype(np.float64), tracks.velocity[row].astype(np.float64)
    return VariedMotion(
        position, heading, velocity, tracks.size[row], valid, scenario.timestamps, scenario.current_timestep
    )


def _at_times(motion: VariedMotion, times: Float64, rate: Float64 | float) -> VariedMotion:
    """The motion as it was at other times (T,), which pass ``rate`` times as fast; only between recorded states."""
    time, valid = motion.time, motion.valid
    if len(time) < 2:
        return motion
    before = np.searchsorted(time, times + 1e-9, side="right").clip(1, len(time) - 1) - 1
    share = (times - time[before]) / (time[before + 1] - time[before])
    share = np.where(np.abs(share - np.rint(share)) < 1e-6, np.rint(share), share)
    is_recorded = (share >= 0) & (share <= 1)
    is_recorded &= (valid[before] | (share == 1)) & (valid[before + 1] | (share == 0))

    def between(values: Float64) -> Float64:
        weight = share.reshape(-1, *[1] * (values.ndim - 1))
        first, second = values[before], values[before + 1]
        mixed: Float64 = np.where(weight == 1, second, first + weight * (second - first))
        return mixed

    nearest = np.where(share >= 0.5, before + 1, before)
    return replace(
        motion,
        position=between(motion.position),
        heading=between(motion.heading),
        velocity=between(motion.velocity) * np.reshape(rate, (-1, 1)),
        size=motion.size[nearest],
        valid=is_recorded & valid[nearest],
    )


def _paced(motion: VariedMotion, factor: float) -> VariedMotion:
    """Time passes ``factor`` times as fast, around the current timestep."""
    now = motion.time[motion.now]
    return _at_times(motion, now + factor * (motion.time - now), factor)


def _started(motion: VariedMotion, delay: float) -> VariedMotion:
    """Everything happens ``delay`` seconds later."""
    return _at_times(motion, motion.time - delay, 1.0)


def _delayed(motion: VariedMotion, delay: float) -> VariedMotion:
    """Falls behind its recording by a time that grows by the polynomial of least jerk."""
    behind, rate = _growth(motion)
    if abs(delay) * rate.max() > 1.0:
        most = DRIFT_TIME / 1.875
        raise InvalidScenario("", "delay", f"a delay of {delay:.4g} s in {DRIFT_TIME:g} s; wanted at most {most:g} s")
    return _at_times(motion, motion.time - delay * behind, 1.0 - delay * rate)


def _growth(motion: VariedMotion) -> tuple[Float64, Float64]:
    """The polynomial of least jerk, from 0 at the current timestep to 1 (T,), and its rate [1/s]."""
    part = ((motion.time - motion.time[motion.now]) / DRIFT_TIME).clip(0, 1)
    return part**3 * (10 - 15 * part + 6 * part**2), 30.0 * part**2 * (1.0 - part) ** 2 / DRIFT_TIME


def _along_path(motion: VariedMotion, factor: float, ahead: float) -> VariedMotion:
    """The same path, ``factor`` times as fast around the current timestep, and ``ahead`` metres further on."""
    rows = np.flatnonzero(motion.valid)
    position, heading = motion.position[rows], motion.heading[rows]
    steps = np.hypot(*np.diff(position[:, :2], axis=0).T)
    travelled = np.concatenate([[0.0], np.cumsum(steps)])
    knots = np.concatenate([[True], steps > _TINY])
    place = travelled[knots]
    pivot = travelled[min(int(np.searchsorted(rows, motion.now)), len(rows) - 1)]
    wanted = pivot + factor * (travelled - pivot) + ahead
    inside = wanted.clip(place[0], place[-1])
    moved = np.stack([np.interp(inside, place, column) for column in position[knots].T], axis=1)
    turned = np.interp(inside, place, heading[knots])
    way = motion.velocity[rows]
    speed = np.hypot(*way.T)
    sense = np.where((way * np.stack([np.cos(heading), np.sin(heading)], axis=1)).sum(axis=1) < 0, -1.0, 1.0)
    direction = np.stack([np.cos(turned), np.sin(turned)], axis=1)
    moved[:, :2] += (wanted - inside)[:, None] * sense[:, None] * direction
    changed = replace(
        motion, position=motion.position.copy(), heading=motion.heading.copy(), velocity=motion.velocity * 0
    )
    changed.position[rows], changed.heading[rows] = moved, turned
    is_moving = speed > _TINY
    changed.velocity[rows] = np.where(is_moving[:, None], factor * rotate(way, turned - heading), 0.0)
    return changed


def _aside(motion: VariedMotion, left: Float64) -> VariedMotion:
    """Moved to the left of its heading by ``left`` (T,) metres."""
    aside = left[:, None] * np.stack([-np.sin(motion.heading), np.cos(motion.heading)], axis=1)
    rate = estimate_velocity(aside[None], motion.valid[None], motion.time)[0]
    sideways = np.gradient(left, motion.time) if len(left) > 1 else left * 0
    speed = np.hypot(*motion.velocity.T)
    position = motion.position.copy()
    position[:, :2] += aside
    heading = motion.heading + np.where(speed > 0.5, np.arctan2(sideways, np.maximum(speed, 0.5)), 0.0)
    return replace(motion, position=position, velocity=motion.velocity + rate, heading=heading)


def _drifted(motion: VariedMotion, left: float) -> VariedMotion:
    """Moved to the left by an amount that grows by the polynomial of least jerk."""
    return _aside(motion, left * _growth(motion)[0])


_OF_MOTION: Mapping[str, Callable[[VariedMotion, float], VariedMotion]] = {
    "pace": _paced,
    "start": _started,
    "delay": _delayed,
    "speed": lambda motion, factor: _along_path(motion, factor, 0.0),
    "gap": lambda motion, metres: _along_path(motion, 1.0, metres),
    "offset": lambda motion, left: _aside(motion, np.full(len(motion.time), left)),
    "drift": _drifted,
    "size": lambda motion, factor: replace(motion, size=motion.size * np.float32(factor)),
}


def _check_extension(scenario: ScenarioDescription, row: int, motion: VariedMotion) -> None:
    """Refuse a road user far beyond the places where it was recorded."""
    recorded = scenario.tracks.position[row][scenario.tracks.valid[row], :2].astype(np.float64)
    states = motion.position[motion.valid, :2]
    for state in (states[0], states[-1]):
        away = float(np.hypot(*(recorded - state).T).min())
        if away > MAX_EXTENSION:
            reason = f"track {scenario.tracks.ids[row]} would be {away:.0f} m from its recorded path, more than 30 m"
            raise InvalidScenario(scenario.id, "path", reason)


def _with_tracks(
    scenario: ScenarioDescription, rows: list[int], kept: list[int], motions: Mapping[int, VariedMotion]
) -> ScenarioDescription:
    """The scenario with the tracks ``rows``, some of them with other motions, of which those ``kept`` remain."""
    old = scenario.tracks
    tracks = old.take(rows)
    for row, motion in motions.items():
        where = motion.valid[:, None]
        tracks.position[row] = np.where(where, rounded(motion.position, METRES), 0)
        tracks.velocity[row] = np.where(where, rounded(motion.velocity, METRES), 0)
        tracks.heading[row] = np.where(motion.valid, wrap_angle(rounded(wrap_angle(motion.heading), RADIANS)), 0)
        tracks.size[row] = np.where(where, motion.size, 0)
        tracks.valid[row] = motion.valid
        tracks.is_interpolated[row] &= motion.valid
    ids = strings(old.ids[parent] if row < len(old) else f"{old.ids[parent]}+copy" for row, parent in enumerate(rows))
    return scenario.with_tracks(replace(tracks, ids=ids).take(kept))
