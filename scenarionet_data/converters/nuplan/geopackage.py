"""Read layers of a GeoPackage (https://www.geopackage.org/spec) as columns and projected coordinates.

A GeoPackage is an SQLite file with geometries in well-known binary after a short header, which sqlite3 and shapely
read faster than GDAL, with one dependency less. Only the projection needs pyproj.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64, Int64, Object
from scenarionet_data.errors import CorruptSource, MissingDependency

_ENVELOPE = (0, 32, 48, 48, 64)
"""Size of the envelope in a geometry's header [bytes], by its type."""


@dataclass(frozen=True, eq=False)
class Layer:
    """K features of one layer.

    Attributes:
        fids: (K,) ids.
        points: K x (n, 2) [m] projected coordinates: a line, or a polygon's outline without its last point.
        num_holes: (K,) number of holes of each polygon, which are not in ``points``.
        columns: The other columns by name, K values each.
    """

    fids: list[int]
    points: list[Float64]
    num_holes: Int64
    columns: dict[str, list[Any]]

    def __getitem__(self, column: str) -> list[Any]:
        return self.columns[column]


class GeoPackage:
    """An open GeoPackage with its projected coordinate system in the table ``meta``, as in nuPlan."""

    def __init__(self, database: sqlite3.Connection, path: Path) -> None:
        self._database = database
        self._path = path

    @cached_property
    def projection(self) -> str:
        """The projected coordinate system, for example ``epsg:32611``."""
        row = self._select("SELECT value FROM meta WHERE key = 'projectedCoordSystem'")
        if not row:
            raise CorruptSource(f"{self._path}: table meta has no projectedCoordSystem; download the maps again")
        return str(row[0][0])

    def lines(self, name: str, *columns: str) -> Layer:
        """Read a layer of lines, with these columns."""
        return self._layer(name, shapely.GeometryType.LINESTRING, columns)

    def polygons(self, name: str, *columns: str) -> Layer:
        """Read a layer of polygons, with these columns."""
        return self._layer(name, shapely.GeometryType.POLYGON, columns)

    def _layer(self, name: str, kind: shapely.GeometryType, columns: tuple[str, ...]) -> Layer:
        place = self._select("SELECT column_name, srs_id FROM gpkg_geometry_columns WHERE table_name = ?", name)
        if not place:
            raise CorruptSource(f"{self._path}: no layer {name}; is this a nuPlan map?")
        geometry, system = place[0]
        rows = self._select(f"SELECT {', '.join(['fid', geometry, *columns])} FROM {name} ORDER BY fid")
        fids, blobs, *values = list(zip(*rows, strict=True)) or [()] * (2 + len(columns))
        shapes = shapely.from_wkb(np.array([_wkb(blob) for blob in blobs], dtype=object), on_invalid="ignore")
        is_wrong = shapely.get_type_id(shapes) != kind
        if is_wrong.any():
            fid = fids[int(np.argmax(is_wrong))]
            raise CorruptSource(f"{self._path}: {name} {fid}: expected a {kind.name}; download the maps again")
        return Layer(
            fids=list(fids),
            points=self._projected(name, shapes, system),
            num_holes=shapely.get_num_interior_rings(shapes),
            columns={column: list(cells) for column, cells in zip(columns, values, strict=True)},
        )

    def _projected(self, name: str, shapes: Object, system: int) -> list[Float64]:
        """Coordinates of lines, or of polygons' exterior rings without the closing point."""
        rings = shapely.get_exterior_ring(shapes)
        lines = np.where(shapely.is_missing(rings), shapes, rings)
        degrees = shapely.get_coordinates(lines)
        counts = shapely.get_num_coordinates(lines)
        points = np.stack(_transformer(f"epsg:{system}", self.projection).transform(*degrees.T), axis=-1)
        if not np.isfinite(points).all():
            raise CorruptSource(f"{self._path}: {name} has coordinates outside the map; download the maps again")
        parts = np.split(points, np.cumsum(counts)[:-1]) if len(counts) else []
        return [part if ring is None else part[:-1] for part, ring in zip(parts, rings, strict=True)]

    def rows(self, name: str, *columns: str) -> list[Any]:
        """Read columns of a table, without geometry, row by row."""
        return self._select(f"SELECT {', '.join(columns)} FROM {name}")

    def _select(self, query: str, *parameters: Any) -> list[Any]:
        return self._database.execute(query, parameters).fetchall()


@contextmanager
def opened(path: Path) -> Iterator[GeoPackage]:
    """Open a GeoPackage for reading.

    Raises:
        CorruptSource: Missing, damaged, or without a required table or column.
    """
    if not path.is_file():
        raise CorruptSource(f"{path}: no such map; download the nuPlan maps")
    try:
        # immutable: needs neither locks nor a writable folder for them
        with closing(sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)) as database:
            yield GeoPackage(database, path)
    except sqlite3.Error as error:
        raise CorruptSource(f"{path} cannot be read as a nuPlan map ({error}); download the maps again") from error


def _wkb(blob: Any) -> bytes | None:
    """Return the well-known binary of a geometry blob, or None if invalid."""
    if not isinstance(blob, bytes) or blob[:2] != b"GP" or len(blob) < 8:
        return None
    kind = blob[3] >> 1 & 0b111
    return blob[8 + _ENVELOPE[kind] :] if kind < len(_ENVELOPE) else None


def _transformer(source: str, target: str) -> Any:
    """Return the transform from longitude and latitude in degrees to metres.

    Raises:
        MissingDependency: pyproj is not installed.
    """
    try:
        from pyproj import Transformer
        from pyproj.exceptions import CRSError
    except ModuleNotFoundError as error:
        raise MissingDependency("nuPlan maps need pyproj", "nuplan") from error
    try:
        return Transformer.from_crs(source, target, always_xy=True)
    except CRSError as error:
        raise CorruptSource(f"no projection from {source} to {target}; download the maps again") from error
