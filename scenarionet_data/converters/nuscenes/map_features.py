"""Convert a nuScenes map expansion to map features: lanes, lines, edges, areas, stop lines, traffic lights.

Lanes have no speed limits or widths, and lights no states. There are no heights: everything is at z = 0, like the ego
poses, except traffic lights, whose height is in the map.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import MapBuilder
from scenarionet_data.building.plausible import MAX_MAP_DISTANCE
from scenarionet_data.converters.formats.json_blocks import is_number
from scenarionet_data.converters.nuscenes.areas import CELL, outlines, road_edges
from scenarionet_data.converters.nuscenes.dividers import Divider, read_dividers
from scenarionet_data.converters.nuscenes.expansion import BadFeature, Expansion, LayerRecord, read_expansion, words
from scenarionet_data.converters.nuscenes.lanes import NuScenesLane, lanes_across, lanes_inside, neighbors, read_lanes
from scenarionet_data.errors import CorruptSource
from scenarionet_data.scenario.vocabulary import MapFeatureType

_AREAS = {
    "ped_crossing": MapFeatureType.CROSSWALK,
    "walkway": MapFeatureType.ROAD_EDGE_SIDEWALK,
    "carpark_area": MapFeatureType.CARPARK_AREA,
    "road_block": MapFeatureType.ROADBLOCK,
}
"""Layers with one polygon per record. Road segments that are not intersections repeat their blocks and are skipped."""
_BROAD = (MapFeatureType.DRIVABLE_AREA, MapFeatureType.ROAD_EDGE_SIDEWALK)
"""Layers of large areas, which are cut into parts of ``CELL``."""
_Area = tuple[Float64, Sequence[Float64]]
"""Exterior and holes of a polygon."""
_WORDS = ("orientation", "stop_line_type", "ped_crossing_tokens", "traffic_light_tokens")
"""Fields stored in extras: orientation of parked cars [rad] for car parks, reason for stop lines."""


def read_map(path: Path, file: str) -> MapBuilder:
    """Read one map expansion, in the location's frame; ``file`` is its path relative to the dataroot, for reports.

    Raises:
        CorruptSource: The file is missing, not JSON, of another version, or lacks a layer.
    """
    wanted = "expected a nuScenes map expansion v1.3"
    try:
        return _features(read_expansion(path, file))
    except FileNotFoundError as error:
        raise CorruptSource(f"{path}: no such map; download nuScenes' map expansion v1.3") from error
    except OSError as error:
        raise CorruptSource(f"{path}: {wanted}, found no file that can be read; download it again") from error
    except ValueError as error:
        raise CorruptSource(f"{path}: {wanted}, found {error}; download it again") from error


def _features(expansion: Expansion) -> MapBuilder:
    builder = MapBuilder()
    dividers = read_dividers(expansion)
    lanes = read_lanes(expansion, dividers)
    _add_lanes(builder, expansion, lanes, dividers)
    for divider in dividers:
        builder.add(divider.id, divider.type, polyline=divider.points, extras=divider.extras)
    _add_drivable(builder, expansion)
    for layer, kind in _AREAS.items():
        for record in expansion.layer(layer):
            with expansion.dropping(layer, record):
                _add_area(builder, record["token"], kind, expansion.polygon(layer, record), _extras(record))
    blocks = _areas(expansion, "road_block", expansion.layer("road_block"))
    inside = lanes_inside(lanes, [shapely.Polygon(exterior) for _, (exterior, _) in blocks])
    lanes_of = {record["token"]: found for (record, _), found in zip(blocks, inside, strict=True)}
    _add_stop_lines(builder, expansion, lanes, lanes_of)
    _add_traffic_lights(builder, expansion, lanes_of)
    builder.defects = expansion.defects.found()
    return builder


def _areas(expansion: Expansion, layer: str, records: Iterable[LayerRecord]) -> list[tuple[LayerRecord, _Area]]:
    """Records with their polygons, without those that cannot be read."""
    found: list[tuple[LayerRecord, _Area]] = []
    for record in records:
        with expansion.dropping(layer, record):
            found.append((record, expansion.polygon(layer, record)))
    return found


def _add_lanes(builder: MapBuilder, expansion: Expansion, lanes: list[NuScenesLane], dividers: list[Divider]) -> None:
    records = [record for record in expansion.layer("road_segment") if record.get("is_intersection")]
    crossings = _areas(expansion, "road_segment", records)
    inside = lanes_inside(lanes, [shapely.Polygon(exterior) for _, (exterior, _) in crossings])
    in_crossing = {lane for found in inside for lane in found}
    beside = neighbors(lanes, dividers)
    for lane in lanes:
        builder.add(
            lane.id,
            MapFeatureType.LANE_BIKE_LANE if lane.kind == "BIKE" else MapFeatureType.LANE_SURFACE_STREET,
            polyline=lane.center,
            polygon=lane.outline,
            entry_lanes=lane.entries,
            exit_lanes=lane.exits,
            left_neighbors=beside[lane.id][0],
            right_neighbors=beside[lane.id][1],
            left_boundaries=lane.left,
            right_boundaries=lane.right,
            is_intersection=lane.id in in_crossing,
            extras={"is_connector": True} if lane.layer == "lane_connector" else None,
        )
    for record, area in crossings:
        with expansion.dropping("road_segment", record):
            _add_area(builder, record["token"], MapFeatureType.INTERSECTION, area, is_intersection=True)


def _add_drivable(builder: MapBuilder, expansion: Expansion) -> None:
    areas = {}
    for record in expansion.layer("drivable_area"):
        for token in words(record.get("polygon_tokens")):
            with expansion.dropping("drivable_area", record):
                areas[token] = expansion.polygon("drivable_area", record, token)
                _add_area(builder, token, MapFeatureType.DRIVABLE_AREA, areas[token])
    for number, edge in enumerate(road_edges(areas.values())):
        builder.add(f"edge-{number}", MapFeatureType.ROAD_EDGE_BOUNDARY, polyline=edge)


def _add_area(
    builder: MapBuilder,
    token: str,
    kind: MapFeatureType,
    area: _Area,
    extras: Mapping[str, Any] | None = None,
    is_intersection: bool | None = None,
) -> None:
    """Add a polygon; one with holes or of large extent is split into ``<token>-0``, ``-1``, ...; skip an empty one."""
    parts = outlines(*area, cell=CELL if kind in _BROAD else np.inf) if len(area[0]) else []
    for number, outline in enumerate(parts):
        name = token if len(parts) == 1 else f"{token}-{number}"
        builder.add(name, kind, polygon=outline, is_intersection=is_intersection, extras=extras)


def _extras(record: LayerRecord) -> dict[str, Any]:
    """Extras of a record."""
    return {key: record[key] for key in _WORDS if record.get(key)}


def _add_stop_lines(
    builder: MapBuilder, expansion: Expansion, lanes: list[NuScenesLane], lanes_of: dict[str, list[str]]
) -> None:
    """Add stop lines, areas across lanes; one with a road block controls the lanes of that block only."""
    areas = _areas(expansion, "stop_line", expansion.layer("stop_line"))
    across = lanes_across(lanes, [shapely.Polygon(exterior) for _, (exterior, _) in areas])
    for (record, (exterior, _)), crossed in zip(areas, across, strict=True):
        with expansion.dropping("stop_line", record):
            block = record["road_block_token"]
            builder.add(
                record["token"],
                MapFeatureType.STOP_LINE,
                polygon=exterior,
                controlled_lanes=[lane for lane in crossed if block not in lanes_of or lane in lanes_of[block]],
                extras=_extras(record),
            )


def _add_traffic_lights(builder: MapBuilder, expansion: Expansion, lanes_of: dict[str, list[str]]) -> None:
    for record in expansion.layer("traffic_light"):
        with expansion.dropping("traffic_light", record):
            x, y, z, heading = (record["pose"][name] for name in ("tx", "ty", "tz", "rz"))
            if not all(is_number(each, MAX_MAP_DISTANCE) for each in (x, y, z, heading)):
                raise BadFeature("expected a pose of finite numbers, found another")
            builder.add(
                record["token"],
                MapFeatureType.TRAFFIC_LIGHT,
                polyline=[[x, y, z]],
                controlled_lanes=lanes_of.get(record["from_road_block_token"], ()),
                extras={
                    "heading": heading,
                    "traffic_light_type": record["traffic_light_type"],
                    "items": record["items"],
                },
            )
