"""Sections of two-way road: parallel lanes along a reference line, with their lines, edges and tapers."""

from __future__ import annotations

import math

import numpy as np
from shapely import Polygon

from scenarionet_data.arrays.dtypes import Float64
from scenarionet_data.procedural.path import PathPieces, Pose, RoadPath, bend, shift
from scenarionet_data.procedural.roadmap import LINE_SPACING, Block, Lane, Socket
from scenarionet_data.scenario.vocabulary import MapFeatureType

EDGE = MapFeatureType.ROAD_EDGE_BOUNDARY
DIVIDER = MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW
SEPARATOR = MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE


def add_road(
    block: Block,
    tag: str,
    socket: Socket,
    pieces: PathPieces,
    *,
    edge: RoadPath | Float64 | None = None,
    other_edge: RoadPath | Float64 | None = None,
    separator: MapFeatureType = SEPARATOR,
) -> Socket:
    """Continue every lane of ``socket`` along ``pieces``.

    Args:
        block: Gets the lanes and lines.
        tag: Name of the section within the block.
        socket: Start of the section.
        pieces: Of the reference line.
        edge: The right edge, if not parallel to the reference line.
        other_edge: That of the other direction, in its direction.
        separator: Type of the lines between lanes.

    Returns:
        The open end.
    """
    line = RoadPath(socket.pose, pieces)
    width = block.road.lane_width
    divider = block.add_line(f"{tag}divider", DIVIDER, line)
    lines = divider, separator
    forward = _add_side(block, f"{tag}f", line, len(socket.forward), lines, edge)
    backward = _add_side(block, f"{tag}b", line.reversed(), len(socket.backward), lines, other_edge)
    for before, lane in zip(socket.forward, forward, strict=True):
        block.link(before, (lane.id,))
    for after, lane in zip(socket.backward, backward, strict=True):
        block.link((lane.id,), after)
    block.footprint.append(strip(line, len(backward) * width, len(forward) * width))
    return Socket(line.end, ids_of(forward), ids_of(backward))


def ids_of(lanes: list[Lane]) -> tuple[tuple[str, ...], ...]:
    """Return the id of each lane as one end of a :class:`Socket`."""
    return tuple((lane.id,) for lane in lanes)


def _add_side(
    block: Block,
    tag: str,
    line: RoadPath,
    count: int,
    lines: tuple[str, MapFeatureType],
    edge: RoadPath | Float64 | None,
) -> list[Lane]:
    """Add ``count`` lanes on the right of ``line``, in its direction, for a divider and a type of ``lines`` between."""
    width = block.road.lane_width
    lanes, boundaries = list[Lane](), [lines[0]]
    for i in range(count):
        lanes.append(block.add_lane(f"{tag}{i}", line.offset(-(i + 0.5) * width)))
        if i:
            boundaries.append(block.add_line(f"{tag}line{i}", lines[1], line.offset(-i * width)))
    boundaries.append(block.add_line(f"{tag}edge", EDGE, line.offset(-count * width) if edge is None else edge))
    for i, lane in enumerate(lanes):
        lane.left_boundaries, lane.right_boundaries = (boundaries[i],), (boundaries[i + 1],)
        lane.left = lanes[i - 1].id if i else None
        lane.right = lanes[i + 1].id if i + 1 < count else None
    return lanes


def add_widening(block: Block, tag: str, socket: Socket, length: float) -> Socket:
    """Add a taper in which the rightmost lane splits in two."""
    width = block.road.lane_width
    count = len(socket.forward)
    edge = RoadPath(socket.pose.moved(0.0, -count * width), shift(length, -width))
    end = add_road(block, tag, socket, ((length, 0.0),), edge=edge)
    path = edge.offset(width / 2.0)
    branch = block.add_lane(f"{tag}branch", path, right_boundaries=(f"{block.index}.{tag}fedge",))
    block.link(socket.forward[-1], (branch.id,))
    block.footprint.append(strip(path, width / 2.0, width / 2.0))
    return Socket(end.pose, (*end.forward, (branch.id,)), end.backward)


def add_narrowing(block: Block, tag: str, socket: Socket, length: float, junction: int) -> Socket:
    """Add a taper in which the rightmost lane gives way and joins the lane on its left."""
    width = block.road.lane_width
    count = len(socket.forward)
    edge = RoadPath(socket.pose.moved(0.0, -count * width), shift(length, width))
    main = Socket(socket.pose, socket.forward[:-1], socket.backward)
    end = add_road(block, tag, main, ((length, 0.0),), edge=edge)
    for lane in block.lanes:
        if lane.id in end.forward[-1]:
            lane.junction, lane.rank = junction, 1
    right = (f"{block.index}.{tag}fedge",)
    path = edge.offset(width / 2.0)
    joining = block.add_lane(f"{tag}join", path, junction=junction, right_boundaries=right)
    block.link(socket.forward[-1], (joining.id,))
    block.footprint.append(strip(path, width / 2.0, width / 2.0))
    return Socket(end.pose, (*end.forward[:-1], (*end.forward[-1], joining.id)), end.backward)


def strip(line: RoadPath, left: float, right: float) -> Polygon:
    """Return the surface between lateral offsets ``left`` and ``right`` [m] of a line."""
    spacing = 2.0 * LINE_SPACING
    sides = line.offset(left).sample(spacing)[0], line.offset(-right).sample(spacing)[0][::-1]
    return Polygon(np.concatenate(sides))


TAPER = 25.0  # [m] over which a lane opens or closes
RAMP_LANE = (40.0, 60.0)  # [m] shortest and longest acceleration or deceleration lane


def straight(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Add a straight road."""
    block.exit = add_road(block, "", socket, ((rng.uniform(20.0, 130.0), 0.0),))


def curve(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Add a bend to the left or right between two short straight sections."""
    radius = rng.uniform(30.0, 90.0)
    turn = rng.uniform(0.3, min(1.9, 130.0 / radius)) * rng.choice([-1.0, 1.0])
    pieces = ((rng.uniform(5.0, 15.0), 0.0), bend(turn, radius), (rng.uniform(5.0, 15.0), 0.0))
    block.exit = add_road(block, "", socket, pieces)


def fork(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Split the rightmost lane: the road continues with one more lane."""
    before = add_road(block, "a", socket, ((rng.uniform(5.0, 30.0), 0.0),))
    wide = add_widening(block, "b", before, TAPER)
    block.exit = add_road(block, "c", wide, ((rng.uniform(10.0, 60.0), 0.0),))


def merge(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """End the rightmost lane: the road continues with one lane fewer."""
    before = add_road(block, "a", socket, ((rng.uniform(40.0, 60.0), 0.0),))
    narrow = add_narrowing(block, "b", before, TAPER, block.index)
    block.exit = add_road(block, "c", narrow, ((rng.uniform(5.0, 30.0), 0.0),))


def on_ramp(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Add a ramp that joins from the right through an acceleration lane."""
    before = add_road(block, "a", socket, ((rng.uniform(15.0, 30.0), 0.0),))
    joint = _ramp_joint(block, before)
    turn, radius = rng.uniform(0.35, 0.6), rng.uniform(45.0, 70.0)
    away = RoadPath(joint.moved(0.0, 0.0, math.pi), (bend(turn, radius), (rng.uniform(25.0, 40.0), 0.0)))
    ramp = _add_ramp(block, away.reversed())
    wide = Socket(before.pose, (*before.forward, (ramp.id,)), before.backward)
    beside = add_road(block, "b", wide, ((rng.uniform(*RAMP_LANE), 0.0),))
    narrow = add_narrowing(block, "c", beside, TAPER, block.index)
    block.exit = add_road(block, "d", narrow, ((10.0, 0.0),))


def off_ramp(block: Block, socket: Socket, rng: np.random.Generator) -> None:
    """Add a deceleration lane on the right that leaves the road by a ramp."""
    before = add_road(block, "a", socket, ((rng.uniform(10.0, 20.0), 0.0),))
    wide = add_widening(block, "b", before, TAPER)
    beside = add_road(block, "c", wide, ((rng.uniform(*RAMP_LANE), 0.0),))
    main = Socket(beside.pose, beside.forward[:-1], beside.backward)
    turn, radius = rng.uniform(0.35, 0.6), rng.uniform(45.0, 70.0)
    away = RoadPath(_ramp_joint(block, main), (bend(-turn, radius), (rng.uniform(25.0, 40.0), 0.0)))
    ramp = _add_ramp(block, away)
    block.link(beside.forward[-1], (ramp.id,))
    block.exit = add_road(block, "d", main, ((rng.uniform(20.0, 35.0), 0.0),))


def _ramp_joint(block: Block, main: Socket) -> Pose:
    """Pose on the centreline of a lane to the right of the road's lanes, heading along the road."""
    return main.pose.moved(0.0, -(len(main.forward) + 0.5) * block.road.lane_width)


def _add_ramp(block: Block, path: RoadPath) -> Lane:
    half = block.road.lane_width / 2.0
    sides = {side: block.add_line(f"ramp{side}", EDGE, path.offset(d)) for side, d in (("l", half), ("r", -half))}
    block.footprint.append(strip(path, half, half))
    return block.add_lane("ramp", path, left_boundaries=(sides["l"],), right_boundaries=(sides["r"],))
