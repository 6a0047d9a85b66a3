"""The latest moments for an evasive manoeuvre of a point mass: Tamke, Dang and Breuel 2011."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Array, Bool, Float64
from scenarionet_data.arrays.geometry import box_corners, wrap_angle
from scenarionet_data.criticality.encounters import time_to_overlap
from scenarionet_data.criticality.registry import measure
from scenarionet_data.criticality.scene import Assumptions, Meeting

_STEERED = np.pi / 4  # [rad] how far a manoeuvre turns from the lane


@dataclass
class _Masses:
    """Point masses that begin a manoeuvre at one step of a trajectory each (T,).

    Attributes:
        x, y, vx, vy, ax, ay: Their states [m, m/s, m/s^2].
        heading: Of their boxes [rad].
    """

    x: Float64
    y: Float64
    vx: Float64
    vy: Float64
    ax: Float64
    ay: Float64
    heading: Float64

    def push(self, ax: Float64, ay: Float64, dt: float, limits: Assumptions) -> None:
        """Change the accelerations towards wanted ones as fast as jerk allows."""
        most, change = limits.axis_acceleration, limits.jerk * dt
        self.ax = np.minimum(np.maximum(ax, np.maximum(self.ax - change, -most)), np.minimum(self.ax + change, most))
        self.ay = np.minimum(np.maximum(ay, np.maximum(self.ay - change, -most)), np.minimum(self.ay + change, most))

    def moved(self, dt: float) -> tuple[Float64, Float64, Float64, Float64]:
        """Return places and velocities after a step at these accelerations."""
        return (
            self.x + self.vx * dt + 0.5 * self.ax * dt**2, self.y + self.vy * dt + 0.5 * self.ay * dt**2,
            self.vx + self.ax * dt, self.vy + self.ay * dt,
        )  # fmt: skip

    def place(self, which: Bool, states: tuple[Float64, Float64, Float64, Float64]) -> None:
        """Set places and velocities of some, and their headings along the velocities."""
        self.x, self.y, self.vx, self.vy = (
            np.where(which, new, old) for new, old in zip(states, (self.x, self.y, self.vx, self.vy), strict=True)
        )
        self.heading = np.where(which, np.arctan2(self.vy, self.vx), self.heading)


def _begin(scene: Meeting) -> _Masses:
    t, row = scene.traffic, scene.row
    cos, sin = np.cos(t.heading[row]), np.sin(t.heading[row])
    return _Masses(t.x[row], t.y[row], t.vx[row], t.vy[row], t.accel[row] * cos, t.accel[row] * sin, t.heading[row])


def _power(speed: Float64, limits: Assumptions) -> Float64:
    """Return the strongest acceleration of the engine at a speed."""
    with np.errstate(divide="ignore"):
        return limits.acceleration * np.minimum(1.0, limits.switch_speed / speed)


def _straight(scene: Meeting, sign: int, dt: float) -> tuple[Float64, Float64, Float64]:
    """Return places and headings (begin, step) of braking (-1) or accelerating (1) from each step on; NaN before."""
    limits, count = scene.limits, scene.traffic.x.shape[1]
    masses, start = _begin(scene), np.arange(count)
    wanted = sign * (
        np.full(count, limits.acceleration) if sign < 0 else _power(np.hypot(masses.vx, masses.vy), limits)
    )
    states = np.full((3, count, count), np.nan)
    ended = np.zeros(count, np.bool_)
    for step in range(count):
        runs = (start < step) & ~ended
        masses_before = masses.ax, masses.ay
        masses.push(wanted * np.cos(masses.heading), wanted * np.sin(masses.heading), dt, limits)
        masses.ax, masses.ay = (
            np.where(runs, new, old) for new, old in zip((masses.ax, masses.ay), masses_before, strict=True)
        )
        new = masses.moved(dt)
        speed = np.hypot(new[2], new[3])
        ended |= runs & ~((speed >= limits.least_speed) & (speed <= limits.top_speed))
        masses.place(runs & ~ended, new)
        for values, now in zip(states, (masses.x, masses.y, masses.heading), strict=True):
            values[:, step] = np.where(start <= step, now, np.nan)
    return states[0], states[1], states[2]


def _swerve(scene: Meeting, sign: int, dt: float) -> tuple[Float64, Float64, Float64]:
    """Return places and headings (begin, step) of steering to the left (1) or right (-1) from each step on.

    Out, back, and on along the lane: as long as it takes at the strongest lateral acceleration to go to the side.
    """
    limits, count = scene.limits, scene.traffic.x.shape[1]
    masses, start = _begin(scene), np.arange(count)
    push = sign * _power(np.hypot(masses.vx, masses.vy), limits)
    half = np.sqrt(4 * limits.steering_distance / np.abs(push)) / (2 * dt)
    length = np.where(np.isnan(half), 0, np.ceil(half - 1e-12))
    states = np.full((3, count, count), np.nan)
    stage, left = np.zeros(count, np.int64), length.copy()
    lane = np.full(count, np.nan)

    def looked() -> Float64:
        way = scene.path.places(masses.x, masses.y)[2] if scene.path is not None else np.full(count, np.nan)
        return np.where(np.isnan(way), lane, way)

    lane = looked()
    for step in range(count):
        runs = start < step
        if runs.any():
            steers = runs & (stage < 2)
            lane = np.where(runs & ~steers, looked(), lane)
            speed, before = np.hypot(masses.vx, masses.vy), (masses.ax, masses.ay)
            side = np.where(stage == 0, push, -push)
            goal = np.where(np.isnan(lane), masses.heading, lane)
            masses.push(
                np.where(steers, -side * np.sin(masses.heading), (speed * np.cos(goal) - masses.vx) / dt),
                np.where(steers, side * np.cos(masses.heading), (speed * np.sin(goal) - masses.vy) / dt), dt, limits,
            )  # fmt: skip
            masses.ax, masses.ay = (
                np.where(runs, new, old) for new, old in zip((masses.ax, masses.ay), before, strict=True)
            )
            masses.place(runs, masses.moved(dt))
            left = np.where(steers, left - 1, left)
            turned = sign * wrap_angle(masses.heading - goal)
            ends = steers & ((left <= 0) | (turned > _STEERED))
            lane = np.where(ends & (stage == 0), looked(), lane)
            stage, left = np.where(ends, stage + 1, stage), np.where(ends, length, left)
        for values, now in zip(states, (masses.x, masses.y, masses.heading), strict=True):
            values[:, step] = np.where(start <= step, now, np.nan)
    return states[0], states[1], states[2]


def _is_hit(scene: Meeting, way: tuple[Float64, Float64, Float64], rows: Array) -> Bool:
    """Return whether manoeuvres from each step hit each of some objects (others, begin)."""
    t, row = scene.traffic, scene.row
    x, y, heading = way
    hit = np.zeros((len(rows), len(x)), np.bool_)
    seen = np.isfinite(x)
    # Boxes farther apart than their diagonals do not meet.
    for index, other in enumerate(rows.tolist()):
        reach = 0.5 * (np.hypot(t.length[row], t.width[row]) + np.hypot(t.length[other], t.width[other]))
        begin, step = np.nonzero(seen & (np.hypot(x - t.x[other], y - t.y[other]) <= reach))
        own = box_corners(
            np.stack([x[begin, step], y[begin, step]], axis=-1),
            heading[begin, step],
            t.length[row][step],
            t.width[row][step],
        )
        touches = shapely.intersects(shapely.polygons(own), t.outlines[other][step])
        hit[index, begin[touches]] = True
    return hit


def _latest(scene: Meeting, way: Callable[[], tuple[Float64, Float64, Float64]]) -> Float64:
    """Return until when a manoeuvre avoids the other, by bisection between now and the collision as its authors do.

    Infinite without a collision, and minus infinite where it is too late already.
    """
    overlap, seconds = time_to_overlap(scene), scene.traffic.seconds
    result = np.where(overlap == 0, -np.inf, overlap)
    rows = np.flatnonzero((np.isfinite(overlap) & (overlap > 0)).any(axis=1))
    if not len(rows):
        return result
    for other, hit in zip(rows.tolist(), _is_hit(scene, way(), rows), strict=True):
        for step in np.flatnonzero(np.isfinite(overlap[other]) & (overlap[other] > 0)).tolist():
            low, high = step, int(np.searchsorted(seconds, seconds[step] + overlap[other, step] - 1e-9))
            while low < high:
                middle = (low + high) // 2
                low, high = (low, middle) if hit[middle] else (middle + 1, high)
            result[other, step] = seconds[low - 1] - seconds[step] if low > step else -np.inf
    return result


def _spacing(scene: Meeting) -> float:
    return float(np.median(np.diff(scene.traffic.seconds)))


@measure("ttb", "s", "min", "latest start of braking at 11.5 m/s^2 that avoids the collision", "Tamke et al. 2011")
def time_to_brake(scene: Meeting) -> Float64:
    """Time until which braking avoids the collision that the recorded trajectory ends in; -inf if it does no longer."""
    return _latest(scene, partial(_straight, scene, -1, _spacing(scene)))


@measure("ttk", "s", "min", "latest start of accelerating that avoids the collision", "Tamke et al. 2011")
def time_to_kickdown(scene: Meeting) -> Float64:
    """Time until which accelerating avoids the collision."""
    return _latest(scene, partial(_straight, scene, 1, _spacing(scene)))


@measure("tts", "s", "min", "latest start of steering 0.8 m to a side that avoids the collision", "Tamke et al. 2011")
def time_to_steer(scene: Meeting) -> Float64:
    """Time until which steering to the left or right avoids the collision."""
    left, right = (_latest(scene, partial(_swerve, scene, sign, _spacing(scene))) for sign in (1, -1))
    return np.maximum(left, right)


@measure("ttr", "s", "min", "max(ttb, ttk, tts)", "Tamke et al. 2011")
def time_to_react(scene: Meeting) -> Float64:
    """Time until which one of these manoeuvres avoids the collision; of the manoeuvre that can begin last (TTM)."""
    return np.maximum(np.maximum(time_to_brake(scene), time_to_kickdown(scene)), time_to_steer(scene))
