"""Leave out of a Waymo message what cannot be: single states, tracks, lights and map features, and list it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64, Int64
from scenarionet_data.building import bridge_gaps
from scenarionet_data.building.plausible import (
    MAX_DISTANCE,
    MAX_MAP_DISTANCE,
    MAX_SIZE,
    MAX_SPEED,
    find_bad_geometry,
    find_bad_rows,
    find_middle,
)
from scenarionet_data.converters.waymo.wire import WaymoWireMap, WireLights, WireScenario, WireTracks
from scenarionet_data.errors import InvalidScenario
from scenarionet_data.ingest.defects import Defects

_MAX_SPEED_LIMIT = 200.0
"""[mph]"""


@dataclass(frozen=True, eq=False)
class UsableTracks:
    """The usable tracks and states of a message.

    Attributes:
        tracks: N tracks over T steps.
        ego: Row of the ego.
        is_interpolated: (N, T) states of the ego that were dropped and are interpolated.
    """

    tracks: WireTracks
    ego: int
    is_interpolated: Bool


def usable_tracks(message: WireScenario, file: str, scenario_id: str, defects: Defects) -> UsableTracks:
    """Drop incomplete and repeated tracks, and states that no road user can have.

    Args:
        message: The message.
        file: Its file, for ``defects``.
        scenario_id: The scenario, for errors.
        defects: Collects what is dropped or assumed.

    Raises:
        InvalidScenario: The ego cannot be read.
    """
    tracks, steps = message.tracks, len(message.timestamps)
    ego = _row_of_ego(message, scenario_id)
    for name, count in tracks.incomplete:
        reason = f"expected {steps} states, found {count}"
        defects.drop("tracks", file, [f"track {name}"] * max(count, 1), "states", reason)
    is_first = np.zeros(len(tracks.ids), np.bool_)
    is_first[np.unique(tracks.ids, return_index=True)[1]] = True
    is_first[tracks.ids == tracks.ids[ego]] = False
    is_first[ego] = True
    is_kept = is_first
    again = [f"track {name}" for name, valid in zip(tracks.ids[~is_kept], tracks.valid[~is_kept], strict=True)
             for _ in range(max(int(valid.sum()), 1))]  # fmt: skip
    defects.drop("tracks", file, again, "id", "expected an id that no other track has, found one again")
    unknown = [f"track {name}" for name in tracks.ids[is_kept & ~tracks.is_type_known]]
    defects.assume("tracks", file, unknown, "object_type", "expected a type of 0 to 4, found another")
    valid = tracks.valid & is_kept[:, None]
    is_bad = _bad_states(tracks, valid, ego, file, defects)
    valid &= ~is_bad
    tracks, is_filled = _complete_ego(replace(tracks, valid=valid), ego, is_bad[ego], message.timestamps)
    reason = "expected usable states of the ego, found others, which are interpolated"
    defects.assume("tracks", file, [f"step {step}" for step in np.flatnonzero(is_filled)], "center", reason)
    is_interpolated = np.zeros(valid.shape, np.bool_)
    is_interpolated[ego] = is_filled
    rows = np.flatnonzero(is_kept)
    return UsableTracks(_take(tracks, rows), int(np.searchsorted(rows, ego)), is_interpolated[rows])


def _row_of_ego(message: WireScenario, scenario_id: str) -> int:
    number, tracks = message.sdc_track_index, message.tracks
    if not 0 <= number < tracks.total:
        wanted = f"expected a track, 0 to {tracks.total - 1}"
        raise InvalidScenario(scenario_id, "sdc_track_index", f"{wanted}, found {number if number >= 0 else 'none'}")
    rows = np.flatnonzero(tracks.row == number)
    if not len(rows):
        wanted = f"expected {len(message.timestamps)} states of the ego, track {number}"
        raise InvalidScenario(scenario_id, "tracks.states", f"{wanted}, found another number")
    return int(rows[0])


def _bad_states(tracks: WireTracks, valid: Bool, ego: int, file: str, defects: Defects) -> Bool:
    """(N, T) valid states that cannot be."""
    is_bad = np.zeros_like(valid)
    if _is_all_plausible(tracks, valid):  # nearly always, and three times as fast
        return is_bad
    rows, steps = np.nonzero(valid)
    reference = find_middle(tracks.center[ego, valid[ego], :2])
    center, heading = tracks.center[rows, steps], tracks.heading[rows, steps]
    for mask, field, reason in find_bad_rows(
        center, heading, tracks.velocity[rows, steps], tracks.size[rows, steps], reference
    ):
        is_bad[rows[mask], steps[mask]] = True
        names = zip(tracks.ids[rows[mask]], steps[mask], strict=True)
        defects.drop("tracks", file, [f"track {name} step {step}" for name, step in names], field, reason)
    return is_bad


def _is_all_plausible(tracks: WireTracks, valid: Bool) -> bool:
    """Whether ``find_bad_rows`` finds nothing whatever the reference; False for NaN."""
    if not valid.any():
        return True
    with np.errstate(invalid="ignore", over="ignore"):
        size, center = tracks.size[valid], tracks.center[valid]
        fits = size.min() > 0 and size.max() <= MAX_SIZE and np.abs(tracks.velocity[valid]).max() <= MAX_SPEED
        # Two points are at most twice as far from each other as each from the first.
        fits = fits and np.abs(center - center[:1]).max() <= MAX_DISTANCE / 2 and abs(center[0, 2]) <= MAX_DISTANCE / 2
        return bool(fits and np.isfinite(tracks.heading[valid]).all())


def _complete_ego(tracks: WireTracks, ego: int, is_bad: Bool, times: Float64) -> tuple[WireTracks, Bool]:
    """Interpolate the ego's states that were dropped; also returns (T,) which."""
    parts = ("center", "size", "velocity", "heading")
    states = np.column_stack([getattr(tracks, name)[ego] for name in parts])
    states, filled = bridge_gaps(times, tracks.valid[ego], states, angle=8)
    filled &= is_bad
    if filled.any():
        tracks = replace(tracks, **{name: getattr(tracks, name).copy() for name in parts})
        tracks.center[ego, filled], tracks.size[ego, filled] = states[filled, :3], states[filled, 3:6]
        tracks.velocity[ego, filled], tracks.heading[ego, filled] = states[filled, 6:8], states[filled, 8]
        tracks.valid[ego] |= filled
    return tracks, filled


def _take(tracks: WireTracks, rows: Int64) -> WireTracks:
    names = ("row", "ids", "types", "is_type_known", "center", "size", "heading", "velocity", "valid")
    if len(rows) == len(tracks.ids):
        return tracks
    return replace(tracks, **{name: getattr(tracks, name)[rows] for name in names})


def usable_lights(lights: WireLights, num_steps: int, origin: Float64, file: str, defects: Defects) -> WireLights:
    """Drop lights after the last step; unknown states and stop points that cannot be are flagged as such.

    Args:
        lights: As decoded.
        num_steps: T.
        origin: (3,) of the scenario [m].
        file, defects: As for :func:`usable_tracks`.
    """
    is_late = lights.step >= num_steps
    if is_late.any():
        names = [
            f"lane {lane} step {step}" for lane, step in zip(lights.lane[is_late], lights.step[is_late], strict=True)
        ]
        defects.drop("lights", file, names, "dynamic_map_states", f"expected {num_steps} steps, found more")
        lights = replace(lights, **{name: values[~is_late] for name, values in vars(lights).items()})
    unknown = [f"lane {lane}" for lane in lights.lane[~lights.is_state_known]]
    defects.assume("lights", file, unknown, "state", "expected a state of 0 to 8, found another")
    with np.errstate(invalid="ignore"):
        is_far = np.asarray((np.abs(lights.stop_point - origin) > MAX_DISTANCE).any(axis=1))
    if is_far.any():
        names = [f"lane {lane}" for lane in lights.lane[is_far]]
        reason = f"expected a stop point within {MAX_DISTANCE:,.0f} m of the ego, found another, which is left out"
        defects.assume("lights", file, names, "stop_point", reason)
        lights = replace(lights, stop_point=np.where(is_far[:, None], np.nan, lights.stop_point))
    return lights


def find_bad_features(features: WaymoWireMap, file: str, defects: Defects) -> Bool:
    """(M,) features with an id that another has, or with points that cannot be.

    Args:
        features: As decoded.
        file, defects: As for :func:`usable_tracks`.
    """
    is_bad = np.ones(len(features.ids), np.bool_)
    is_bad[np.unique(features.ids, return_index=True)[1]] = False
    names = [f"feature {name}" for name in features.ids[is_bad]]
    defects.drop("maps", file, names, "id", "expected an id that no other feature has, found one again")
    for row in _rows_with_bad_points(features):
        if not is_bad[row]:
            first = int(features.num_points[:row].sum())
            points = features.points[first : first + features.num_points[row]]
            reason = find_bad_geometry(points, find_middle(features.points))
            defects.drop("maps", file, [f"feature {features.ids[row]}"], "points", str(reason))
            is_bad[row] = True
    is_odd = ~((features.speed_limit >= 0) & (features.speed_limit <= _MAX_SPEED_LIMIT))
    names = [f"feature {name}" for name in features.ids[is_odd & ~is_bad]]
    reason = f"expected 0 to {_MAX_SPEED_LIMIT:.0f} mph, found another, which is left out"
    defects.assume("maps", file, names, "speed_limit_mph", reason)
    features.speed_limit[is_odd] = 0.0
    return is_bad


def _rows_with_bad_points(features: WaymoWireMap) -> list[int]:
    points = features.points
    if not len(points):
        return []
    with np.errstate(invalid="ignore", over="ignore"):
        if points.max() - points.min() <= MAX_MAP_DISTANCE:  # nearly always; False for NaN
            return []
        is_near = (np.abs(points[:, :2] - find_middle(points)) <= MAX_MAP_DISTANCE).all(axis=1)
    owner = np.repeat(np.arange(len(features.ids)), features.num_points)
    found: list[int] = np.unique(owner[~(is_near & np.isfinite(points).all(axis=1))]).tolist()
    return found
