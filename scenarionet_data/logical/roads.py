"""Roads of logical scenarios, and routes on them whose poses are computed for many road users at once."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
import shapely

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.building import MapBuilder
from scenarionet_data.converters.formats.map_files import read_map
from scenarionet_data.converters.pg import map_features
from scenarionet_data.errors import BadParameter
from scenarionet_data.logical.description import RoadSpec
from scenarionet_data.procedural.drawn_map import DrawnMap
from scenarionet_data.procedural.intersection import cross
from scenarionet_data.procedural.path import Pose, RoadPath
from scenarionet_data.procedural.roadmap import Block, LanePath, Road, RoadMap, Socket
from scenarionet_data.procedural.sections import add_road

_CHORD = 0.25  # [m] between points where crossings of routes are found
_ASIDE = 40.0
"""Length of a route across another one on each side [m]."""


@dataclass(frozen=True, eq=False)
class Route:
    """A line of arcs.

    Attributes:
        arcs: (K, 5) arc length, x, y [m] and heading [rad] at the start, curvature [1/m].
        length: [m].
    """

    arcs: Float64
    length: float

    def poses(self, along: Float64) -> tuple[Float64, Float64, Float64]:
        """Return points (..., 2) [m], headings [rad] and curvatures [1/m] at arc lengths; straight beyond ends."""
        row = np.clip(np.searchsorted(self.arcs[:, 0], along, side="right") - 1, 0, len(self.arcs) - 1)
        start, x, y, heading, curvature = np.moveaxis(self.arcs[row], -1, 0)
        curvature = np.where((along < 0) | (along > self.length), 0.0, curvature)
        ahead = along - start
        half = 0.5 * curvature * ahead
        chord = ahead * np.sinc(half / np.pi)
        points = np.stack([x + chord * np.cos(heading + half), y + chord * np.sin(heading + half)], axis=-1)
        return points, heading + 2.0 * half, curvature

    def crossing(self, other: Route) -> tuple[float, float, float]:
        """Return the arc length on this route and on the other where they first cross, and the angle [rad].

        Raises:
            BadParameter: They do not.
        """
        lines = [
            shapely.LineString(each.poses(np.linspace(0.0, each.length, round(each.length / _CHORD) + 1))[0])
            for each in (self, other)
        ]
        points = [part for part in shapely.get_parts(lines[0].intersection(lines[1])) if part.geom_type == "Point"]
        if not points:
            raise BadParameter("the routes of two road users, of which one passes after the other, do not cross")
        first = min(points, key=lines[0].project)
        here, there = lines[0].project(first), lines[1].project(first)
        turn = self.poses(np.array(here))[1] - other.poses(np.array(there))[1]
        return here, there, math.remainder(float(turn), 2.0 * math.pi)


@dataclass(frozen=True, eq=False)
class DrawnRoad:
    """The map of a logical scenario: its features, and the paths of its lanes by id."""

    features: MapBuilder
    paths: Mapping[str, LanePath]
    default: str

    def route(self, lanes: Iterable[str]) -> Route:
        """Return the route over consecutive lanes.

        Raises:
            BadParameter: There is no such lane.
        """
        rows, length = [], 0.0
        for name in lanes or (self.default,):
            if name not in self.paths:
                raise BadParameter(f"route: lane {name!r} is unknown; the road has {', '.join(list(self.paths)[:40])}")
            part = _arcs(self.paths[name])
            part[:, 0] += length
            rows.append(part)
            length += self.paths[name].length
        return Route(np.concatenate(rows), length)


def across(route: Route, along: float) -> Route:
    """Return the route straight across another one, from its right to its left."""
    points, heading, _ = route.poses(np.array(along))
    start = Pose(float(points[0]), float(points[1]), float(heading)).moved(0.0, -_ASIDE, math.pi / 2.0)
    return Route(np.array([[0.0, start.x, start.y, start.heading, 0.0]]), 2.0 * _ASIDE)


def _arcs(path: LanePath) -> Float64:
    """Arcs (K, 5) of a lane."""
    if isinstance(path, RoadPath):
        rows, at = [], 0.0
        for length, curvature in path.pieces:
            pose = path.pose_at(at)
            rows.append((at, pose.x, pose.y, pose.heading, curvature))
            at += length
        return np.array(rows)
    points, headings = path.sample(2.0)
    along = np.linspace(0.0, path.length, len(points))
    turned = np.unwrap(headings)
    return np.column_stack([along, points, turned, np.append(np.diff(turned) / np.diff(along), 0.0)])


@lru_cache(maxsize=4)
def draw_road(spec: RoadSpec) -> DrawnRoad:
    """Draw a road.

    Raises:
        BadParameter: It cannot be.
    """
    if spec.map:
        features = read_map(Path(spec.map))
        drawn = DrawnMap.of(features.build(np.zeros(3)), np.zeros(3))
        return DrawnRoad(features, {name: lane.path for name, lane in drawn.lanes.items()}, next(iter(drawn.lanes)))
    widest = max(spec.lanes, spec.opposite) * spec.width
    if not (spec.lanes >= 1 <= spec.opposite and spec.width > 0 and spec.length >= 50 and spec.speed_limit > 0):
        raise BadParameter(f"{spec}: wanted lanes and opposite of 1 or more, length of 50 or more, and width above 0")
    if 0 < abs(spec.radius) < widest + 5.0:
        raise BadParameter(f"radius={spec.radius:g}: wanted 0, or more than the road is wide, {widest:g} m")
    block = Block("road", 0, Road(spec.width, spec.speed_limit))
    curvature = 1.0 / spec.radius if spec.radius else 0.0
    entrance = Socket(Pose(0.0, 0.0, 0.0), ((),) * spec.lanes, ((),) * spec.opposite)
    tag = "" if spec.kind == "road" else "a"
    end = add_road(block, tag, entrance, ((spec.length, curvature),))
    if spec.kind == "intersection":
        cross(block, end, (0, 1, 2, 3), spec.lanes, lambda: spec.length)
    road_map = RoadMap(block.road, (block,), (), ())
    return DrawnRoad(map_features(road_map), {lane.id: lane.path for lane in block.lanes}, f"0.{tag}f{spec.lanes - 1}")
