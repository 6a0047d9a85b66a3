"""Places where traffic is slow: toll gates, and car parks with a road through them."""

from __future__ import annotations

import math
from itertools import product

import numpy as np

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.procedural.path import PathPieces, Pose, RoadPath
from scenarionet_data.procedural.roadmap import Block, Obstacle, Socket
from scenarionet_data.procedural.sections import add_road, strip
from scenarionet_data.scenario.vocabulary import MapFeatureType, ObjectType

TOLL_ROOM = 3.3
"""Least width of a lane [m] that leaves room for a bus beside a booth."""
_TOLL_LENGTH, _TOLL_SPEED = 20.0, 3.0
"""Length [m] and speed limit [m/s] of MetaDrive's toll gates."""
_TOLL_LEADS = 30.0, 50.0
"""Shortest and longest road before and after a toll gate [m]."""
_ISLAND = 12.0, 0.6
"""Length and width of the islands between the lanes of a toll gate [m]."""
_BOOTH = 2.5, 0.6, 2.4
"""Length, width and height of a booth on an island [m]."""

_SPACES = 2, 10
"""Fewest and most spaces on each side of a car park, as in MetaDrive."""
_SPACE = 2.8, 5.5
"""Width and depth of a space [m]."""
_ENDS = 8.0
"""Road before the first and after the last space [m]: two of MetaDrive's radii of 4 m, on both sides."""
_PARK_SPEED = 20.0 / 3.6
"""Speed limit in a car park [m/s]."""
_TAKEN = 0.7
"""Share of spaces that are taken."""


def toll_gate(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Add a road whose lanes are led between islands with booths, slowly and without changing lanes."""
    before = add_road(block, "a", socket, ((rng.uniform(*_TOLL_LEADS), 0.0),))
    first, width = len(block.lanes), block.road.lane_width
    gate = add_road(block, "b", before, ((_TOLL_LENGTH, 0.0),), separator=MapFeatureType.ROAD_LINE_SOLID_SINGLE_WHITE)
    for lane in block.lanes[first:]:
        lane.speed_limit, lane.left, lane.right = min(_TOLL_SPEED, block.road.speed_limit), None, None
    for i in range(1 - len(socket.backward), len(socket.forward)):
        middle = before.pose.moved(_TOLL_LENGTH / 2.0, -i * width)
        tag = f"b{'b' if i < 0 else 'f'}island{abs(i)}"
        block.add_line(tag, MapFeatureType.ROAD_EDGE_MEDIAN, _ring(middle, *_ISLAND))
        block.obstacles.append(
            Obstacle(ObjectType.TRAFFIC_OBJECT, "toll booth", middle.x, middle.y, middle.heading, _BOOTH)
        )
    block.exit = add_road(block, "c", gate, ((rng.uniform(*_TOLL_LEADS), 0.0),))


def _ring(middle: Pose, length: float, width: float) -> Float64:
    """(5, 2) the outline of a box around a pose, closed."""
    corners = [(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)]
    poses = [middle.moved(ahead * length / 2.0, left * width / 2.0) for ahead, left in corners]
    return np.array([(pose.x, pose.y) for pose in poses])


def parking_lot(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Add a road of one lane each way between spaces for cars, at right angles to it; most of them are taken."""
    width, (across, depth) = block.road.lane_width, _SPACE
    count = int(rng.integers(_SPACES[0], _SPACES[1] + 1))
    first = len(block.lanes)
    length = 2.0 * _ENDS + count * across
    line = RoadPath(socket.pose, ((length, 0.0),))
    rows: PathPieces = ((count * across, 0.0),)
    kerbs = []
    for base in (line, line.reversed()):
        places = [
            (0.0, 0.0),
            (_ENDS, 0.0),
            (_ENDS, depth),
            (length - _ENDS, depth),
            (length - _ENDS, 0.0),
            (length, 0.0),
        ]
        poses = [base.start.moved(ahead, -width - beside) for ahead, beside in places]
        kerbs.append(np.array([(pose.x, pose.y) for pose in poses]))
        beside = RoadPath(base.start.moved(_ENDS, -width - depth / 2.0), rows)
        block.footprint.append(strip(beside, depth / 2.0, depth / 2.0))
    block.exit = add_road(block, "", socket, line.pieces, edge=kerbs[0], other_edge=kerbs[1])
    for lane in block.lanes[first:]:
        lane.speed_limit = min(_PARK_SPEED, block.road.speed_limit)
    for (side, base), k in product((("f", line), ("b", line.reversed())), range(count)):
        space = base.start.moved(_ENDS + (k + 0.5) * across, -width - depth / 2.0, -math.pi / 2.0)
        block.add_area(f"{side}space{k}", MapFeatureType.CARPARK_AREA, _ring(space, depth, across)[:4])
        if rng.random() < _TAKEN:
            size = rng.uniform((4.1, 1.7, 1.4), (4.9, 1.9, 1.7))
            slack = (depth - size[0]) / 2.0 - 0.1
            car = space.moved(float(rng.uniform(-slack, slack)), 0.0, float(rng.choice([0.0, math.pi])))
            block.obstacles.append(
                Obstacle(ObjectType.VEHICLE, "parked car", car.x, car.y, car.heading, tuple(size.tolist()))
            )
