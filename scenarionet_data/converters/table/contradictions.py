"""Find what a table of tracks says twice, and differently: degrees for metres, feet, swapped axes, another frame.

Positions over time say how fast and in which direction road users move. Where recorded speeds, headings, sizes or the
map say something else of most of them, the table is not read as it was meant; what would fit is said, not assumed.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.arrays.dtypes import Bool, Float64
from scenarionet_data.converters.table.columns import LENGTHS, SPEEDS
from scenarionet_data.converters.table.rows import FrameClock, TrackRows
from scenarionet_data.scenario.vocabulary import ObjectType

_MOVING = 2.0
"""Speed [m/s] from which the direction of motion is clear."""
_FEWEST = 20
"""States in motion below which nothing is compared."""
_WRONG, _RIGHT = np.pi / 9.0, np.pi / 18.0
"""Angle between heading and motion, which a quarter exceeds, of a wrong table, and of a reading that fits [rad]."""
_SMALLEST = 0.5
"""Extent of a recording with tracks [m], below which it cannot be in metres."""
_NEAR = 50.0
"""Distance from the map's box within which a road user is on it [m]."""


def find_contradictions(rows: TrackRows, clock: FrameClock, bounds: Float64 | None) -> list[str]:
    """Return a sentence for each contradiction, with what would fit.

    Args:
        rows: The rows.
        clock: Their times.
        bounds: (M, 4) min_x, min_y, max_x, max_y [m] of the features of the map; None without one.
    """
    found = []
    extent = float(np.ptp(rows.position, axis=0).max())
    if len(rows.line) > _FEWEST and extent < _SMALLEST and (np.abs(rows.position) <= 180.0).all():
        found.append(f'all positions are within {extent:.3g} m: x and y may be degrees (unit = "deg")')
        return found
    found += _sizes(rows)
    same = np.diff(rows.track) == 0
    first = int(rows.frame.min())
    seconds = clock.timestamps(first, int(rows.frame.max()) + 1)[rows.frame - first]
    with np.errstate(over="ignore"):  # times that are next to each other
        step = np.diff(rows.position, axis=0)[same] / np.diff(seconds)[same, None]
    before = np.flatnonzero(same)
    speed = np.hypot(*step.T)
    is_moving = (speed > _MOVING) & (np.diff(rows.frame)[same] == 1)
    if rows.has_velocities.any() and is_moving.sum() >= _FEWEST:
        found += _speeds(speed[is_moving], np.hypot(*rows.velocity[before[is_moving]].T))
        found += _directions("vx, vy", _angles(rows.velocity[before[is_moving]]), step[is_moving], is_angle=False)
    if is_moving.sum() >= _FEWEST:
        found += _directions("heading", rows.heading[before[is_moving]], step[is_moving], is_angle=True)
    return found + (_places(rows.position, bounds) if bounds is not None else [])


def _sizes(rows: TrackRows) -> list[str]:
    is_vehicle = (rows.kinds == ObjectType.VEHICLE)[rows.track] & rows.has_sizes[rows.track]
    if not is_vehicle.any():
        return []
    length, width, _ = np.median(rows.size[is_vehicle], axis=0)
    if width > length:
        return [f"vehicles are {length:.3g} m long and {width:.3g} m wide: length and width may be swapped"]
    if length > 10.0 or length < 1.5:
        return [f"half of the vehicles are {'more' if length > 10 else 'less'} than {length:.3g} m long: "
                f"is the unit of length {_unit(4.5 / length, LENGTHS)}?"]  # fmt: skip
    return []


def _speeds(moved: Float64, recorded: Float64) -> list[str]:
    """Compare speeds from positions with recorded ones."""
    factor = float(np.median(moved)) / max(float(np.median(recorded)), 1e-9)
    if 0.8 < factor < 1.25:
        return []
    units = f"{_unit(factor, SPEEDS)}, or that of x and y {_unit(1.0 / factor, LENGTHS)}, or that of time another"
    return [f"road users move {factor:.3g} times as fast as vx, vy or speed say: is their unit {units}?"]


def _unit(factor: float, units: dict[str, float]) -> str:
    """The unit whose factor is nearest."""
    return min(units, key=lambda unit: abs(np.log(units[unit] / factor)))


def _angles(vectors: Float64) -> Float64:
    return np.arctan2(vectors[:, 1], vectors[:, 0])


def _directions(name: str, heading: Float64, step: Float64, is_angle: bool) -> list[str]:
    """Compare headings with the direction of motion, and name the first reading that fits if they do not."""
    if _off(heading, step) < _WRONG:
        return []
    readings = {
        "x and y may be swapped": (heading, step[:, ::-1]),
        "y may point right or down": (heading, step * np.array([1.0, -1.0])),
        "it may point backwards": (heading + np.pi, step),
    }
    if is_angle and np.abs(heading).max() > 2.0 * np.pi:
        readings = {
            'its unit may be degrees (unit = "deg")': (np.radians(heading), step),
            'it may be clockwise from north in degrees (unit = "compass")': (np.pi / 2.0 - np.radians(heading), step),
            **readings,
        }
    elif is_angle:
        readings["it may be clockwise from north in radians"] = np.pi / 2.0 - heading, step
    fitting = [words for words, (angle, moved) in readings.items() if _off(angle, moved) < _RIGHT]
    off = np.degrees(_off(heading, step))
    return [f"{name} is {off:.0f} degrees or more off the motion of a quarter of all states: "
            f"{fitting[0] if fitting else 'no usual reading of it fits'}"]  # fmt: skip


def _off(heading: Float64, step: Float64) -> float:
    """Angle between headings and directions of motion that a quarter exceeds [rad]."""
    away = np.abs((heading - _angles(step) + np.pi) % (2.0 * np.pi) - np.pi)
    return float(np.quantile(away, 0.75))


def _places(position: Float64, bounds: Float64) -> list[str]:
    """Compare positions with the box of the map."""
    low, high = np.nanmin(bounds[:, :2], axis=0) - _NEAR, np.nanmax(bounds[:, 2:], axis=0) + _NEAR

    def share(points: Float64) -> float:
        inside: Bool = np.all((points >= low) & (points <= high), axis=1)
        return float(inside.mean())

    if share(position) >= 0.5:
        return []
    if share(position[:, ::-1]) > 0.9:
        return ["most road users are beside the map, and would be on it with x and y swapped"]
    away = (low + high) / 2.0 - np.median(position, axis=0)
    return [f"most road users are beside the map, whose middle is {away[0]:,.0f} m east and {away[1]:,.0f} m north of "
            "theirs: are both in one frame and unit (frame.origin, map.unit)?"]  # fmt: skip
