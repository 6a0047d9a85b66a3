"""Shapes of a map: areas, lines and lanes in the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarionet_data.arrays.dtypes import UInt8
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.lane_polygons import lane_outlines
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane, is_road_edge, is_road_line


@dataclass(frozen=True, eq=False)
class MapShapes:
    """Shapes of a map to draw, in metres in the scenario frame.

    Attributes:
        areas: Q x (n, 2) float32 outlines, implicitly closed: lanes, crosswalks, junctions, ...
        area_type: (Q,) uint8 codes of ``MapFeatureType``.
        lines: K x (n, 2) float32: road lines, road edges and stop lines.
        line_type: (K,) uint8 codes of ``MapFeatureType``.
        lanes: M x (n, 2) float32 centrelines in driving direction.
    """

    areas: Ragged
    area_type: UInt8
    lines: Ragged
    line_type: UInt8
    lanes: Ragged

    @classmethod
    def empty(cls) -> MapShapes:
        """Return an empty map."""
        none, codes = Ragged.empty(0, 2), np.zeros(0, np.uint8)
        return cls(none, codes, none, codes, none)

    @classmethod
    def from_map(cls, features: MapFeatures | None) -> MapShapes:
        """Return the shapes of a scenario's map; empty for None."""
        if features is None:
            return cls.empty()
        types, has_line = features.feature_type, features.polyline.lengths > 1
        is_line = is_road_line(types) | is_road_edge(types) | (types == MapFeatureType.STOP_LINE)
        lane_rows = np.flatnonzero(is_lane(types))
        area_rows = np.flatnonzero(~is_lane(types) & (features.polygon.lengths > 2))
        open_rows, closed_rows = np.flatnonzero(is_line & has_line), np.flatnonzero(is_line & ~has_line)
        outlines = features.polygon.take(closed_rows)
        filled = outlines.take(np.flatnonzero(outlines.lengths))
        place = np.arange(len(filled.values)) + np.repeat(np.arange(len(filled)), filled.lengths)
        values = np.empty((len(filled.values) + len(filled), 2), np.float32)
        values[place] = filled.values[:, :2]
        values[filled.offsets[1:] + np.arange(len(filled))] = filled.values[filled.offsets[:-1], :2]
        lengths = np.where(outlines.lengths > 0, outlines.lengths + 1, 0)
        return cls(
            areas=Ragged.joined([lane_outlines(features, lane_rows), _in_plane(features.polygon.take(area_rows))]),
            area_type=types[np.concatenate([lane_rows, area_rows])],
            lines=Ragged.joined([_in_plane(features.polyline.take(open_rows)), Ragged.from_flat(lengths, values)]),
            line_type=types[np.concatenate([open_rows, closed_rows])],
            lanes=_in_plane(features.polyline.take(lane_rows)),
        )


def _in_plane(points: Ragged) -> Ragged:
    return Ragged(points.offsets, np.ascontiguousarray(points.values[:, :2]))
