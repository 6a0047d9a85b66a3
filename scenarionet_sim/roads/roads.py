"""The map as arrays: line segments and polygons under a grid each, lanes and their successors.

Heights are dropped: sensors and rules work in the plane.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from scenarionet_data.arrays.dtypes import Bool, Float32, Float64, Int32, Object, UInt8
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import MapBuilder
from scenarionet_data.scenario.content_hash import map_hash
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.lane_polygons import lane_outlines
from scenarionet_data.scenario.vocabulary import (
    AREAS_TO_DRIVE_ON,
    MapFeatureType,
    is_lane,
    is_road_edge,
    is_road_line,
)
from scenarionet_sim.arrays.containment import PolygonGrid, blocks_of, find_polygon, find_stays, strips_of
from scenarionet_sim.roads.grid import Grid
from scenarionet_sim.roads.lane_kernels import find_lanes
from scenarionet_sim.roads.line_grid import LineGrid
from scenarionet_sim.roads.road_pieces import RoadPieces, joined

_Derived = TypeVar("_Derived")


@dataclass(frozen=True)
class _MapContent:
    """The features of a map, equal if their content is."""

    number: int
    features: MapFeatures = field(compare=False)


@dataclass(frozen=True, eq=False)
class Roads:
    """A map in the plane; all coordinates in metres, scenario frame.

    Attributes:
        segments: (S, 4) float32 x0, y0, x1, y1 of road lines, road edges and stop lines (of an edge given as an area:
            its outline), feature by feature, in order along each feature.
        segment_type: (S,) uint8 codes of ``MapFeatureType``.
        segment_feature: (S,) int32 row of the segment's feature in the scenario's map.
        lane_ids: (M,) str.
        lane_type: (M,) uint8 codes of ``MapFeatureType``.
        lanes: M x (n, 2) float32 centrelines in driving direction.
        successors: M x rows of the following lanes, int32, without those outside the map.
        speed_limit: (M,) float32 [m/s], NaN when unknown.
        polygons: Q x (n, 2) float32 outlines, implicitly closed: first of the lanes, in their order (the buffered
            centreline of a lane without one), then of all other features with an outline.
        polygon_type: (Q,) uint8 codes of ``MapFeatureType``.
        polygon_grid: Grid over the polygons.
    """

    segments: Float32
    segment_type: UInt8
    segment_feature: Int32
    lane_ids: Object
    lane_type: UInt8
    lanes: Ragged
    successors: Ragged
    speed_limit: Float32
    polygons: Ragged
    polygon_type: UInt8
    polygon_grid: Grid
    is_road: Bool = field(init=False, repr=False)
    """(Q,) drivable polygons."""

    def __post_init__(self) -> None:
        is_road = is_lane(self.polygon_type) | np.isin(self.polygon_type, AREAS_TO_DRIVE_ON)
        object.__setattr__(self, "is_road", is_road)

    @property
    def num_lanes(self) -> int:
        """M."""
        return len(self.lane_ids)

    @classmethod
    def from_map(cls, features: MapFeatures | None) -> Roads:
        """Convert a scenario's map, or return what a map of equal content was converted to; None gives empty roads."""
        if features is None:
            return cls.from_map(MapBuilder().build(np.zeros(3)))
        known: Roads | None = vars(features).get("_roads")
        if known is None:  # scenarios may share the features
            known = vars(features)["_roads"] = cls._converted(_MapContent(map_hash(features), features))
        return known

    @classmethod
    @lru_cache(maxsize=8)
    def _converted(cls, content: _MapContent) -> Roads:
        features = content.features
        segments, feature = _segments(features)
        lane_rows = np.flatnonzero(is_lane(features.feature_type))
        other_rows = np.flatnonzero(~is_lane(features.feature_type) & (features.polygon.lengths > 0))
        outlines = lane_outlines(features, lane_rows), _in_plane(features.polygon.take(other_rows))
        lengths, points = np.concatenate([each.lengths for each in outlines]), [each.values for each in outlines]
        polygons = Ragged.from_flat(lengths, np.concatenate(points))
        row_of = {lane: row for row, lane in enumerate(features.ids[lane_rows])}
        exits = features.exit_lanes.take(lane_rows)
        rows = np.array([row_of.get(lane, -1) for lane in exits.values], np.int32)
        owner = np.repeat(np.arange(len(exits)), exits.lengths)[rows >= 0]
        roads = cls(
            segments=segments,
            segment_type=features.feature_type[feature],
            segment_feature=feature,
            lane_ids=features.ids[lane_rows],
            lane_type=features.feature_type[lane_rows],
            lanes=_in_plane(features.polyline.take(lane_rows)),
            successors=Ragged.from_flat(np.bincount(owner, minlength=len(exits)), rows[rows >= 0]),
            speed_limit=features.speed_limit[lane_rows],
            polygons=polygons,
            polygon_type=features.feature_type[np.concatenate([lane_rows, other_rows])],
            polygon_grid=Grid.over(*polygons.bounds()),
        )
        _ = roads.segment_grid  # in the thread that loads
        return roads

    def once(self, make: Callable[[Roads], _Derived]) -> _Derived:
        """Return what a function makes of the map, which is made once and kept with it."""
        made: dict[Callable[[Roads], object], _Derived] = vars(self).setdefault("_made", {})
        if make not in made:
            made[make] = make(self)
        return made[make]

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in vars(self).items() if name != "_made"}

    @cached_property
    def segment_grid(self) -> LineGrid:
        """Grid over the segments, packed."""
        return LineGrid.over(self.segments, self.segment_type)

    def forget_segment_grid(self) -> None:
        """Drop the grid over the segments until it is read again: it takes more memory than the segments."""
        vars(self).pop("segment_grid", None)

    @property
    def pieces(self) -> RoadPieces:
        """Pieces of lanes, road lines and road edges, computed anew."""
        is_shown = is_road_line(self.segment_type) | is_road_edge(self.segment_type)
        owner = self.segment_feature[is_shown]
        lines, types = joined(self.segments[is_shown], owner), self.segment_type[is_shown]
        of_line = types[np.append(0, np.cumsum(lines.lengths - 1)[:-1])] if len(lines) else types
        lengths = np.concatenate([self.lanes.lengths, lines.lengths])
        every = Ragged.from_flat(lengths, np.concatenate([self.lanes.values, lines.values]))
        return RoadPieces.along(every, np.concatenate([self.lane_type, of_line]))

    @cached_property
    def polygon_bounds(self) -> Float32:
        """(Q, 4) min_x, min_y, max_x, max_y of each polygon [m]; NaN for an empty one."""
        return np.concatenate(self.polygons.bounds(), axis=1)

    def is_on_road(self, points: npt.ArrayLike) -> Bool:
        """Return whether points (..., 2) [m] are on a lane or another drivable area."""
        return self.is_in(points, self.is_road)

    def is_in(self, points: npt.ArrayLike, is_selected: Bool) -> Bool:
        """Return whether points (..., 2) [m] are inside any of the polygons selected by a mask (Q,)."""
        return self._find(points, is_selected) >= 0

    def lane_at(self, points: npt.ArrayLike) -> Int32:
        """Return the row of the first lane that contains each point (..., 2) [m], or -1."""
        return self._find(points, is_lane(self.polygon_type))

    def lanes_along(self, places: npt.ArrayLike, headings: npt.ArrayLike, reach: float) -> Float64:
        """Return the nearest lane in the direction of each pose.

        Args:
            places: (Q, 2) [m].
            headings: (Q,) [rad].
            reach: Largest distance from a centreline [m].

        Returns:
            (Q, 3) row of the lane, -1 without one; arc length along it [m]; distance from it [m].
        """
        where, angles = np.ascontiguousarray(places, np.float32), np.ascontiguousarray(headings, np.float32)
        found = np.tile([-1.0, 0.0, reach], (len(where), 1))
        if self.num_lanes and len(where):
            find_lanes(where, angles, self.lanes.values, self.lanes.offsets, found)
        return found

    def lanes_around(self, points: npt.ArrayLike) -> Bool:
        """Return which of the M lanes contain each point (..., 2) [m], as (..., M)."""
        where = np.asarray(points, dtype=np.float64)
        first, lanes = self.stays_in_lanes(where.reshape(-1, 1, 2))
        inside = np.zeros((len(first), self.num_lanes), np.bool_)
        inside[np.repeat(np.arange(len(first)), lanes.lengths), lanes.values] = True
        repeated = np.repeat(inside, np.diff(first, append=where.size // 2), axis=0)
        return repeated.reshape(*where.shape[:-1], self.num_lanes)

    def stays_in_lanes(self, points: Float64) -> tuple[Int32, Ragged]:
        """Return when points that move together change lanes.

        Args:
            points: (T, K, 2) [m].

        Returns:
            (S,) the first moment of each stay, and S * K lists of the lanes (int32) around each point.
        """
        (polygons, most), (moments, count) = self.gridded_polygons, points.shape[:2]
        first, starts = np.empty(moments, np.int32), np.zeros(moments * count + 1, np.int32)
        around = np.empty(moments * count * most, np.int32)
        stays = find_stays(np.ascontiguousarray(points), polygons, self.num_lanes, first, starts, around)
        offsets = starts[: stays * count + 1]
        return first[:stays], Ragged(offsets, around[: offsets[-1]])

    def _find(self, points: npt.ArrayLike, is_selected: Bool) -> Int32:
        where = np.asarray(points, dtype=np.float64)
        if not is_selected.any():
            return np.full(where.shape[:-1], -1, np.int32)
        flat = np.ascontiguousarray(where.reshape(-1, 2))
        found = np.empty(len(flat), np.int32)
        find_polygon(flat, self.gridded_polygons[0], is_selected, found)
        return found.reshape(where.shape[:-1])

    @cached_property
    def gridded_polygons(self) -> tuple[PolygonGrid, int]:
        """The polygons, and the largest number of them in a cell."""
        grid, points, offsets = self.polygon_grid, self.polygons.values, self.polygons.offsets
        places, strips = (grid.frame, grid.cell_start, grid.cell_items), strips_of(points)
        polygons = PolygonGrid(points, strips, blocks_of(strips), offsets, self.polygon_bounds, *places)
        return polygons, int(np.diff(grid.cell_start).max(initial=0))


def _segments(features: MapFeatures) -> tuple[Float32, Int32]:
    """Return the segments (S, 4) of all lines, and the feature of each (S,)."""
    types = features.feature_type
    is_line = is_road_line(types) | is_road_edge(types) | (types == MapFeatureType.STOP_LINE)
    has_line = features.polyline.lengths > 1
    open_rows, closed_rows = np.flatnonzero(is_line & has_line), np.flatnonzero(is_line & ~has_line)
    lines, outlines = features.polyline.take(open_rows), features.polygon.take(closed_rows)
    segments = np.concatenate([_between(lines, is_closed=False), _between(outlines, is_closed=True)])
    feature = np.concatenate(
        [np.repeat(open_rows, lines.lengths - 1), np.repeat(closed_rows, outlines.lengths)]
    ).astype(np.int32)
    order = np.argsort(feature, kind="stable")
    return np.ascontiguousarray(segments[order]), feature[order]


def _between(lines: Ragged, *, is_closed: bool) -> Float32:
    """Return segments (S, 4) between consecutive points of each list, and from last to first if closed."""
    start = lines.values[:, :2]
    end = np.roll(start, -1, axis=0)
    is_last = np.zeros(len(start), np.bool_)
    is_last[lines.offsets[1:][lines.lengths > 0] - 1] = True
    if not is_closed:
        return np.concatenate([start, end], axis=1)[~is_last]
    end[is_last] = start[lines.offsets[:-1][lines.lengths > 0]]
    return np.concatenate([start, end], axis=1)


def _in_plane(points: Ragged) -> Ragged:
    return Ragged(points.offsets, np.ascontiguousarray(points.values[:, :2]))
