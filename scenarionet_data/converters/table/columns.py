"""What the columns of a table of tracks hold, and in which unit: ``columns.toml``.

[columns]                                        # a name, or a name with its unit; all but track, time, x, y may lack
track = "track_id"
time = {column = "timestamp_ms", unit = "ms"}
heading = {column = "yaw", unit = "compass"}     # degrees clockwise from north

[types]                                          # words of the column type
tram = "VEHICLE"

[sizes]                                          # length, width, height [m] of a type or word that has none recorded
tram = [30.0, 2.6, 3.4]

[time]
step = 0.1                                       # [s] between timesteps; without it, times that occur are timesteps

[frame]                                          # needed where x and y, or the map, are in degrees
origin = [50.78, 6.07]                           # latitude and longitude from which metres are measured

[map]
unit = "deg"                                     # of a GeoJSON map: m or deg (longitude, latitude)

[source]
licence = "CC0-1.0"
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building.projection import to_utm, utm_zone
from scenarionet_data.errors import BadParameter
from scenarionet_data.scenario.vocabulary import ObjectType

LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0, "ft": 0.3048, "in": 0.0254}
SPEEDS = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704, "ft/s": 0.3048, "kn": 1852.0 / 3600.0}
DEGREES, COMPASS = "deg", "compass"
_ANGLES = {"rad": 1.0, DEGREES: np.pi / 180.0, COMPASS: np.pi / 180.0}
_PLACES = {**LENGTHS, DEGREES: 1.0}
UNITS: Mapping[str, Mapping[str, float]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "x": _PLACES,
    "y": _PLACES,
    "z": LENGTHS,
    "vx": SPEEDS,
    "vy": SPEEDS,
    "speed": SPEEDS,
    "heading": _ANGLES,
    "length": LENGTHS,
    "width": LENGTHS,
    "height": LENGTHS,
}
"""Factors to SI units of the columns that hold numbers; the first unit is the default."""
TEXTS, NEEDED = ("track", "type"), ("track", "time", "x", "y")

TYPES = {
    **dict.fromkeys(("vehicle", "car", "van", "truck", "bus", "trailer", "motorcycle"), ObjectType.VEHICLE),
    **dict.fromkeys(("cyclist", "bicycle", "bike"), ObjectType.CYCLIST),
    **dict.fromkeys(("pedestrian", "person"), ObjectType.PEDESTRIAN),
}
"""Types of words, in small letters."""
SIZES: Mapping[str | ObjectType, tuple[float, float, float]] = {
    ObjectType.VEHICLE: (4.6, 1.9, 1.6),
    ObjectType.CYCLIST: (1.8, 0.7, 1.7),
    ObjectType.PEDESTRIAN: (0.6, 0.6, 1.7),
}
"""Length, width and height [m] where none is recorded."""


@dataclass(frozen=True)
class TableColumn:
    """Name of a column, and the unit of its numbers."""

    name: str
    unit: str = ""


@dataclass(frozen=True)
class TableColumns:
    """What the columns hold.

    Attributes:
        columns: Column of each quantity; of those that may lack, the table is used without a column that it has not.
        types: Type of each word.
        unsure: Words whose type is assumed.
        sizes: Length, width, height [m] by word or type, where none is recorded.
        step: Time between timesteps [s]; None: the times that occur are the timesteps.
        origin: Latitude and longitude [degrees] of the frame in metres; None if nothing is in degrees.
        map_unit: Unit of a GeoJSON map, m or deg.
        licence: Licence of the table.
    """

    columns: Mapping[str, TableColumn] = field(
        default_factory=lambda: {name: TableColumn(name) for name in (*TEXTS, *UNITS)}
    )
    types: Mapping[str, ObjectType] = field(default_factory=lambda: TYPES)
    unsure: frozenset[str] = frozenset()
    sizes: Mapping[str | ObjectType, tuple[float, float, float]] = field(default_factory=lambda: SIZES)
    step: float | None = None
    origin: tuple[float, float] | None = None
    map_unit: str = "m"
    licence: str = "unknown: that of the table"

    def __post_init__(self) -> None:
        units = {self.columns[axis].unit == DEGREES for axis in "xy"}
        if len(units) == 2:
            raise BadParameter("columns.x, columns.y: expected both in degrees or neither, found one")
        if (units == {True} or self.map_unit == DEGREES) and self.origin is None:
            raise BadParameter("frame.origin: expected latitude and longitude, as something is in degrees, found none")

    def factor(self, quantity: str) -> float:
        """Return the factor that brings a column of numbers to SI units."""
        units = UNITS[quantity]
        return units[self.columns[quantity].unit or next(iter(units))]

    def to_metres(self, longitude: Float64, latitude: Float64) -> Float64:
        """Return points (n, 2) [m] east and north of the origin, along the grid of its UTM zone."""
        if self.origin is None:
            raise BadParameter("frame.origin: expected latitude and longitude, found none")
        zone = utm_zone(self.origin[1])
        start = to_utm(np.array([self.origin[0]]), np.array([self.origin[1]]), zone)
        return to_utm(latitude, longitude, zone) - start


def read_columns(path: str) -> TableColumns:
    """Read ``columns.toml``; without a path, columns are named as quantities and have their default units.

    Raises:
        BadParameter: No such file, no TOML, or a key or value that is not known.
    """
    if not path:
        return TableColumns()
    try:
        content = tomllib.loads(Path(path).read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise BadParameter(f"{path}: cannot be read as TOML ({error})") from error
    try:
        return _columns(content)
    except BadParameter as error:
        raise BadParameter(f"{path}: {error}") from error


def _columns(content: Mapping[str, Any]) -> TableColumns:
    known = {
        "columns": (*TEXTS, *UNITS), "types": None, "sizes": None, "time": ("step",), "frame": ("origin",),
        "map": ("unit",), "source": ("licence",),
    }  # fmt: skip
    for table, values in content.items():
        _check(table, tuple(known), "table")
        if not isinstance(values, dict):
            raise BadParameter(f"{table}: expected a table, found {values!r}")
        names = known[table]
        for key in values if names is not None else ():
            _check(key, names or (), f"key of {table}")
    found: dict[str, Any] = {}
    if "columns" in content:
        missing = [quantity for quantity in NEEDED if quantity not in content["columns"]]
        if missing:
            raise BadParameter(f"columns: expected {', '.join(NEEDED)}, found no {missing[0]}")
        found["columns"] = {quantity: _column(quantity, told) for quantity, told in content["columns"].items()}
    types = {}
    for word, told in content.get("types", {}).items():
        if str(told).upper() not in ObjectType.__members__:
            raise BadParameter(f"types.{word}: expected one of {', '.join(ObjectType.__members__)}, found {told!r}")
        types[word.lower()] = ObjectType[told.upper()]
    found["types"] = {**TYPES, **types}
    sizes = {
        ObjectType.__members__.get(word, word.lower()): _numbers(f"sizes.{word}", told, 3)
        for word, told in content.get("sizes", {}).items()
    }
    found["sizes"] = {**SIZES, **sizes}
    if "step" in content.get("time", {}):
        (found["step"],) = _numbers("time.step", [content["time"]["step"]], 1)
        if not found["step"] > 0:
            raise BadParameter(f"time.step: expected seconds above 0, found {found['step']}")
    if "origin" in content.get("frame", {}):
        found["origin"] = _numbers("frame.origin", content["frame"]["origin"], 2)
    unit = content.get("map", {}).get("unit", "m")
    if unit not in ("m", DEGREES):
        raise BadParameter(f"map.unit: expected m or {DEGREES}, found {unit!r}")
    if "licence" in content.get("source", {}):
        found["licence"] = str(content["source"]["licence"])
    return TableColumns(**found, map_unit=unit)


def _check(name: str, known: tuple[str, ...], what: str) -> None:
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise BadParameter(f"no {what} {name!r}; {hint}expected {', '.join(known)}")


def _column(quantity: str, told: Any) -> TableColumn:
    if isinstance(told, str):
        return TableColumn(told)
    if not (isinstance(told, dict) and isinstance(told.get("column"), str) and set(told) <= {"column", "unit"}):
        expected = f'expected a name, or {{column = "...", unit = "..."}}, found {told!r}'
        raise BadParameter(f"columns.{quantity}: {expected}")
    unit, units = told.get("unit", ""), UNITS.get(quantity, {})
    if unit and unit not in units:
        raise BadParameter(f"columns.{quantity}: expected the unit {' or '.join(units) or 'none'}, found {unit!r}")
    return TableColumn(told["column"], unit)


def _numbers(name: str, told: Any, count: int) -> tuple[float, ...]:
    if not (isinstance(told, list) and len(told) == count and all(type(each) in (int, float) for each in told)):
        raise BadParameter(f"{name}: expected {count} numbers, found {told!r}")
    if not np.isfinite(told).all():
        raise BadParameter(f"{name}: expected finite numbers, found {told!r}")
    return tuple(map(float, told))
