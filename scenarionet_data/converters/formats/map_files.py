"""Read a map from a file of any format that holds one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import MapBuilder
from scenarionet_data.converters.formats.geojson import read_geojson
from scenarionet_data.converters.formats.lanelet2 import read_lanelet2
from scenarionet_data.converters.formats.opendrive.reader import read_opendrive
from scenarionet_data.errors import SourceNotFound

SUFFIXES = (".geojson", ".json", ".osm", ".xodr")


def read_map(
    path: Path,
    anchor: tuple[float, float] | None = None,
    to_metres: Callable[[Float64, Float64], Float64] | None = None,
) -> MapBuilder:
    """Read a map; what cannot be used is left out and listed in its ``defects``.

    Args:
        path: GeoJSON, Lanelet2 (``*.osm``) or OpenDRIVE (``*.xodr``).
        anchor: Latitude and longitude [degrees] of the frame's origin, for maps in degrees.
        to_metres: Makes points (n, 2) [m] of longitudes and latitudes (n,), for GeoJSON in degrees.

    Raises:
        SourceNotFound: No such file, or a file of another format.
        CorruptSource: It cannot be read.
    """
    if not path.is_file():
        raise SourceNotFound(f"{path}: no such map")
    if path.suffix == ".osm":
        return read_lanelet2(path, anchor)
    if path.suffix == ".xodr":
        return read_opendrive(path)
    if path.suffix in (".geojson", ".json"):
        return read_geojson(path, to_metres)
    raise SourceNotFound(f"{path}: expected a map, {', '.join(SUFFIXES)}, found {path.suffix or 'no ending'}")
