"""Parts of a generated map before conversion to map features: lanes, lines, areas and links between lanes.

Traffic drives on the right. A road has a reference line between its two directions; forward lanes are on its right,
numbered from the reference line outwards, backward lanes on its left. Links are stored once, as pairs, so
that successors and predecessors agree by construction.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import NamedTuple, Protocol

import numpy as np
import shapely
from shapely import Polygon

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.procedural.path import Pose, RoadPath
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType

NO_JUNCTION = -1
LINE_SPACING = 2.0  # [m] between the points of lines and lanes


@dataclass(frozen=True)
class Road:
    """Properties shared by all roads of a map: lane width [m] and speed limit [m/s]."""

    lane_width: float
    speed_limit: float


class LanePath(Protocol):
    """What lanes need of their centreline; see :class:`~scenarionet_data.procedural.path.RoadPath`."""

    @property
    def length(self) -> float:
        """Arc length [m]."""

    @property
    def start(self) -> Pose:
        """Pose at the start."""

    @property
    def max_curvature(self) -> float:
        """Largest absolute curvature [1/m]."""

    def pose_at(self, s: float) -> Pose:
        """Return the pose after ``s`` metres."""

    def sample(self, spacing: float) -> tuple[Float64, Float64]:
        """Return points (n, 2) [m] and headings (n,) [rad], equally spaced."""


@dataclass(eq=False)
class Lane:
    """One lane.

    Attributes:
        id: Unique in the map.
        path: Centreline in driving direction.
        junction: Lanes that may conflict share this number; -1 outside junctions and merges.
        rank: Priority in a junction; the higher rank goes first.
        axis: Which of a junction's two light phases the lane belongs to; -1 without a light.
        is_intersection: Whether it is in an intersection or roundabout.
        left, right: Ids of the adjacent lanes in the same direction.
        left_boundaries, right_boundaries: Ids of the lines that bound it.
        speed_limit: [m/s]; None for that of the map.
        end: Name of the end of the map to which it leads, if it leads out; None for its id without its number.
    """

    id: str
    path: LanePath
    junction: int = NO_JUNCTION
    rank: int = 0
    axis: int = -1
    is_intersection: bool = False
    left: str | None = None
    right: str | None = None
    left_boundaries: tuple[str, ...] = ()
    right_boundaries: tuple[str, ...] = ()
    speed_limit: float | None = None
    end: str | None = None

    @property
    def end_name(self) -> str:
        """Name of the end of the map to which it leads."""
        return self.id.rstrip("0123456789") if self.end is None else self.end

    @cached_property
    def samples(self) -> tuple[Float64, Float64]:
        """Points (n, 2) [m] and headings (n,) [rad] of the centreline."""
        return self.path.sample(LINE_SPACING)

    def outline(self, half_width: float) -> Float64:
        """Return the lane's surface (2 n, 2) [m]: its right side, then its left side reversed."""
        points, headings = self.samples
        left = half_width * np.stack([-np.sin(headings), np.cos(headings)], axis=-1)
        return np.concatenate([points - left, (points + left)[::-1]])


@dataclass(frozen=True, eq=False)
class Line:
    """A painted line, an edge or a stop line: a polyline (n, 2) [m], and the lanes it controls."""

    id: str
    type: MapFeatureType
    points: Float64
    controlled_lanes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Area:
    """A crosswalk or the inside of an intersection: an outline (n, 2) [m]."""

    id: str
    type: MapFeatureType
    outline: Float64
    controlled_lanes: tuple[str, ...] = ()


class Obstacle(NamedTuple):
    """A stationary object: type, name, position [m], heading [rad], and length, width and height [m]."""

    type: ObjectType
    word: str
    x: float
    y: float
    heading: float
    size: tuple[float, float, float]


@dataclass(frozen=True)
class Socket:
    """An open end of a road.

    Attributes:
        pose: On the reference line, heading out of the map built so far.
        forward: Per lane that leaves the map here: ids of the lanes that end at it.
        backward: Per lane that enters the map here: ids of the lanes that start at it.
    """

    pose: Pose
    forward: tuple[tuple[str, ...], ...]
    backward: tuple[tuple[str, ...], ...]


@dataclass(eq=False)
class Block:
    """The part of a map that one road block adds.

    Attributes:
        name: The kind of block, for example ``"curve"``.
        index: Position in the map, unique; prefix of the ids.
        road: Lane width and speed limit.
        links: (lane, its successor).
        footprint: Polygons of the road surface, to keep blocks apart.
        obstacles: What stands on it.
        exit: Open end for the next block.
    """

    name: str
    index: int
    road: Road
    lanes: list[Lane] = field(default_factory=list)
    lines: list[Line] = field(default_factory=list)
    areas: list[Area] = field(default_factory=list)
    links: list[tuple[str, str]] = field(default_factory=list)
    footprint: list[Polygon] = field(default_factory=list)
    obstacles: list[Obstacle] = field(default_factory=list)
    exit: Socket | None = None

    def add_lane(self, tag: str, path: RoadPath, **attributes: object) -> Lane:
        """Add a lane; its id consists of the block's index and ``tag``."""
        lane = Lane(f"{self.index}.{tag}", path, **attributes)  # type: ignore[arg-type]
        self.lanes.append(lane)
        return lane

    def add_line(self, tag: str, kind: MapFeatureType, path: RoadPath | Float64, lanes: tuple[str, ...] = ()) -> str:
        """Add a line along a path or through points; returns its id."""
        points = path.sample(LINE_SPACING)[0] if isinstance(path, RoadPath) else path
        self.lines.append(Line(f"{self.index}.{tag}", kind, points, lanes))
        return self.lines[-1].id

    def add_area(self, tag: str, kind: MapFeatureType, outline: Float64, lanes: tuple[str, ...] = ()) -> None:
        """Add a polygon."""
        self.areas.append(Area(f"{self.index}.{tag}", kind, outline, lanes))

    def link(self, before: tuple[str, ...], after: tuple[str, ...]) -> None:
        """Link every lane of ``before`` to every lane of ``after``."""
        self.links += product(before, after)


@dataclass(frozen=True, eq=False)
class RoadMap:
    """A finished map.

    Attributes:
        road: Lane width and speed limit.
        blocks: In order; the first is the straight road the ego starts on.
        start: Ids of the lanes where the ego may start, from left to right.
        goal: Ids of the lanes at whose end the ego arrives.
        is_mirrored: Whether y is negated where it is written, so that traffic drives on the left.
    """

    road: Road
    blocks: tuple[Block, ...]
    start: tuple[str, ...]
    goal: tuple[str, ...]
    is_mirrored: bool = False

    @cached_property
    def surface(self) -> shapely.Geometry:
        """The surface of its roads, prepared for predicates."""
        surface = shapely.unary_union([shape for block in self.blocks for shape in block.footprint])
        shapely.prepare(surface)
        return surface

    @property
    def lanes(self) -> list[Lane]:
        """Every lane, in order."""
        found: list[Lane] = []
        for block in self.blocks:
            found += block.lanes
        return found

    @property
    def links(self) -> list[tuple[str, str]]:
        """Every (lane, successor)."""
        found: list[tuple[str, str]] = []
        for block in self.blocks:
            found += block.links
        return found
