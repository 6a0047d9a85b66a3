"""Maps that were not generated, as roads for generated traffic: junctions, priorities, lights, starts and goals.

Lanes that cross, or end in one place, are a junction; where a traffic light of the map controls one of its lanes, all
have lights. Straight lanes go first, then right turns. Traffic leaves where lanes end; on maps that have hardly any
ends, lanes that are drawn at random are ends as well.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.errors import BadParameter
from scenarionet_data.procedural.path import Pose
from scenarionet_data.procedural.roadmap import NO_JUNCTION, Block, Lane, Road, RoadMap
from scenarionet_data.scenario.parts import MapFeatures
from scenarionet_data.scenario.vocabulary import MapFeatureType, is_lane

_SAME_POINT = 0.5
"""Distance of lanes' ends that are one place [m]."""
_BRIDGE = 3.0
"""Difference of heights [m] from which a lane leads over another one."""
_STRAIGHT = 0.35
"""Turn [rad] below which a lane leads straight on."""
_SMOOTH = 3
"""Points of a sampled path over which its curvature is measured, on each side."""
_FEWEST_ENDS = 4
_SHORTEST = 25.0
"""Length of a lane [m] on which the ego may start, or that is made an end."""
_JOURNEY = (100.0, 500.0)
"""Length of the ego's way [m], if there is one."""
_LIMIT, _WIDTH = 50.0 / 3.6, 3.5
"""Speed limit [m/s] and width [m] of lanes without one."""


@dataclass(frozen=True, eq=False)
class DrawnPath:
    """A path through points (n, 2) [m], of which none is repeated; see :class:`~.path.RoadPath`."""

    points: Float64

    @cached_property
    def along(self) -> Float64:
        """(n,) arc length of each point [m]."""
        return np.append(0.0, np.cumsum(np.hypot(*np.diff(self.points, axis=0).T)))

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(self.along[-1])

    @property
    def start(self) -> Pose:
        """Pose at the start."""
        return self.pose_at(0.0)

    @property
    def end(self) -> Pose:
        """Pose at the end."""
        return self.pose_at(self.length)

    @cached_property
    def max_curvature(self) -> float:
        """Largest absolute curvature [1/m], over a few metres."""
        points, headings = self.sample(1.0)
        if len(points) <= 2 * _SMOOTH:
            return abs(math.remainder(headings[-1] - headings[0], 2.0 * math.pi)) / self.length
        turned = np.unwrap(headings)
        return float(np.abs(turned[2 * _SMOOTH :] - turned[: -2 * _SMOOTH]).max()) / (
            2 * _SMOOTH * self.length / (len(points) - 1)
        )

    def pose_at(self, s: float) -> Pose:
        """Return the pose after ``s`` metres."""
        row = int(np.clip(np.searchsorted(self.along, s) - 1, 0, len(self.points) - 2))
        dx, dy = self.points[row + 1] - self.points[row]
        x, y = (float(np.interp(s, self.along, column)) for column in self.points.T)
        return Pose(x, y, math.atan2(dy, dx))

    def sample(self, spacing: float) -> tuple[Float64, Float64]:
        """Return points (n, 2) [m] and headings (n,) [rad], spaced equally by at most ``spacing``, ends included."""
        at = np.linspace(0.0, self.length, max(2, math.ceil(self.length / spacing - 1e-9) + 1))
        points = np.stack([np.interp(at, self.along, column) for column in self.points.T], axis=1)
        ahead = np.gradient(points, axis=0)
        return points, np.arctan2(ahead[:, 1], ahead[:, 0])


@dataclass(frozen=True, eq=False)
class DrawnMap:
    """The lanes of a map.

    Attributes:
        road: Usual width and speed limit.
        lanes: Lanes by id.
        exits: Successors of each lane.
    """

    road: Road
    lanes: Mapping[str, Lane]
    exits: Mapping[str, tuple[str, ...]]

    @classmethod
    def of(cls, features: MapFeatures, origin: Float64) -> DrawnMap:
        """Read the lanes of a map whose features are relative to ``origin`` (3,) [m].

        Raises:
            BadParameter: It has no lanes.
        """
        paths: dict[str, DrawnPath] = {}
        heights: dict[str, float] = {}
        for row in np.flatnonzero(is_lane(features.feature_type)).tolist():
            points = features.polyline[row].astype(np.float64)
            points = (
                points[np.append(True, np.hypot(*np.diff(points[:, :2], axis=0).T) > 1e-3)] if len(points) else points
            )
            if len(points) > 1 and features.feature_type[row] != MapFeatureType.LANE_BIKE_LANE:
                paths[features.ids[row]] = DrawnPath(points[:, :2] + origin[:2])
                heights[features.ids[row]] = float(points[:, 2].mean())
        if not paths:
            raise BadParameter("map: expected lanes for traffic, found none")
        rows = {name: row for row, name in enumerate(features.ids)}
        exits = {name: tuple(each for each in features.exit_lanes[rows[name]] if each in paths) for name in paths}
        junction = _junctions(paths, heights, exits)
        lit = _lit(features, junction, exits)
        limits = [float(features.speed_limit[rows[name]]) for name in paths]
        widths = [
            float(np.median(features.width[rows[name]].sum(axis=1)))
            for name in paths
            if len(features.width[rows[name]])
        ]
        first: dict[int, float] = {}
        lanes = {}
        for name, limit in zip(paths, limits, strict=True):
            path, row, number = paths[name], rows[name], junction.get(name, NO_JUNCTION)
            turn = math.remainder(path.end.heading - path.start.heading, 2.0 * math.pi)
            away = path.start.heading - first.setdefault(number, path.start.heading)
            lanes[name] = Lane(
                name,
                path,
                junction=number,
                rank=2 if abs(turn) < _STRAIGHT else int(turn < 0.0),
                axis=int(abs(math.sin(away)) > math.sqrt(0.5)) if number in lit else -1,
                is_intersection=number != NO_JUNCTION,
                left=next((each for each in features.left_neighbors[row] if each in paths), None),
                right=next((each for each in features.right_neighbors[row] if each in paths), None),
                speed_limit=limit if limit > 0 else None,
            )
        known = [limit for limit in limits if limit > 0]
        road = Road(float(np.median(widths or [_WIDTH])), float(np.median(known or [_LIMIT])))
        return cls(road, {name: replace(lane, end=_leftmost(name, lanes)) for name, lane in lanes.items()}, exits)

    def with_ends(self, rng: np.random.Generator) -> RoadMap:
        """Return the map with a start and a goal for the ego.

        Raises:
            BadParameter: No lane is long enough to start on.
        """
        exits = dict(self.exits)
        usable = [
            name for name, lane in self.lanes.items() if lane.junction == NO_JUNCTION and lane.path.length > _SHORTEST
        ]
        if not usable:
            raise BadParameter(f"map: expected a lane of {_SHORTEST:g} m or more outside of junctions, found none")
        ends = [name for name, after in exits.items() if not after]
        for name in rng.permutation(usable).tolist() if len(ends) < _FEWEST_ENDS else ():
            if len(ends) < 2 * _FEWEST_ENDS:
                exits[name] = ()
                ends.append(name)
        best: tuple[float, str, str] | None = None
        for goal in rng.permutation(ends).tolist():
            ways = _ways(goal, exits, self.lanes)
            far = [name for name in usable if name != goal and _JOURNEY[0] <= ways.get(name, 0.0) <= _JOURNEY[1]]
            if far:
                return self._road_map(exits, far[int(rng.integers(len(far)))], goal)
            for name in usable:
                if name in ways and (best is None or ways[name] > best[0]):
                    best = ways[name], name, goal
        if best is None:
            raise BadParameter("map: expected a lane from which another one can be reached, found none")
        return self._road_map(exits, best[1], best[2])

    def _road_map(self, exits: Mapping[str, tuple[str, ...]], start: str, goal: str) -> RoadMap:
        block = Block("map", 0, self.road, lanes=list(self.lanes.values()))
        block.links = [(name, after) for name, others in exits.items() for after in others]
        goals = [name for name, lane in self.lanes.items() if lane.end == self.lanes[goal].end and not exits[name]]
        return RoadMap(self.road, (block,), (start,), tuple(goals))


def _junctions(
    paths: Mapping[str, DrawnPath], heights: Mapping[str, float], exits: Mapping[str, tuple[str, ...]]
) -> dict[str, int]:
    """Number of the junction of each lane that crosses another one, or ends where another one does."""
    names = list(paths)
    number = {name: row for row, name in enumerate(names)}
    lines = np.array([shapely.LineString(paths[name].points) for name in names])
    starts, ends = (np.array([paths[name].points[place] for name in names]) for place in (0, -1))
    meets = defaultdict[int, set[int]](set)
    linked = {frozenset((number[name], number[after])) for name, others in exits.items() for after in others}
    for i, j in shapely.STRtree(lines).query(lines, predicate="dwithin", distance=_SAME_POINT).T.tolist():
        if i >= j or frozenset((i, j)) in linked or abs(heights[names[i]] - heights[names[j]]) > _BRIDGE:
            continue
        ends_together = np.hypot(*(ends[i] - ends[j])) < _SAME_POINT
        begins_together = np.hypot(*(starts[i] - starts[j])) < _SAME_POINT
        if ends_together or (not begins_together and bool(shapely.crosses(lines[i], lines[j]))):
            meets[i].add(j)
            meets[j].add(i)
    found: dict[str, int] = {}
    for first in sorted(meets):
        waiting = [] if names[first] in found else [first]
        junction = len(set(found.values()))
        while waiting:
            each = waiting.pop()
            if names[each] not in found:
                found[names[each]] = junction
                waiting += meets[each]
    return found


def _lit(features: MapFeatures, junction: Mapping[str, int], exits: Mapping[str, tuple[str, ...]]) -> set[int]:
    """Junctions with traffic lights: of lanes that one controls, or that follow these."""
    controlled = {
        name
        for row in np.flatnonzero(features.feature_type == MapFeatureType.TRAFFIC_LIGHT).tolist()
        for name in features.controlled_lanes[row]
    }
    return {junction[each] for name in controlled for each in (name, *exits.get(name, ())) if each in junction}


def _leftmost(name: str, lanes: Mapping[str, Lane]) -> str:
    """The lane at the left of all lanes beside one: the name of their end of the map."""
    seen = {name}
    while (left := lanes[name].left) is not None and left not in seen:
        seen.add(left)
        name = left
    return name


def _ways(goal: str, exits: Mapping[str, tuple[str, ...]], lanes: Mapping[str, Lane]) -> dict[str, float]:
    """Length of the shortest way [m] from the start of each lane to the end of ``goal``."""
    before = defaultdict[str, list[str]](list)
    for name, others in exits.items():
        for after in others:
            before[after].append(name)
    found, waiting = dict[str, float](), [(lanes[goal].path.length, goal)]
    while waiting:
        waiting.sort(reverse=True)
        way, name = waiting.pop()
        if name not in found:
            found[name] = way
            waiting += [(way + lanes[each].path.length, each) for each in before[name] if each not in found]
    return found
