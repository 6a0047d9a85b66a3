"""Roads that change their width on both sides: bottlenecks, and one lane that both directions share.

A bottleneck changes the number of lanes of both directions at once, where ``sections.fork`` and ``sections.merge``
change that of one. Lengths are those of MetaDrive's blocks of these names.
"""

from __future__ import annotations

import numpy as np

from scenarionet_data.procedural.path import PathPieces, RoadPath, shift
from scenarionet_data.procedural.roadmap import Block, Lane, Socket
from scenarionet_data.procedural.sections import EDGE, add_road, ids_of, strip

_PER_LANE = 20.0
"""Length [m] over which a lane opens or closes; twice that for two."""
_MOST = 2
"""Lanes that open or close at most."""
_NARROW, _WIDE = (20.0, 50.0), (40.0, 60.0)
"""Shortest and longest road [m] on the narrow and on the wide side, where drivers change lanes."""
_SHARED = 40.0, 80.0
"""Shortest and longest part [m] on which a lane is shared, and that in which the sides close."""
_CLOSING = 12.0
_LEADS = 15.0, 30.0
"""Shortest and longest road [m] before and after a shared lane."""


def split(block: Block, socket: Socket, rng: np.random.Generator, room: int) -> None:
    """Add one or two lanes, at most ``room``, to both directions."""
    before = add_road(block, "a", socket, ((rng.uniform(*_NARROW), 0.0),))
    wide = _add_bottle(block, before, int(rng.integers(1, min(room, _MOST) + 1)))
    block.exit = add_road(block, "c", wide, ((rng.uniform(*_WIDE), 0.0),))


def bottleneck(block: Block, socket: Socket, rng: np.random.Generator, room: int) -> None:
    """Take one or two lanes, at most ``room``, from both directions."""
    before = add_road(block, "a", socket, ((rng.uniform(*_WIDE), 0.0),))
    narrow = _add_bottle(block, before, -int(rng.integers(1, min(room, _MOST) + 1)))
    block.exit = add_road(block, "c", narrow, ((rng.uniform(*_NARROW), 0.0),))


def _add_bottle(block: Block, socket: Socket, more: int) -> Socket:
    """Add a taper in which both directions get ``more`` lanes, or lose some when it is negative.

    Where lanes open, they leave the outermost one that goes on; where they close, they join it and give way.
    """
    width, length, changed = block.road.lane_width, _PER_LANE * abs(more), abs(more)
    line = RoadPath(socket.pose, ((length, 0.0),))
    kept = [len(side) - changed * (more < 0) for side in (socket.forward, socket.backward)]
    main = Socket(socket.pose, socket.forward[: kept[0]], socket.backward[: kept[1]])
    opening, closing = shift(length, -changed * width), shift(length, changed * width)
    edges = []
    for base, count, opens in ((line, kept[0], more > 0), (line.reversed(), kept[1], more < 0)):
        start = base.start.moved(0.0, -(count + changed * (not opens)) * width)
        edges.append(RoadPath(start, opening if opens else closing))
    end = add_road(block, "b", main, line.pieces, edge=edges[0], other_edge=edges[1])
    ahead, back, near = list(end.forward), list(end.backward), list(socket.forward)
    for base, side, count, opens in (
        (line, "f", kept[0], more > 0),
        (line.reversed(), "b", kept[1], more < 0),
    ):
        for k in range(1, changed + 1):
            start = base.start.moved(0.0, -(count - 0.5 + k * (not opens)) * width)
            path = RoadPath(start, shift(length, -k * width if opens else k * width))
            lane = block.add_lane(f"b{side}{'opens' if opens else 'closes'}{k}", path)
            if k == changed:
                lane.right_boundaries = (f"{block.index}.b{side}edge",)
            if not opens:
                lane.junction = block.index
            block.footprint.append(strip(path, width / 2.0, width / 2.0))
            if side == "f" and opens:
                block.link(near[-1], (lane.id,))
                ahead.append((lane.id,))
            elif side == "f":
                block.link(near[count - 1 + k], (lane.id,))
                ahead[-1] += (lane.id,)
            elif opens:
                block.link((lane.id,), socket.backward[count - 1 + k])
                back[-1] += (lane.id,)
            else:
                block.link((lane.id,), socket.backward[count - 1])
                back.append((lane.id,))
        if not opens:
            _give_priority(block, f"{block.index}.b{side}{count - 1}")
    return Socket(end.pose, tuple(ahead), tuple(back))


def _give_priority(block: Block, name: str) -> None:
    """Let the traffic of a lane go before that of lanes that close."""
    for lane in block.lanes:
        if lane.id == name:
            lane.junction, lane.rank = block.index, 1


def bidirection(block: Block, socket: Socket, rng: np.random.Generator, has_lights: bool) -> None:
    """Add a road on which both directions, of one lane each, share a lane: who comes second waits before it.

    The direction of the ego has priority, or lights say who goes.
    """
    before = add_road(block, "a", socket, ((rng.uniform(*_LEADS), 0.0),))
    narrow, width = block.road.lane_width / 2.0, block.road.lane_width
    shared = float(rng.uniform(*_SHARED))
    line = RoadPath(before.pose, ((2.0 * _CLOSING + shared, 0.0),))
    pieces: PathPieces = (*shift(_CLOSING, narrow), (shared, 0.0), *shift(_CLOSING, -narrow))
    lanes = list[Lane]()
    for side, base in (("f", line), ("b", line.reversed())):
        path = RoadPath(base.start.moved(0.0, -narrow), pieces)
        edge = block.add_line(f"b{side}edge", EDGE, RoadPath(base.start.moved(0.0, -width), pieces))
        lane = block.add_lane(f"b{side}0", path, junction=block.index, rank=int(side == "f"), is_intersection=True)
        lane.right_boundaries, lane.axis = (edge,), int(side == "b") if has_lights else lane.axis
        lanes.append(lane)
        block.footprint.append(strip(path, narrow, narrow))
    block.link(before.forward[0], (lanes[0].id,))
    block.link((lanes[1].id,), before.backward[0])
    after = Socket(line.end, *map(ids_of, ([lanes[0]], [lanes[1]])))
    block.exit = add_road(block, "c", after, ((rng.uniform(*_LEADS), 0.0),))
