"""Read nuPlan's ``map.gpkg``: a city's lanes and connectors, painted lines, road blocks, stops and areas.

Frame: the city's UTM zone, in metres, without heights. Lanes and lane connectors have the source's ids, which traffic
lights refer to; the id of any other feature is its kind and the source's id, for example ``roadblock-47012``. The
drivable area consists of DRIVABLE_AREA, INTERSECTION and CARPARK_AREA.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import MapBuilder
from scenarionet_data.converters.cities import CityMap
from scenarionet_data.converters.nuplan.geopackage import GeoPackage, opened
from scenarionet_data.converters.nuplan.lanes import add_lanes, identifier, identifiers
from scenarionet_data.converters.nuplan.types import INTERSECTIONS, LINES, STOPS
from scenarionet_data.errors import CorruptSource
from scenarionet_data.ingest.listing import cached_by_file
from scenarionet_data.scenario.vocabulary import MapFeatureType

_AREAS = (
    ("road_segments", "segment", MapFeatureType.DRIVABLE_AREA),
    ("generic_drivable_areas", "drivable", MapFeatureType.DRIVABLE_AREA),
    ("carpark_areas", "carpark", MapFeatureType.CARPARK_AREA),
    ("walkways", "walkway", MapFeatureType.ROAD_EDGE_SIDEWALK),
)
"""Layers of areas without further columns: name of the area and ``MapFeatureType``."""

_KEPT_CITIES = 2
"""Number of cached cities: shards are listed city by city, so a worker needs at most two."""


@dataclass(frozen=True, eq=False)
class NuPlanCity(CityMap):
    """A city's map in its UTM zone.

    Attributes:
        starts: Start (2,) [m] of each lane and connector by id.
        projection: The zone, for example ``epsg:32611``.
    """

    starts: Mapping[str, Float64]
    projection: str


@cached_by_file(_KEPT_CITIES)
def read_city(path: Path, root: Path) -> NuPlanCity:
    """Read a city's map below the maps folder ``root``; a process caches a few.

    Raises:
        CorruptSource: The map is missing, damaged or lacks a layer.
        MissingDependency: pyproj is not installed.
    """
    if not path.is_file():
        raise CorruptSource(f"{path}: no such map; download the nuPlan maps")
    builder = MapBuilder()
    with opened(path, path.relative_to(root).as_posix()) as package:
        boundaries = package.lines("boundaries", "boundary_type_fid")
        starts = add_lanes(builder, package, boundaries)
        for fid, points, kind in zip(boundaries.fids, boundaries.points, boundaries["boundary_type_fid"], strict=True):
            line = LINES.get(kind, MapFeatureType.UNKNOWN_LINE)
            builder.add(
                f"boundary-{fid}",
                line,
                polyline=points,
                extras={"boundary_type": kind if isinstance(kind, int) else None},
            )
        _add_road_blocks(builder, package)
        _add_stops(builder, package)
        _add_areas(builder, package)
        projection = package.projection
        builder.defects = package.defects.found()
    return NuPlanCity(builder, starts, projection)


def _add_road_blocks(builder: MapBuilder, package: GeoPackage) -> None:
    """Add lane groups and the connectors between them, which make up routes."""
    groups = package.polygons("lane_groups_polygons")
    connectors = package.polygons("lane_group_connectors", "intersection_fid")
    shared = set(groups.fids) & set(connectors.fids)
    package.drop("lane_group_connectors", sorted(shared), "expected an id of its own, found that of a lane group")
    for fid, points in zip(groups.fids, groups.points, strict=True):
        builder.add(f"roadblock-{fid}", MapFeatureType.ROADBLOCK, polygon=points, is_intersection=False)
    for fid, points, crossing in zip(connectors.fids, connectors.points, connectors["intersection_fid"], strict=True):
        if fid in shared:
            continue
        extras = {"intersection_id": identifier(crossing)}
        builder.add(f"roadblock-{fid}", MapFeatureType.ROADBLOCK, polygon=points, is_intersection=True, extras=extras)


def _add_stops(builder: MapBuilder, package: GeoPackage) -> None:
    """Add stop polygons with the lanes and connectors they control, and crossings with the lanes they cross."""
    columns = ("stop_polygon_type_fid", "lane_fids", "lane_connector_fids")
    stops = package.polygons("stop_polygons", *columns)
    connectors = package.rows("lane_connectors", "fid", "traffic_light_stop_line_fids")
    held = defaultdict(list)
    for connector, lines in connectors:
        for stop in identifiers(lines):
            held[stop].append(identifier(connector))
    for row, fid in enumerate(stops.fids):
        lanes = identifiers(stops["lane_fids"][row]) + identifiers(stops["lane_connector_fids"][row])
        builder.add(
            f"stop-{fid}",
            MapFeatureType.STOP_LINE,
            polygon=stops.points[row],
            controlled_lanes=list(dict.fromkeys(lanes + held[identifier(fid)])),
            extras={"stop_type": STOPS.get(stops["stop_polygon_type_fid"][row], "unknown")},
        )
    crossings = package.polygons("crosswalks", "lane_fids", "is_marked")
    for row, fid in enumerate(crossings.fids):
        is_marked = crossings["is_marked"][row]
        builder.add(
            f"crosswalk-{fid}",
            MapFeatureType.CROSSWALK,
            polygon=crossings.points[row],
            controlled_lanes=identifiers(crossings["lane_fids"][row]),
            extras=None if is_marked is None else {"is_marked": bool(is_marked)},
        )


def _add_areas(builder: MapBuilder, package: GeoPackage) -> None:
    crossings = package.polygons("intersections", "intersection_type_fid")
    for row, fid in enumerate(crossings.fids):
        builder.add(
            f"intersection-{fid}",
            MapFeatureType.INTERSECTION,
            polygon=crossings.points[row],
            is_intersection=True,
            extras={"intersection_type": INTERSECTIONS.get(crossings["intersection_type_fid"][row], "unknown")},
        )
    for layer, name, kind in _AREAS:
        areas = package.polygons(layer)
        for fid, points, holes in zip(areas.fids, areas.points, areas.num_holes, strict=True):
            extras = {"num_holes": int(holes)} if holes else None
            builder.add(f"{name}-{fid}", kind, polygon=points, extras=extras)
