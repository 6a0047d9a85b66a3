"""Read layers of a GeoPackage (https://www.geopackage.org/spec) as columns and projected coordinates.

A GeoPackage is an SQLite file with geometries in well-known binary after a short header, which sqlite3 and shapely
read faster than GDAL, with one dependency less. Only the projection needs pyproj.
"""

from __future__ import annotations

import re
import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64, Int64, Object
from scenarionet_data.building.plausible import MAX_MAP_DISTANCE, find_middle
from scenarionet_data.converters.nuplan.log import as_text, finding, uri
from scenarionet_data.errors import CorruptSource, needing
from scenarionet_data.ingest.defects import Defects

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

    def take(self, rows: Sequence[int]) -> Layer:
        """The features at ``rows``."""
        columns = {name: [values[row] for row in rows] for name, values in self.columns.items()}
        points = [self.points[row] for row in rows]
        return Layer([self.fids[row] for row in rows], points, self.num_holes[list(rows)], columns)


class GeoPackage:
    """An open GeoPackage with its projected coordinate system in the table ``meta``, as in nuPlan.

    Attributes:
        defects: Features that were dropped or assumed.
    """

    def __init__(self, database: sqlite3.Connection, path: Path, file: str) -> None:
        self.defects = Defects()
        self._database = database
        self._path = path
        self._file = file

    def drop(self, layer: str, ids: Sequence[object], reason: str) -> None:
        """Count features of a layer that are left out."""
        self.defects.drop("maps", self._file, [f"{layer} {each}" for each in ids], layer, reason)

    def assume(self, layer: str, ids: Sequence[object], reason: str) -> None:
        """Count features of a layer that are kept without a part."""
        self.defects.assume("maps", self._file, [f"{layer} {each}" for each in ids], layer, reason)

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
        if not re.fullmatch(r"\w+", str(geometry)):
            raise CorruptSource(f"{self._path}: no geometry of layer {name}; download the maps again")
        found = self._select(f"SELECT {', '.join(['fid', geometry, *columns])} FROM {name} ORDER BY fid")
        rows = list({row[0]: row for row in reversed(found) if isinstance(row[0], int)}.values())[::-1]
        self.drop(name, ["without id"] * (len(found) - len(rows)), "expected an id of its own, found another")
        shapes = shapely.from_wkb(np.array([_wkb(row[1]) for row in rows], dtype=object), on_invalid="ignore")
        is_good = (shapely.get_type_id(shapes) == kind) & ~shapely.is_empty(shapes)
        wanted = f"expected a {kind.name}, found none that can be read"
        self.drop(name, [row[0] for row, good in zip(rows, is_good, strict=True) if not good], wanted)
        rows = [row for row, good in zip(rows, is_good, strict=True) if good]
        points = self._projected(shapes[is_good], system)
        holes = shapely.get_num_interior_rings(shapes[is_good])
        middles = np.array([each.mean(axis=0) for each in points]).reshape(-1, 2)
        centre = find_middle(middles)
        is_on = [bool((np.abs(each - centre) <= MAX_MAP_DISTANCE).all()) for each in points]
        lost = [fid for fid, on in zip([row[0] for row in rows], is_on, strict=True) if not on]
        self.drop(name, lost, "expected coordinates on the map, found others")
        kept = [k for k, on in enumerate(is_on) if on]
        return Layer(
            fids=[rows[k][0] for k in kept],
            points=[points[k] for k in kept],
            num_holes=holes[kept],
            columns={column: [rows[k][2 + place] for k in kept] for place, column in enumerate(columns)},
        )

    def _projected(self, shapes: Object, system: int) -> list[Float64]:
        """Coordinates of lines, or of polygons' exterior rings without the closing point; not finite off the map."""
        rings = shapely.get_exterior_ring(shapes)
        lines = np.where(shapely.is_missing(rings), shapes, rings)
        degrees = shapely.get_coordinates(lines)
        counts = shapely.get_num_coordinates(lines)
        points = np.stack(_transformer(f"epsg:{system}", self.projection).transform(*degrees.T), axis=-1)
        parts = np.split(points, np.cumsum(counts)[:-1]) if len(counts) else []
        return [part if ring is None else part[:-1] for part, ring in zip(parts, rings, strict=True)]

    def rows(self, name: str, *columns: str) -> list[Any]:
        """Read columns of a table, without geometry, row by row."""
        return self._select(f"SELECT {', '.join(columns)} FROM {name}")

    def _select(self, query: str, *parameters: Any) -> list[Any]:
        return self._database.execute(query, parameters).fetchall()


@contextmanager
def opened(path: Path, file: str) -> Iterator[GeoPackage]:
    """Open a GeoPackage for reading; ``file`` is its path relative to the maps folder, for reports.

    Raises:
        CorruptSource: Missing, damaged, or without a required table or column.
    """
    if not path.is_file():
        raise CorruptSource(f"{path}: no such map; download the nuPlan maps")
    try:
        with closing(sqlite3.connect(uri(path), uri=True)) as database:
            database.text_factory = as_text
            yield GeoPackage(database, path, file)
    except sqlite3.Error as error:
        raise CorruptSource(
            f"{path}: expected a nuPlan map, found {finding(error)}; download the maps again"
        ) from error


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
    with needing("nuPlan maps need pyproj", "nuplan"):
        from pyproj import Transformer
        from pyproj.exceptions import CRSError
    try:
        return Transformer.from_crs(source, target, always_xy=True)
    except CRSError as error:
        wanted = "expected known coordinate systems of a map"
        raise CorruptSource(f"{wanted}, found {source[:32]!r} and {target[:32]!r}; download the maps again") from error
