"""Read lanes and lane connectors of a nuPlan map: geometry from four layers, and the graph between them.

Note: for a connector, the source's ``exit_lane_fid`` is its predecessor (the lane that is exited) and
``entry_lane_fid`` its successor.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import MapBuilder
from scenarionet_data.building.plausible import MAX_SPEED
from scenarionet_data.converters.nuplan.geopackage import GeoPackage, Layer
from scenarionet_data.converters.nuplan.types import LANES, TURNS
from scenarionet_data.scenario.vocabulary import MapFeatureType


def add_lanes(builder: MapBuilder, package: GeoPackage, boundaries: Layer) -> dict[str, Float64]:
    """Add a map's lanes, then its lane connectors.

    Args:
        builder: Extended by them.
        package: The map.
        boundaries: Its layer ``boundaries``.

    Returns:
        Start point (2,) [m] of each by id.

    A lane without an id of its own is dropped; one without a centreline is kept.
    """
    lanes = package.polygons(
        "lanes_polygons",
        *("lane_fid", "lane_group_fid", "lane_index", "lane_type_fid", "speed_limit_mps"),
        *("left_boundary_fid", "right_boundary_fid"),
    )
    connectors = package.lines(
        "lane_connectors",
        *("exit_lane_fid", "entry_lane_fid", "lane_group_connector_fid", "turn_type_fid", "speed_limit_mps"),
    )
    shapes = package.polygons(
        "gen_lane_connectors_scaled_width_polygons",
        *("lane_connector_fid", "left_boundary_fid", "right_boundary_fid"),
    )
    paths = package.lines("baseline_paths", "lane_fid", "lane_connector_fid")
    lanes, lane_ids = _unique(package, "lanes_polygons", lanes, lanes["lane_fid"], set())
    connectors, connector_ids = _unique(package, "lane_connectors", connectors, connectors.fids, set(lane_ids))
    lane_centers = _centers(package, "lanes_polygons", lane_ids, paths["lane_fid"], paths)
    connector_centers = _centers(package, "lane_connectors", connector_ids, paths["lane_connector_fid"], paths)
    sides = _Sides(boundaries)
    _add_lanes(builder, lanes, lane_ids, lane_centers, connectors, sides)
    _add_connectors(builder, connectors, connector_ids, connector_centers, shapes, sides)
    centers = zip([*lane_ids, *connector_ids], [*lane_centers, *connector_centers], strict=True)
    return {lane: points[0] for lane, points in centers if len(points)}


def _unique(
    package: GeoPackage, name: str, layer: Layer, references: Sequence[Any], taken: set[str]
) -> tuple[Layer, list[str]]:
    """The features of a layer with an id of their own, and these ids."""
    ids = set(taken)
    kept: list[int] = []
    lost: list[int] = []
    for row, reference in enumerate(references):
        each = identifier(reference)
        (lost if not each or each in ids else kept).append(row)
        ids.add(each)
    package.drop(name, [layer.fids[row] for row in lost], "expected an id of its own, found another")
    return layer.take(kept), [identifier(references[row]) for row in kept]


def identifier(value: Any) -> str:
    """Return a reference as an id; layers store them as integers, floats or text. Empty for NULL and other values."""
    try:
        return str(int(float(value)))
    except (TypeError, ValueError, OverflowError):
        return ""


def identifiers(text: Any) -> list[str]:
    """Ids in a comma-separated list."""
    found = (identifier(part.strip()) for part in str(text or "").split(","))
    return [each for each in found if each]


def _centers(package: GeoPackage, name: str, ids: Sequence[str], owners: Sequence[Any], paths: Layer) -> list[Float64]:
    """(n, 2) centreline of each lane; empty if it has none."""
    by_owner = {identifier(owner): points for owner, points in zip(owners, paths.points, strict=True)}
    reason = "expected a baseline path, found none; the lane has no centreline"
    package.assume(name, [lane for lane in ids if lane not in by_owner], reason)
    return [by_owner.get(lane, np.zeros((0, 2))) for lane in ids]


class _Sides:
    """Boundaries of lanes, and their distance from the middle of a centreline."""

    def __init__(self, boundaries: Layer) -> None:
        self._lines = {
            identifier(fid): shapely.LineString(points)
            for fid, points in zip(boundaries.fids, boundaries.points, strict=True)
        }

    def width(self, center: Float64, left: str, right: str) -> Float64 | None:
        """(2,) distance from the middle of a centreline to both sides [m]; None if one of them is not in the map."""
        if left not in self._lines or right not in self._lines or not len(center):
            return None
        middle = shapely.Point(center[len(center) // 2])
        width: Float64 = shapely.distance(middle, [self._lines[left], self._lines[right]])
        return width


def _add_lanes(
    builder: MapBuilder,
    lanes: Layer,
    ids: Sequence[str],
    centers: Sequence[Float64],
    connectors: Layer,
    sides: _Sides,
) -> None:
    entries: defaultdict[str, list[str]] = defaultdict(list)
    exits: defaultdict[str, list[str]] = defaultdict(list)
    rows = zip(connectors.fids, connectors["exit_lane_fid"], connectors["entry_lane_fid"], strict=True)
    for fid, incoming, outgoing in rows:
        exits[identifier(incoming)].append(identifier(fid))
        entries[identifier(outgoing)].append(identifier(fid))
    # Lanes of a lane group are numbered from the left.
    places = list(zip(map(identifier, lanes["lane_group_fid"]), lanes["lane_index"], strict=True))
    lane_at = dict(zip(places, ids, strict=True))
    for row, lane in enumerate(ids):
        group, index = places[row]
        left, right = identifier(lanes["left_boundary_fid"][row]), identifier(lanes["right_boundary_fid"][row])
        builder.add(
            lane,
            LANES.get(lanes["lane_type_fid"][row], MapFeatureType.LANE_UNKNOWN),
            polyline=centers[row],
            polygon=lanes.points[row],
            speed_limit=_speed(lanes["speed_limit_mps"][row]),
            width=sides.width(centers[row], left, right),
            entry_lanes=entries[lane],
            exit_lanes=exits[lane],
            left_neighbors=_at(lane_at, group, index, -1),
            right_neighbors=_at(lane_at, group, index, +1),
            left_boundaries=_boundary(left),
            right_boundaries=_boundary(right),
            is_intersection=False,
            extras={"roadblock_id": group, "lane_index": index if isinstance(index, int) else None},
        )


def _add_connectors(
    builder: MapBuilder,
    connectors: Layer,
    ids: Sequence[str],
    centers: Sequence[Float64],
    shapes: Layer,
    sides: _Sides,
) -> None:
    shape_of = {identifier(fid): row for row, fid in enumerate(shapes["lane_connector_fid"])}
    for row, lane in enumerate(ids):
        shape = shape_of.get(lane)
        left = "" if shape is None else identifier(shapes["left_boundary_fid"][shape])
        right = "" if shape is None else identifier(shapes["right_boundary_fid"][shape])
        turn = TURNS.get(connectors["turn_type_fid"][row], "unknown")
        incoming, outgoing = connectors["exit_lane_fid"][row], connectors["entry_lane_fid"][row]
        builder.add(
            lane,
            MapFeatureType.LANE_SURFACE_UNSTRUCTURE,
            polyline=centers[row],
            polygon=None if shape is None else shapes.points[shape],
            speed_limit=_speed(connectors["speed_limit_mps"][row]),
            width=sides.width(centers[row], left, right),
            entry_lanes=_known(incoming),
            exit_lanes=_known(outgoing),
            left_boundaries=_boundary(left),
            right_boundaries=_boundary(right),
            is_intersection=True,
            extras={"roadblock_id": identifier(connectors["lane_group_connector_fid"][row]), "turn": turn},
        )


def _at(lane_at: Mapping[tuple[str, Any], str], group: str, index: Any, side: int) -> list[str]:
    """Lane next to the one at ``index`` of a group, if any."""
    beside = lane_at.get((group, index + side)) if isinstance(index, int) else None
    return [beside] if beside else []


def _known(fid: Any) -> list[str]:
    return [identifier(fid)] if identifier(fid) else []


def _boundary(fid: str) -> list[str]:
    return [f"boundary-{fid}"] if fid else []


def _speed(value: Any) -> float:
    """Speed limit [m/s]; NaN if it is unknown or none that a road has."""
    return float(value) if isinstance(value, int | float) and 0.0 <= value <= MAX_SPEED else float("nan")
