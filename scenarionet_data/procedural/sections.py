"""Sections of two-way road: parallel lanes along a reference line, with their lines, edges and tapers."""

from __future__ import annotations

import numpy as np
from shapely import Polygon

from scenarionet_data.procedural.path import PathPieces, RoadPath, shift
from scenarionet_data.procedural.roadmap import LINE_SPACING, Block, Lane, Socket
from scenarionet_data.scenario.vocabulary import MapFeatureType

EDGE = MapFeatureType.ROAD_EDGE_BOUNDARY
DIVIDER = MapFeatureType.ROAD_LINE_SOLID_DOUBLE_YELLOW
SEPARATOR = MapFeatureType.ROAD_LINE_BROKEN_SINGLE_WHITE


def add_road(block: Block, tag: str, socket: Socket, pieces: PathPieces, *, edge: RoadPath | None = None) -> Socket:
    """Continue every lane of ``socket`` along ``pieces``.

    Args:
        block: Gets the lanes and lines.
        tag: Name of the section within the block.
        socket: Start of the section.
        pieces: Of the reference line.
        edge: The right edge, if not parallel to the reference line.

    Returns:
        The open end.
    """
    line = RoadPath(socket.pose, pieces)
    width = block.road.lane_width
    divider = block.add_line(f"{tag}divider", DIVIDER, line)
    forward = _add_side(block, f"{tag}f", line, len(socket.forward), divider, edge)
    backward = _add_side(block, f"{tag}b", line.reversed(), len(socket.backward), divider, None)
    for before, lane in zip(socket.forward, forward, strict=True):
        block.link(before, (lane.id,))
    for after, lane in zip(socket.backward, backward, strict=True):
        block.link((lane.id,), after)
    block.footprint.append(strip(line, len(backward) * width, len(forward) * width))
    return Socket(line.end, tuple((lane.id,) for lane in forward), tuple((lane.id,) for lane in backward))


def _add_side(block: Block, tag: str, line: RoadPath, count: int, divider: str, edge: RoadPath | None) -> list[Lane]:
    """Add ``count`` lanes on the right of ``line``, in its direction."""
    width = block.road.lane_width
    lanes = [block.add_lane(f"{tag}{i}", line.offset(-(i + 0.5) * width)) for i in range(count)]
    separators = [block.add_line(f"{tag}line{i}", SEPARATOR, line.offset(-i * width)) for i in range(1, count)]
    boundaries = [divider, *separators, block.add_line(f"{tag}edge", EDGE, edge or line.offset(-count * width))]
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
    through = next(lane for lane in block.lanes if lane.id == end.forward[-1][0])
    through.junction, through.rank = junction, 1
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
