"""Roundabouts: a ring with one lane per lane of the roads; entering traffic gives way.

Traffic circulates counter-clockwise. Entries and exits are arcs tangent to the ring and to their road.
Arms are numbered as in ``intersection``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from shapely import Polygon

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.procedural.path import Pose, RoadPath, bend
from scenarionet_data.procedural.roadmap import LINE_SPACING, Block, Lane, Socket
from scenarionet_data.procedural.sections import EDGE, SEPARATOR, add_road, ids_of
from scenarionet_data.scenario.vocabulary import MapFeatureType

ENTRY_RADIUS = 12.0  # [m] of the arcs that lead into and out of the ring


@dataclass(frozen=True)
class Ring:
    """The circulating lanes: centre, the radius [m] of each lane from the innermost, lane width [m]."""

    x: float
    y: float
    radii: tuple[float, ...]
    lane_width: float

    def angle(self, i: int) -> float:
        """Angle between an arm's direction and the point where its entry from lane ``i`` touches the ring [rad]."""
        return math.asin(((i + 0.5) * self.lane_width + ENTRY_RADIUS) / (self.radii[i] + ENTRY_RADIUS))

    def pose(self, i: int, angle: float) -> Pose:
        """Pose of ring lane ``i`` in the direction ``angle`` from the centre [rad]."""
        radius = self.radii[i]
        return Pose(self.x + radius * math.cos(angle), self.y + radius * math.sin(angle), angle + math.pi / 2.0)

    def reach(self, i: int) -> float:
        """Distance from the centre at which the entry from lane ``i`` starts to turn [m]."""
        return (self.radii[i] + ENTRY_RADIUS) * math.cos(self.angle(i))


def roundabout(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Add a ring that joins four roads; the ego leaves by any of the other three."""
    count = len(socket.forward)
    approach = add_road(block, "a", socket, ((rng.uniform(15.0, 45.0), 0.0),))
    inner = rng.uniform(14.0, 19.0)
    radii = tuple(inner + k * block.road.lane_width for k in range(count))
    ring = Ring(0.0, 0.0, radii, block.road.lane_width)
    distance = max(map(ring.reach, range(count))) + 2.0
    centre = approach.pose.moved(distance, 0.0, math.pi)
    ring = Ring(centre.x, centre.y, radii, block.road.lane_width)
    arms = [Pose(centre.x, centre.y, centre.heading + arm * math.pi / 2.0) for arm in range(4)]
    leave = int(rng.integers(1, 4))
    for number, arm in enumerate(arms):
        entries, exits = _add_connections(block, ring, number, arm, distance)
        if number == 0:  # the ego's road
            for before, lane in zip(approach.forward, entries, strict=True):
                block.link(before, (lane.id,))
            for lane, after in zip(exits, approach.backward, strict=True):
                block.link((lane.id,), after)
        else:
            opening = Socket(arm.moved(distance, 0.0), ids_of(exits), ids_of(entries))
            end = add_road(block, f"arm{number}", opening, ((rng.uniform(20.0, 60.0), 0.0),))
            block.exit = end if number == leave else block.exit
    _add_ring(block, ring, arms)
    _add_edges(block, ring, arms, distance)


def _add_connections(
    block: Block, ring: Ring, number: int, arm: Pose, distance: float
) -> tuple[list[Lane], list[Lane]]:
    """Add an arm's entries and exits: lane ``i`` of the road, counted from its middle, to ring lane ``i``."""
    entries, exits = [], []
    for i in range(len(ring.radii)):
        inwards, outwards = _entry(ring, arm, i, distance), _exit(ring, arm, i, distance)
        entries.append(block.add_lane(f"in{number}{i}", inwards, junction=block.index, rank=0, is_intersection=True))
        exits.append(block.add_lane(f"out{number}{i}", outwards, junction=block.index, rank=1, is_intersection=True))
    return entries, exits


def _entry(ring: Ring, arm: Pose, i: int, distance: float) -> RoadPath:
    start = arm.moved(distance, (i + 0.5) * ring.lane_width, math.pi)
    return RoadPath(start, ((distance - ring.reach(i), 0.0), bend(ring.angle(i) - math.pi / 2.0, ENTRY_RADIUS)))


def _exit(ring: Ring, arm: Pose, i: int, distance: float) -> RoadPath:
    start = ring.pose(i, arm.heading - ring.angle(i))
    return RoadPath(start, (bend(ring.angle(i) - math.pi / 2.0, ENTRY_RADIUS), (distance - ring.reach(i), 0.0)))


def _add_ring(block: Block, ring: Ring, arms: list[Pose]) -> None:
    """The circulating lanes, cut where entries and exits touch them, and the lines between them."""
    prefix = block.index
    for k, radius in enumerate(ring.radii):
        angle = ring.angle(k)
        for number, arm in enumerate(arms):
            following = (number + 1) % 4
            past = RoadPath(ring.pose(k, arm.heading - angle), (bend(2.0 * angle, radius),))
            on = RoadPath(past.end, (bend(math.pi / 2.0 - 2.0 * angle, radius),))
            for tag, path in (("past", past), ("on", on)):
                block.add_lane(f"{tag}{number}{k}", path, junction=block.index, rank=2, is_intersection=True)
            onward = (f"{prefix}.on{number}{k}",)
            block.link((f"{prefix}.past{number}{k}", f"{prefix}.in{number}{k}"), onward)
            block.link(onward, (f"{prefix}.past{following}{k}", f"{prefix}.out{following}{k}"))


def _add_edges(block: Block, ring: Ring, arms: list[Pose], distance: float) -> None:
    """The island, the circles between ring lanes, the outer edges, and the surface between them."""
    half, outermost = ring.lane_width / 2.0, len(ring.radii) - 1
    start = ring.pose(0, 0.0)
    circle = RoadPath(start, (bend(2.0 * math.pi, ring.radii[0]),))
    circles = [
        block.add_line(f"circle{k}", SEPARATOR if k else EDGE, circle.offset(half - k * ring.lane_width))
        for k in range(len(ring.radii))
    ]
    outline = []
    for number, arm in enumerate(arms):
        following = arms[(number + 1) % 4]
        around = bend(math.pi / 2.0 - 2.0 * ring.angle(outermost), ring.radii[outermost])
        out = _exit(ring, following, outermost, distance)
        edge = _entry(ring, arm, outermost, distance).then(around, *out.pieces).offset(-half)
        outline.append(edge.sample(LINE_SPACING)[0])
        block.add_line(f"edge{number}", EDGE, outline[-1])
    _bound_lanes(block, circles, outermost)
    block.footprint.append(Polygon(np.concatenate(outline)))
    _add_surface(block, ring, arms, distance, outline)


def _add_surface(block: Block, ring: Ring, arms: list[Pose], distance: float, outline: list[Float64]) -> None:
    """The splitter islands, and what may be driven on: a quarter from each arm's middle to the next one's.

    Quarters, because an area has one outline and no holes.
    """
    splitters = [_splitter(ring, arm, distance) for arm in arms]
    for number, arm in enumerate(arms):
        entry_side, following = splitters[number][0], (number + 1) % 4
        island = RoadPath(ring.pose(0, arm.heading), (bend(math.pi / 2.0, ring.radii[0]),)).offset(
            ring.lane_width / 2.0
        )
        inner, before, after = island.sample(1.0)[0], _mouth(ring, arm), _mouth(ring, arms[following])
        exit_side = splitters[following][1]
        shape = np.concatenate([outline[number], exit_side[::-1], after, inner[::-1], before, entry_side[::-1]])
        block.add_area(f"quarter{number}", MapFeatureType.INTERSECTION, shape)
        around = np.concatenate([*splitters[number], entry_side[:1]])
        block.add_line(f"splitter{number}", MapFeatureType.ROAD_EDGE_MEDIAN, around)


def _mouth(ring: Ring, arm: Pose) -> Float64:
    """(1, 2) the point of the ring's outer edge in the middle of an arm."""
    reach = ring.radii[-1] + ring.lane_width / 2.0
    return np.array([[ring.x + reach * math.cos(arm.heading), ring.y + reach * math.sin(arm.heading)]])


def _splitter(ring: Ring, arm: Pose, distance: float) -> tuple[Float64, Float64]:
    """The sides of the island between an arm's entry and exit: along the entry to the ring, and along the exit back."""
    half = ring.lane_width / 2.0
    sides = []
    for path in (_entry(ring, arm, 0, distance), _exit(ring, arm, 0, distance)):
        points = path.offset(half).sample(1.0)[0]
        outside = np.hypot(points[:, 0] - ring.x, points[:, 1] - ring.y) > ring.radii[-1] + half + 0.1
        sides.append(points[outside])
    return sides[0], sides[1]


def _bound_lanes(block: Block, circles: list[str], outermost: int) -> None:
    """Set the boundaries of the ring's lanes and connections."""
    for lane in block.lanes:
        tag, number, k = lane.id.split(".")[1][:-2], lane.id[-2], lane.id[-1]
        if tag in ("past", "on"):
            lane.left_boundaries = (circles[int(k)],)
            inside = int(k) < outermost
            lane.right_boundaries = (circles[int(k) + 1],) if inside else ()
        if int(k) == outermost and tag in ("on", "in"):
            lane.right_boundaries = (f"{block.index}.edge{number}",)
        if int(k) == outermost and tag == "out":
            lane.right_boundaries = (f"{block.index}.edge{(int(number) - 1) % 4}",)
