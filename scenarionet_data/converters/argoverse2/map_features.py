"""Read Argoverse 2's ``log_map_archive_<id>.json``: lanes, painted lines, drivable areas and crossings of one log.

Frame: the city's, in metres, z up. There are no traffic lights, stop signs or speed limits. Motion forecasting maps
have centrelines (with z = 0); in sensor maps they are derived, halfway between the sides. As in the source, a neighbour
may be of the opposite direction: then each lane has the other on its left.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.arrays.ragged import Ragged
from scenarionet_data.building import MapBuilder
from scenarionet_data.building.plausible import MAX_MAP_DISTANCE
from scenarionet_data.building.polylines import between, midlines
from scenarionet_data.converters.argoverse2.archive import Archive
from scenarionet_data.converters.argoverse2.polylines import outline, road_edges
from scenarionet_data.converters.argoverse2.types import INEXACT_MARKS, LANES, MARKS, NO_MARK
from scenarionet_data.converters.cities import complete_links
from scenarionet_data.ingest.defects import Defect
from scenarionet_data.scenario.description import MapFeatures
from scenarionet_data.scenario.vocabulary import MapFeatureType

Points = Sequence[Mapping[str, float]]
_XYZ = itemgetter("x", "y", "z")


class Argoverse2Lane(NamedTuple):
    """A lane without its geometry; ``marks`` and ``neighbors`` are left, right."""

    id: str
    kind: str
    is_intersection: bool
    marks: tuple[str, str]
    neighbors: tuple[str | None, str | None]
    entries: list[str]
    exits: list[str]


@dataclass(frozen=True, eq=False)
class Argoverse2Map:
    """A map archive in the city frame.

    Attributes:
        lanes: K lanes with mutual links: a lane's successors list it as predecessor.
        left, right, centers: K lines, (P, 3) float64 [m].
        widths: Distance of the left and right side at each centre point, (P, 2) float64 [m].
        areas: Outline (n, 3) of each drivable area, counter-clockwise, by id.
        crossings: Outline (n, 3) of each pedestrian crossing, by id.
        num_completed_links: Number of links listed by one of the two lanes only.
        defects: Elements that cannot be used.
    """

    lanes: list[Argoverse2Lane]
    left: Ragged
    right: Ragged
    centers: Ragged
    widths: Ragged
    areas: dict[str, Float64]
    crossings: dict[str, Float64]
    num_completed_links: int
    defects: tuple[Defect, ...]

    @property
    def ground(self) -> Float64:
        """(G, 3) points on the ground: of centrelines and of area outlines."""
        return np.concatenate([self.centers.values, *self.areas.values()])

    def features(self, origin: Float64) -> MapFeatures:
        """Build all map features, as offsets from ``origin`` (3,) [m]."""
        builder = MapBuilder()
        boundaries = _Boundaries(builder)
        for lane, left, right, center, width in zip(
            self.lanes, self.left, self.right, self.centers, self.widths, strict=True
        ):
            builder.add(
                lane.id,
                LANES.get(lane.kind, MapFeatureType.LANE_UNKNOWN),
                polyline=center,
                polygon=np.concatenate([left, right[::-1]]),
                width=width,
                entry_lanes=lane.entries,
                exit_lanes=lane.exits,
                left_neighbors=[lane.neighbors[0]] if lane.neighbors[0] else (),
                right_neighbors=[lane.neighbors[1]] if lane.neighbors[1] else (),
                left_boundaries=boundaries.add(f"{lane.id}-left", lane.marks[0], left),
                right_boundaries=boundaries.add(f"{lane.id}-right", lane.marks[1], right),
                is_intersection=lane.is_intersection,
                extras=None if lane.kind in ("VEHICLE", "BIKE") else {"lane_type": lane.kind},
            )
        for number, edges in zip(self.areas, road_edges(list(self.areas.values())), strict=True):
            builder.add(f"drivable-{number}", MapFeatureType.DRIVABLE_AREA, polygon=self.areas[number])
            for index, edge in enumerate(edges):
                builder.add(f"drivable-{number}-edge-{index}", MapFeatureType.ROAD_EDGE_BOUNDARY, polyline=edge)
        for number, polygon in self.crossings.items():
            builder.add(f"crossing-{number}", MapFeatureType.CROSSWALK, polygon=polygon)
        return builder.build(origin)


class _Boundaries:
    """Adds the painted sides of lanes; a line with identical points in two lanes is stored once."""

    def __init__(self, builder: MapBuilder) -> None:
        self._builder = builder
        self._stored: dict[tuple[str, bytes], str] = {}

    def add(self, feature_id: str, mark: str, points: Float64) -> tuple[str, ...]:
        """Ids of the lines on one side of a lane: one if painted, else none."""
        if mark == NO_MARK:
            return ()
        for key in ((mark, points.tobytes()), (mark, points[::-1].tobytes())):
            if key in self._stored:
                return (self._stored[key],)
        self._stored[mark, points.tobytes()] = feature_id
        extras = {"mark_type": mark} if mark in INEXACT_MARKS or mark not in MARKS else None
        line = MARKS.get(mark, MapFeatureType.UNKNOWN_LINE)
        self._builder.add(feature_id, line, polyline=points, extras=extras)
        return (feature_id,)


def read_map(path: Path, file: str) -> Argoverse2Map:
    """Read one map archive; elements that cannot be used are left out and listed.

    Args:
        path: The archive.
        file: Its name relative to the raw folder.

    Raises:
        CorruptSource: The file is missing, not a map archive, or has no lane that can be used.
    """
    archive = Archive(path, file)
    try:
        return _parse(archive)
    except (ValueError, TypeError, KeyError, OverflowError):
        archive.leave_out_bad_lines()
    return _parse(archive)


def _parse(archive: Archive) -> Argoverse2Map:
    segments = archive.elements("lane_segments")
    left = _lines(segment["left_lane_boundary"] for segment in segments)
    right = _lines(segment["right_lane_boundary"] for segment in segments)
    is_given = all("centerline" in segment for segment in segments)
    given = _lines(segment["centerline"] for segment in segments) if is_given else midlines(left, right)
    centers, widths = between(given, left, right)
    areas = archive.elements("drivable_areas")
    outlines = _lines(area["area_boundary"] for area in areas)
    crossings = archive.elements("pedestrian_crossings")
    edges = _lines(crossing[edge] for crossing in crossings for edge in ("edge1", "edge2"))
    lanes = [_lane(segment) for segment in segments]
    return Argoverse2Map(
        lanes=lanes,
        left=left,
        right=right,
        centers=centers,
        widths=widths,
        areas={str(area["id"]): outline(points) for area, points in zip(areas, outlines, strict=True)},
        crossings={
            # Both edges have the same direction: the second is reversed to close the outline.
            str(crossing["id"]): np.concatenate([edges[2 * row], edges[2 * row + 1][::-1]])
            for row, crossing in enumerate(crossings)
        },
        # A log's map lists all successors but only about half of the predecessors (107 of 199 links in one real log).
        num_completed_links=complete_links(
            {lane.id: lane.entries for lane in lanes}, {lane.id: lane.exits for lane in lanes}
        ),
        defects=archive.defects.found(),
    )


def _lane(segment: Mapping[str, Any]) -> Argoverse2Lane:
    left, right = segment["left_neighbor_id"], segment["right_neighbor_id"]
    return Argoverse2Lane(
        id=str(segment["id"]),
        kind=segment["lane_type"],
        is_intersection=bool(segment["is_intersection"]),
        marks=(segment["left_lane_mark_type"], segment["right_lane_mark_type"]),
        neighbors=(None if left is None else str(left), None if right is None else str(right)),
        entries=[str(lane) for lane in segment["predecessors"]],
        exits=[str(lane) for lane in segment["successors"]],
    )


def _lines(lists: Iterable[Points]) -> Ragged:
    """Convert lists of {x, y, z} to a ragged array.

    Raises:
        ValueError: A line has fewer than two points, or a coordinate that is NaN or far outside of a city.
    """
    lists = list(lists)
    lengths = [len(points) for points in lists]
    if min(lengths, default=2) < 2:
        raise ValueError(f"a line of {min(lengths)} points")
    values = np.array([*map(_XYZ, chain.from_iterable(lists))], np.float64).reshape(-1, 3)
    if not (np.abs(values) <= MAX_MAP_DISTANCE).all():
        raise ValueError("a coordinate that is not finite or not in a city")
    return Ragged.from_flat(lengths, values)
