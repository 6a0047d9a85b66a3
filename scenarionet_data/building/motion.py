"""Estimate motion from noisy positions at uneven times: at these times, or at 10 Hz.

Positions of a tracker, as in Argoverse 1, scatter by about 0.1 m, freeze and catch up, and sometimes jump by metres.
Finite differences would be mostly noise, so velocities are slopes of lines fitted to one second.

Points and velocities in the plane are complex numbers x + iy: half the array operations, twice the speed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Complex128, Float64, Int64
from scenarionet_data.building.motion_kernels import fit_slopes
from scenarionet_data.building.resampling import Resampling

DT = 0.1
"""Nominal timestep [s]."""
_HALF_FRAMES = 5
_HALF_WINDOW = 0.55
"""Maximum frames and seconds of a fit on each side; the adjacent frames are always used."""
_JUMP = 30.0
"""A step this much faster than the adjacent ones is a jump [m/s]; lines are not fitted across jumps."""
_SCATTER = 0.1
"""Standard deviation of positions [m], the median over 645 recorded tracks."""
_MOVING = 1.0
"""Speed below which the direction of motion does not determine the heading [m/s]."""
_LONGEST_STEP = 0.5
"""Longest gap between recorded times that is interpolated [s] (up to 0.47 in recordings with lost frames)."""


@dataclass(frozen=True, eq=False)
class Motion:
    """Tracks on T timesteps.

    Attributes:
        timestamps: (T,) [s].
        position: (N, T, 2) [m].
        velocity: (N, T, 2) [m/s].
        course: (N, T) [rad] direction of motion; at standstill that of the nearest motion in time.
        has_course: (N,) whether it ever moves; otherwise its course is 0.
        valid: (N, T).
        is_interpolated: (N, T) states between recorded times.
    """

    timestamps: Float64
    position: Float64
    velocity: Float64
    course: Float64
    has_course: Bool
    valid: Bool
    is_interpolated: Bool


def estimate_motion(
    track: Int64,
    frame: Int64,
    position: Float64,
    times: Float64,
    frames: Literal["recorded", "resampled"],
    is_interpolated: Bool,
) -> Motion:
    """Estimate the motion of tracks recorded at uneven times.

    Args:
        track, frame: (R,) sorted by track, then by frame.
        position: (R, 2) [m].
        times: (S,) [s] of each frame, from 0.
        frames: ``recorded`` for timesteps at ``times``, ``resampled`` for timesteps of 0.1 s.
        is_interpolated: (R,) rows that the file lacks.
    """
    shape = (int(track[-1]) + 1, len(times))
    points = position[:, 0] + 1j * position[:, 1]
    place = np.zeros(shape, np.complex128)
    place[track, frame] = points
    piece = np.full(shape, -1)
    same = track[1:] == track[:-1]  # tracks are cut into pieces at jumps
    step = np.divide(np.diff(points), np.diff(times[frame]), out=np.zeros(len(same), np.complex128), where=same)
    has_before, has_after = same & np.roll(same, 1), same & np.roll(same, -1)
    has_before[:1], has_after[-1:] = False, False
    # At the ends of a track the inner step replaces the missing one, so that jumps there are found too.
    before = np.where(has_before, np.roll(step, 1), np.where(has_after, np.roll(step, -1), step))
    after = np.where(has_after, np.roll(step, -1), before)
    usual = _middle(before.real, step.real, after.real) + 1j * _middle(before.imag, step.imag, after.imag)
    piece[track, frame] = np.concatenate([[0], np.cumsum((np.abs(step - usual) > _JUMP) | ~same)])
    seen, filled = piece >= 0, np.zeros(shape, np.bool_)
    filled[track, frame] = is_interpolated
    velocity, certainty = np.zeros_like(place), np.zeros(shape)
    fit_slopes(place, piece, times, _HALF_FRAMES, _HALF_WINDOW, velocity, certainty)
    velocity = _from_nearest(velocity, certainty > 0)
    speed = np.abs(velocity)
    is_moving = seen & (speed > _MOVING) & (speed * certainty > 3.0 * _SCATTER)
    has_course = np.asarray(is_moving.any(axis=1))
    ahead = _from_nearest(velocity, is_moving)
    if frames == "recorded":
        course = np.where(has_course[:, None], np.angle(ahead), 0.0)
        return Motion(times, _xy(place), _xy(velocity), course, has_course, seen, filled)
    steps = Resampling(times, seen, DT, _LONGEST_STEP)
    return Motion(
        timestamps=steps.timestamps,
        position=_xy(steps.between(place, velocity)),
        velocity=_xy(steps.between(velocity)),
        course=np.where(has_course[:, None], np.angle(steps.between(ahead)), 0.0),
        has_course=has_course,
        valid=steps.valid,
        is_interpolated=steps.is_interpolated | (steps.valid & steps.nearest(filled)),
    )


def _xy(points: Complex128) -> Float64:
    """Complex points as coordinates (..., 2)."""
    return points.view(np.float64).reshape(*points.shape, 2)


def _middle(a: Float64, b: Float64, c: Float64) -> Float64:
    """Median of three."""
    return np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))


def _from_nearest(values: Complex128, known: Bool) -> Complex128:
    """Replace unknown values (N, S) by those of the nearest known frame of the track."""
    here, far = np.arange(known.shape[1]), 2 * known.shape[1]
    last = np.maximum.accumulate(np.where(known, here, -far), axis=1)
    following = np.minimum.accumulate(np.where(known, here, far)[:, ::-1], axis=1)[:, ::-1]
    nearest = np.where(here - last <= following - here, last, following)
    rows = np.arange(len(values))[:, None] * values.shape[1]
    nearest = np.where((nearest < 0) | (nearest >= known.shape[1]), here, nearest)
    taken: Complex128 = values.ravel().take(rows + nearest)  # faster than take_along_axis
    return taken


def step_of(time: float) -> int:
    """Return the timestep of 0.1 s nearest to a time [s]."""
    return round(float(time) / DT)
