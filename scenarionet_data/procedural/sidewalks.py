"""Where people walk on a generated map: along the edges of roads, and over crosswalks; and who does."""

from __future__ import annotations

import math

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64, RecordArray
from scenarionet_data.procedural.graph import CROSSING, LaneGraph
from scenarionet_data.procedural.path import Pose, RoadPath, bend
from scenarionet_data.procedural.roadmap import RoadMap
from scenarionet_data.procedural.walking import SPACING, WALKER, Walkers
from scenarionet_data.scenario.vocabulary import MapFeatureType

ASIDE = 3.4
"""Distance of those who walk from the road's edge [m]; parked cars are between."""
SIZES = (0.4, 0.6), (0.45, 0.7), (1.55, 1.9)
"""Least and largest length, width and height of people [m]."""
_BESIDE = 1.6
"""Distance between those who walk along the road and those who are about to cross it [m]."""
_RIGHT = 0.5
"""Distance to the right of their way's middle at which people keep [m]."""
_CORNER = 1.0
"""Radius in which they turn [m]."""
_AT_THE_KERB = 0.6
"""Distance from the road at which they wait [m]."""
_APPROACH = 8.0, 30.0
"""Way along the road before and after a crosswalk [m]."""
_SHORTEST = 15.0
"""Length of a way along a road [m]."""
_PACE = 1.34, 0.26
"""Mean and standard deviation of the speed of people [m/s] (Weidmann 1993)."""
_HESITATION = 1.0
"""Mean time for which they stand at the kerb although they could walk [s]."""


def add_crossings(road_map: RoadMap, graph: LaneGraph) -> LaneGraph:
    """Return the graph with the places where its lanes lead over crosswalks; to enter these lanes needs a grant."""
    found, walks = [], 0
    number = {lane.id: row for row, lane in enumerate(road_map.lanes)}
    for block in road_map.blocks:
        inside = [lane for lane in block.lanes if lane.is_intersection]
        for area in block.areas:
            if area.type != MapFeatureType.CROSSWALK:
                continue
            shape = shapely.Polygon(area.outline)
            for lane in inside:
                points = lane.path.sample(0.5)[0]
                on = np.flatnonzero(shapely.contains_xy(shape, *points.T))
                if len(on):
                    end = lane.path.length * (on[-1] + 1) / (len(points) - 1)
                    found.append((number[lane.id], walks, end, lane.id in area.controlled_lanes))
            walks += 1
    crossings: RecordArray = np.array(sorted(found), CROSSING).view(np.recarray)
    lanes = graph.lanes.copy()
    lanes.needs_grant[crossings.lane] = True
    lanes.crossings_begin = np.searchsorted(crossings.lane, np.arange(len(lanes)), side="left")
    lanes.crossings_end = np.searchsorted(crossings.lane, np.arange(len(lanes)), side="right")
    return graph._replace(lanes=lanes, crossings=crossings, claims=np.zeros(walks, np.int64))


def people_on(
    road_map: RoadMap, density: float, duration: float, dt: float, rng: np.random.Generator
) -> tuple[Walkers, Float64]:
    """Draw who walks where: ``density`` people per 100 m of way, from before a time [s] begins to its end.

    Returns:
        The people, and their sizes (P, 3) [m].
    """
    surface = road_map.surface
    ways = [*ways_along_roads(road_map, surface, rng), *ways_over_crosswalks(road_map, surface, rng)]
    rows, points, first = [], [np.zeros((0, 3))], 0
    for way, kerb, beyond, walk in ways:
        along = np.append(0.0, np.cumsum(np.hypot(*np.diff(way, axis=0).T)))
        at = np.arange(0.0, along[-1], SPACING)
        length = SPACING * (len(at) - 2)
        transit = length / _PACE[0]
        count = rng.poisson(density / 100.0 * length * (1.0 + duration / transit))
        for _ in range(count):
            pace = float(np.clip(rng.normal(*_PACE), 0.6, 2.2))
            begins = rng.uniform(-transit, duration)
            s = min(max(-begins, 0.0) * pace, kerb - 2.0 if np.isfinite(kerb) else length - 2.0)
            hesitation = rng.exponential(_HESITATION)
            rows.append((first, length, kerb, beyond, walk, pace, hesitation, max(begins, 0.0) / dt, s, pace))
        if count:
            even = np.stack([np.interp(at, along, column) for column in way.T], axis=-1)
            ahead = steps_of(even)
            points.append(np.column_stack([even, np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))]))
            first += len(at)
    people: RecordArray = np.array([(*row, 0.0, False, False, False) for row in rows], WALKER).view(np.recarray)
    low, high = np.array(SIZES).T
    sizes = low + rng.random((len(people), 1)) * (high - low)
    return Walkers(people, np.concatenate(points)), sizes


def ways_along_roads(
    road_map: RoadMap, surface: shapely.Geometry, rng: np.random.Generator
) -> list[tuple[Float64, float, float, int]]:
    """Ways beside the edges of roads, as points (n, 2), without a kerb."""
    found = []
    for block in road_map.blocks:
        for line in block.lines:
            if not line.id.endswith("edge") or line.type != MapFeatureType.ROAD_EDGE_BOUNDARY:
                continue
            ahead = steps_of(line.points)
            ahead /= np.hypot(*ahead.T)[:, None]
            points = line.points + (ASIDE + _BESIDE) * np.stack([ahead[:, 1], -ahead[:, 0]], axis=-1)
            beside = shapely.LineString(points)
            if beside.length > _SHORTEST and beside.is_simple and not shapely.dwithin(surface, beside, 0.5):
                found.append((points[:: rng.choice([1, -1])], math.inf, math.inf, -1))
    return found


def ways_over_crosswalks(
    road_map: RoadMap, surface: shapely.Geometry, rng: np.random.Generator
) -> list[tuple[Float64, float, float, int]]:
    """Ways along a road to each crosswalk, over it, and back on the other side, in both directions."""
    found, walk = [], -1
    for block in road_map.blocks:
        for area in block.areas:
            if area.type != MapFeatureType.CROSSWALK:
                continue
            walk += 1
            near_left, near_right, far_right, far_left = area.outline
            outwards = math.atan2(*(near_left - far_left)[::-1])
            for side, start, end in (
                (1.0, near_left + far_left, near_right + far_right),
                (-1.0, near_right + far_right, near_left + far_left),
            ):
                across = float(np.hypot(*(end - start))) / 2.0
                before, after = rng.uniform(*_APPROACH, 2)
                foot = Pose(float(start[0]) / 2.0, float(start[1]) / 2.0, outwards)
                begin = foot.moved(before, side * ASIDE, math.pi)
                turn = bend(side * math.pi / 2.0, _CORNER)
                straights = before - _CORNER, across + 2.0 * (ASIDE - _CORNER), after - _CORNER
                pieces = ((straights[0], 0.0), turn, (straights[1], 0.0), turn, (straights[2], 0.0))
                way = RoadPath(begin, pieces).offset(-_RIGHT)
                points = way.sample(SPACING)[0]
                kerb = way.pieces[0][0] + way.pieces[1][0] + ASIDE - _CORNER - _AT_THE_KERB
                beyond = kerb + 2.0 * _AT_THE_KERB + across
                along = np.arange(len(points)) * SPACING
                outside = [shapely.LineString(points[part]) for part in (along < kerb, along > beyond + _AT_THE_KERB)]
                if not shapely.dwithin(surface, outside, 0.3).any():
                    found.append((points, kerb, beyond, walk))
    return found


def steps_of(points: Float64) -> Float64:
    """Central differences of points (n, 2), at ends one-sided: those of ``numpy.gradient``, which takes much longer."""
    steps = np.empty_like(points)
    steps[1:-1] = (points[2:] - points[:-2]) / 2.0
    steps[0], steps[-1] = points[1] - points[0], points[-1] - points[-2]
    return steps
